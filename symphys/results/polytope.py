"""Convex hulls of points: the corners of one in a plane, and the faces and edges of one in space."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from symphys.records import dataclass
from symphys.types import Array, Ints

COLLINEAR = 1e-9
"""Least area of a corner's triangle with its neighbours, relative to the squared size."""
COPLANAR = 1e-8
"""Largest distance from the plane of a face, relative to the size of the hull, of a point of the face."""
FLAT_EXTENT = 1e-7
"""Relative extent in a direction below which corners are in a plane or on a line."""
SMOOTH = np.cos(np.deg2rad(35))
"""Cosine between normals of faces above which pictures draw no edge: they approximate a curved surface."""


def flat_hull(points: Array, size: float = 0.0) -> list[int]:
    """Return the corners of the convex hull of (k, 2) points, counter-clockwise; two for a line.

    Points are the same, or in a line, within a small share of their extent or of ``size``, whichever is larger. This is
    the monotone chain of Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979.
    """
    extent = float(np.ptp(points, axis=0).max())
    size = max(size, extent)
    if extent <= COLLINEAR * size:
        return [0]
    placed = (points - points.min(axis=0)) / size
    along, column = np.argsort(placed[:, 0]), np.empty(len(points))
    # Rounding must not decide the order of points that are one above the other.
    column[along] = np.cumsum(np.diff(placed[along, 0], prepend=0) > COLLINEAR)
    order = np.lexsort((placed[:, 1], column)).tolist()
    x, y = placed.T.tolist()

    def chain(indices: list[int]) -> list[int]:
        kept: list[int] = []
        for c in indices:
            while len(kept) > 1:
                a, b = kept[-2:]
                if (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]) > COLLINEAR:
                    break
                kept.pop()
            kept.append(c)
        return kept[:-1]

    return chain(order) + chain(order[::-1])


@dataclass(frozen=True)
class Polytope:
    """The convex hull of some corners; faces in one plane are one.

    Attributes:
        faces: indices of the corners of each, counter-clockwise as seen from outside. Corners in one plane have two
            faces, back to back; corners in a line none.
        normals: (f, 3) unit vectors out of the faces.
        edges: (e, 4) indices: the two corners, the face to the left of the way from the first to the second as seen
            from outside, and the face to the right.
        inradius: distance from the origin to the nearest plane of a face [m]; 0 without faces.
    """

    faces: tuple[tuple[int, ...], ...]
    normals: Array
    edges: Ints
    inradius: float

    @property
    def sharp(self) -> NDArray[np.bool_]:
        """Return (e,) whether an edge is one of the solid, and none that only approximates a curved surface."""
        left, right = self.normals[self.edges[:, 2]], self.normals[self.edges[:, 3]]
        return np.asarray((left * right).sum(axis=1) < SMOOTH)


@lru_cache(maxsize=256)
def make_polytope(corners: tuple[tuple[float, ...], ...]) -> Polytope:
    """Return the convex hull of (k, 3) corners [m]."""
    points = np.array(corners, float)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    size = float(np.abs(points - middle).max())
    loops = find_faces((points - middle) / size) if size > 0 else []
    normals = np.array([face_normal((points[loop] - middle) / size) for loop in loops]).reshape(-1, 3)
    left = {(a, b): f for f, loop in enumerate(loops) for a, b in steps(loop)}
    edges = [(a, b, f, left[b, a]) for (a, b), f in left.items() if a < b and (b, a) in left]
    depths = [float((points[loop] @ normal).max()) for loop, normal in zip(loops, normals, strict=True)]
    return Polytope(
        tuple(map(tuple, loops)), normals, np.array(edges, np.int64).reshape(-1, 4), max(min(depths, default=0.0), 0.0)
    )


def steps(loop: list[int]) -> list[tuple[int, int]]:
    """Return the pairs of neighbours in a closed loop."""
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def face_normal(corners: Array) -> Array:
    """Return (3,) the unit normal of a polygon (k, 3), to the side from which it is counter-clockwise."""
    arms = corners - corners[0]
    area = np.cross(arms[1:-1], arms[2:]).sum(axis=0)
    return np.asarray(area / np.linalg.norm(area))


def find_faces(points: Array) -> list[list[int]]:
    """Return the faces of the hull of (k, 3) points within [-1, 1]."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(axes) == 3:
        axes[2] *= np.sign(np.linalg.det(axes))
    along = points @ axes.T
    extent = np.ptp(along, axis=0)
    rank = int((extent > FLAT_EXTENT * extent.max()).sum())
    if rank < 2:
        return []
    if rank == 2:
        loop = flat_hull(along[:, :2])
        return [loop, loop[::-1]]
    return merged(along / extent)  # a stretch does not change which corners are those of a face


def merged(points: Array) -> list[list[int]]:
    """Return the faces of the hull of (k, 3) points of extent 1, with one face for all in one plane."""
    from scipy.spatial import ConvexHull  # takes half a second: late, for those who draw polytopes

    planes = ConvexHull(points).equations
    loops: dict[tuple[int, ...], list[int]] = {}
    for plane in planes:
        on = np.flatnonzero(points @ plane[:3] + plane[3] > -COPLANAR)
        if tuple(on) not in loops:
            loops[tuple(on)] = face_on(points, on, plane[:3])
    return list(loops.values())


def face_on(points: Array, on: Ints, normal: Array) -> list[int]:
    """Return the corners of the face with these points, counter-clockwise about its normal."""
    right = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    right = right / np.linalg.norm(right)
    flat = np.stack([points[on] @ right, points[on] @ np.cross(normal, right)], axis=1)
    return [int(on[k]) for k in flat_hull(flat)]
