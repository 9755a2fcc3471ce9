"""Convex hulls of points: corners, faces, volume, centre of mass and moments."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from symphys.model.shapes.shape import MIN_FLATNESS
from symphys.records import dataclass
from symphys.types import Array, Ints

COPLANAR_TOLERANCE = 1e-6
"""Faces whose planes agree to this, by the size of the hull, are one."""


class Corners(tuple[tuple[float, float, float], ...]):
    """Points (n, 3). A type of its own, so that tracing a step takes it as a whole, not number by number."""

    __slots__ = ()


@dataclass(frozen=True)
class Hull:
    """The convex hull of points, as a solid of density 1.

    Attributes:
        corners: (k, 3) [m].
        triangles: (m, 3) indices of corners, counter-clockwise as seen from outside.
        faces: the corners of each face; triangles in one plane are one.
        volume: [m^3].
        centroid: (3,) centre of mass [m].
        tensor: (3, 3) inertia about the centroid by mass [m^2].
    """

    corners: Array
    triangles: Ints
    faces: tuple[tuple[int, ...], ...]
    volume: float
    centroid: Array
    tensor: Array


@lru_cache(maxsize=512)
def hull_of(points: Corners) -> Hull | None:
    """The hull of points; None if they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError  # takes half a second: late, for those who have hulls

    given = np.array(points, float)
    middle = given.mean(axis=0)
    extent = np.linalg.svd(given - middle, compute_uv=False)
    if len(given) < 4 or extent[2] < MIN_FLATNESS * extent[0]:
        return None
    size = float(np.abs(given - middle).max())
    try:
        found = ConvexHull((given - middle) / size)
    except QhullError:
        return None
    kept = np.sort(found.vertices)
    place = np.full(len(given), -1)
    place[kept] = np.arange(len(kept))
    corners, triangles, planes = given[kept], place[found.simplices], found.equations
    sides = corners[triangles]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    inward = (normals * planes[:, :3]).sum(axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    height = ((corners - middle) / size) @ planes[:, :3].T + planes[:, 3]
    faces = sorted({tuple(np.flatnonzero(near).tolist()) for near in (height > -COPLANAR_TOLERANCE).T})
    return Hull(corners, triangles, tuple(faces), *solid(corners, triangles, middle))


def solid(corners: Array, triangles: Ints, middle: Array) -> tuple[float, Array, Array]:
    """Volume, centre of mass and inertia by mass of what closed triangles enclose; ``middle``: any point near it.

    Each triangle makes a tetrahedron with that point; what lies outside counts negative.
    """
    a = (corners - middle)[triangles]
    volumes = (a[:, 0] * np.cross(a[:, 1], a[:, 2])).sum(axis=1) / 6
    volume, sums = float(volumes.sum()), a.sum(axis=1)
    centroid = volumes @ sums / 4 / volume
    squares = np.einsum("t,tki,tkj->ij", volumes, a, a) + np.einsum("t,ti,tj->ij", volumes, sums, sums)
    spread = squares / 20 / volume - np.outer(centroid, centroid)
    return volume, centroid + middle, np.trace(spread) * np.eye(3) - spread
