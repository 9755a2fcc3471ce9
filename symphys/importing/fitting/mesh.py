"""The visible surface of a mesh: points of its outer surface, and whether a point lies outside.

Meshes of robots are seldom closed: they have inner walls, screws and gaps. So what counts as their solid is the visual
hull (Laurentini, "The visual hull concept for silhouette-based image understanding", 1994) with depth: a point is
outside if it is before the surface as seen from one of many directions. Hollows that are seen from nowhere are filled.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.records import dataclass
from symphys.types import Array, Ints

SAMPLES = 40_000
"""Points on the surface."""
VIEWS = 48
"""Number of viewing directions."""
PIXELS = 48
"""Pixels of a view, along the longest side."""
MIN_WITNESSES = 4
"""Views that must see a point in front of the surface."""
GAP_NEIGHBOURS = 5
"""Number of nearer neighbours, of eight, from which a pixel counts as a gap between samples."""
GOLDEN = (1 + 5**0.5) / 2
"""The golden ratio."""


@dataclass(frozen=True)
class DepthView:
    """The depths of a surface as seen from a direction; ``axes`` (3, 3): right, up, towards the viewer."""

    axes: Array
    depth: Array
    low: Array
    pixel: float

    def ahead(self, points: Array) -> Array:
        """Return how far points lie in front of the surface (n,) [m]; infinite beside it."""
        seen = points @ self.axes.T
        row, column = np.floor((seen[:, :2] - self.low) / self.pixel).astype(int).T
        rows, columns = self.depth.shape
        within = (row >= 0) & (column >= 0) & (row < rows) & (column < columns)
        depth = np.full(len(points), -np.inf)
        depth[within] = self.depth[row[within], column[within]]
        return np.asarray(seen[:, 2] - depth)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: ``vertices`` (n, 3) [m], ``faces`` (m, 3)."""

    vertices: Array
    faces: Ints

    @cached_property
    def size(self) -> float:
        """The longest side of the box that holds it [m]."""
        return float(np.ptp(self.vertices[np.unique(self.faces)], axis=0).max())

    @cached_property
    def samples(self) -> Array:
        """The samples (k, 3): points spread over all triangles by area, reproducibly, and all vertices."""
        corners = self.vertices[self.faces]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        rng = np.random.default_rng(0)
        ends = np.cumsum(areas)
        place = np.searchsorted(ends, (np.arange(SAMPLES) + 0.5) / SAMPLES * ends[-1])
        u, v = rng.random((2, SAMPLES))
        folded = u + v > 1
        u[folded], v[folded] = 1 - u[folded], 1 - v[folded]
        a, b, c = corners[np.minimum(place, len(areas) - 1)].transpose(1, 0, 2)
        return np.concatenate([a + u[:, None] * (b - a) + v[:, None] * (c - a), self.vertices[np.unique(self.faces)]])

    @cached_property
    def views(self) -> tuple[DepthView, ...]:
        """Views from directions that are spread evenly over the sphere by a Fibonacci spiral, and along the axes."""
        height = 1 - (2 * np.arange(VIEWS) + 1) / VIEWS
        turn, ring = 2 * np.pi * np.arange(VIEWS) / GOLDEN, np.sqrt(1 - height**2)
        fronts = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
        sides = np.array([*np.eye(3), *-np.eye(3)])
        return tuple(self._view(front) for front in [*fronts, *sides])

    def _view(self, front: Array) -> DepthView:
        right = np.cross(np.eye(3)[np.abs(front).argmin()], front)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(front, right), front])
        seen = self.samples @ axes.T
        low, pixel = seen[:, :2].min(axis=0), float(np.ptp(seen[:, :2], axis=0).max()) / PIXELS
        cells = np.floor((seen[:, :2] - low) / pixel).astype(int)
        depth = np.full(cells.max(axis=0) + 1, -np.inf)
        np.maximum.at(depth, tuple(cells.T), seen[:, 2])
        return DepthView(axes, filled(depth), low, pixel)

    @cached_property
    def outer(self) -> Array:
        """The samples (k, 3) that are seen from outside."""
        slack = 1.5 * self.size / PIXELS
        return np.asarray(self.samples[self.ahead(self.samples) > -slack / 2])

    def ahead(self, points: Array) -> Array:
        """Return how far points lie in front of the surface (n,) [m] for ``MIN_WITNESSES`` views: one may be a gap."""
        ahead = np.array([view.ahead(points) for view in self.views])
        return np.asarray(np.partition(ahead, -MIN_WITNESSES, axis=0)[-MIN_WITNESSES])

    def outside(self, points: Array) -> NDArray[np.bool_]:
        """Return whether points lie in front of the surface (n,), as seen from some directions.

        A pixel has the depth of its nearest sample. So points inside never count as outside, and points outside by less
        than a two-hundredth of the mesh's size may count as inside.
        """
        return np.asarray(self.ahead(points) > 0)

    @cached_property
    def filling(self) -> Array:
        """The points (k, 3) of a regular grid inside."""
        low, high = self.outer.min(axis=0), self.outer.max(axis=0)
        step = self.size / 40
        sides = [np.arange(a + step / 2, b, step) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
        inside = grid[~self.outside(grid)]
        return inside if len(inside) > 10 else self.outer

    @cached_property
    def tree(self) -> Any:
        """A search tree of all samples."""
        from scipy.spatial import cKDTree  # late: for those who fit meshes

        return cKDTree(self.samples)

    def distance(self, points: Array) -> Array:
        """Return the distances (n,) [m] to the nearest triangle, exact for the farthest points."""
        near = np.asarray(self.tree.query(points)[0], float)
        for k in np.argsort(near)[-16:]:
            near[k] = triangle_distances(self.vertices[self.faces], points[k]).min()
        return near


def filled(depth: Array) -> Array:
    """Raise depths to the ``GAP_NEIGHBOURS``-th nearest of eight neighbours: a pixel may have no sample."""
    padded = np.pad(depth, 1, constant_values=-np.inf)
    rows, columns = depth.shape
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.sort([padded[i : i + rows, j : j + columns] for i, j in shifts], axis=0)
    return np.asarray(np.maximum(depth, around[-GAP_NEIGHBOURS]))


def triangle_distances(triangles: Array, point: Array) -> Array:
    """Return the distances (m,) [m] from a point (3,) to triangles (m, 3, 3); flat ones by their edges."""
    squares = []
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = (normal**2).sum(axis=1)
    within = area > 0
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge, arm = triangles[:, j] - triangles[:, i], point - triangles[:, i]
        length = (edge**2).sum(axis=1)
        share = np.clip((edge * arm).sum(axis=1) / np.where(length > 0, length, 1), 0, 1)
        squares.append(((arm - share[:, None] * edge) ** 2).sum(axis=1))
        within &= (np.cross(normal, edge) * arm).sum(axis=1) >= 0
    height = ((point - triangles[:, 0]) * normal).sum(axis=1) ** 2 / np.where(area > 0, area, 1)
    return np.asarray(np.sqrt(np.where(within, height, np.min(squares, axis=0))))
