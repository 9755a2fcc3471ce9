"""How a solid looks in a parallel projection: its outline, and the edges of a box that are seen inside it."""

from __future__ import annotations

import numpy as np

from symphys.trajectory import Array

ROUND = 16
"""Straight pieces of a half circle."""
SEEN = 1e-6
"""A face whose normal has less than this share of its length towards the viewer is seen from its edge."""


def outline(axes: Array, radius: float) -> Array:
    """(n, 2): the outline about the centre, counter-clockwise, of all within ``radius`` of a projected box.

    Args:
        axes: (k, 2) projected half axes of the box; those of length 0 do not count.
        radius: of the rounding.
    """
    lengths = np.linalg.norm(axes, axis=1)
    sides = axes[lengths > 1e-9 * max(float(lengths.max(initial=0.0)), radius)]
    if not len(sides):
        return np.zeros((1, 2)) + radius * directions(0.0, 2 * np.pi)[:-1]
    upward = (sides[:, 1] > 0) | ((sides[:, 1] == 0) & (sides[:, 0] > 0))
    sides = np.where(upward[:, None], sides, -sides)
    sides = sides[np.argsort(np.arctan2(sides[:, 1], sides[:, 0]))]
    edges = 2 * np.concatenate([sides, -sides])
    corners = np.cumsum(edges, axis=0) - sides.sum(axis=0)  # a corner after each edge
    if radius == 0:
        return np.asarray(corners)
    facing = np.unwrap(np.arctan2(-edges[:, 0], edges[:, 1]))
    after = np.append(facing[1:], facing[0] + 2 * np.pi)
    arcs = [corner + radius * directions(a, b) for corner, a, b in zip(corners, facing, after, strict=True)]
    return np.concatenate(arcs)


def directions(start: float, stop: float) -> Array:
    """(n, 2): unit vectors from one angle to another."""
    angles = np.linspace(start, stop, max(int(np.ceil(abs(stop - start) / np.pi * ROUND)), 1) + 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def inner_edges(axes: Array, front: Array) -> Array:
    """(k, 2, 3): the edges of a box between two faces that the viewer sees, about its centre.

    Args:
        axes: (3, 3) half axes as rows, orthogonal.
        front: (3,) towards the viewer, of length 1.
    """
    lengths = np.maximum(np.linalg.norm(axes, axis=1), 1e-300)
    towards = axes @ front / lengths
    seen = np.abs(towards) > SEEN
    nearest = np.where(seen & (towards < 0), -1.0, 1.0)[:, None] * axes
    corner = nearest.sum(axis=0)
    found = [[corner, corner - 2 * nearest[k]] for k in range(3) if seen[k - 1] and seen[k - 2]]
    return np.array(found, float).reshape(-1, 2, 3)
