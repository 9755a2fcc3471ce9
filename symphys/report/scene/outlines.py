"""How a solid looks in a parallel projection: its outline, and the edges that are seen inside it."""

from __future__ import annotations

import numpy as np

from symphys.report.scene.views import turn
from symphys.results.polytope import flat_hull
from symphys.results.scene import Solid
from symphys.types import Array

ROUND = 16
"""Straight pieces of a half circle."""
SEEN = 1e-6
"""A face whose normal has less than this share of its length towards the viewer is seen from its edge."""


def outline(points: Array, radius: float) -> Array:
    """(n, 2): the outline of all within ``radius`` of the hull of (k, 2) projected corners, counter-clockwise."""
    corners = points[flat_hull(points, radius)]
    if len(corners) == 1:
        return corners + radius * directions(0.0, 2 * np.pi)[:-1]
    if radius == 0:
        return np.asarray(corners)
    edges = corners - np.roll(corners, 1, axis=0)  # an edge before each corner
    facing = np.arctan2(-edges[:, 0], edges[:, 1])
    turns = np.mod(np.roll(facing, -1) - facing, 2 * np.pi)
    arcs = [corner + radius * directions(a, a + by) for corner, a, by in zip(corners, facing, turns, strict=True)]
    return np.concatenate(arcs)


def directions(start: float, stop: float) -> Array:
    """(n, 2): unit vectors from one angle to another."""
    angles = np.linspace(start, stop, max(int(np.ceil(abs(stop - start) / np.pi * ROUND)), 1) + 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def inner_edges(orientation: Array, solid: Solid, front: Array) -> Array:
    """(k, 2, 3) [m]: the edges between two faces that the viewer sees, from the solid's centre, in the world.

    Args:
        orientation: (4,) of the body.
        solid: a ball and a capsule have no edges.
        front: (3,) towards the viewer, of length 1.
    """
    polytope = solid.polytope
    normals, ends = (turn(orientation, turn(solid.orientation, own)) for own in (polytope.normals, solid.corners))
    seen = normals @ front > SEEN
    between = polytope.edges[polytope.sharp & seen[polytope.edges[:, 2:]].all(axis=1), :2]
    return np.asarray(ends[between])
