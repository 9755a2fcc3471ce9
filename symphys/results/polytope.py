"""Convex hulls of points: the corners of one in a plane, and the faces and edges of one in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

COLLINEAR = 1e-9
"""A corner counts where it makes a triangle with its neighbours of more than this area, by the square of the size."""
COPLANAR = 1e-8
"""A point this near to the plane of a face belongs to it, by the size of the hull."""
THIN = 1e-7
"""Corners whose extent in a direction is less, by the largest one, are in a plane or in a line."""
SMOOTH = np.cos(np.deg2rad(35))
"""Faces whose normals are nearer to each other approximate a curved surface: pictures draw no edge between them."""


def flat_hull(points: Array, size: float = 0.0) -> list[int]:
    """The corners of the convex hull of (k, 2) points, counter-clockwise; two for a line.

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
        """(e,): whether an edge is one of the solid, and none that only approximates a curved surface."""
        left, right = self.normals[self.edges[:, 2]], self.normals[self.edges[:, 3]]
        return np.asarray((left * right).sum(axis=1) < SMOOTH)


@lru_cache(maxsize=256)
def make_polytope(corners: tuple[tuple[float, ...], ...]) -> Polytope:
    """The convex hull of (k, 3) corners [m]."""
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
    """The pairs of neighbours in a closed loop."""
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def face_normal(corners: Array) -> Array:
    """(3,): the unit normal of a polygon (k, 3), to the side from which it is counter-clockwise."""
    arms = corners - corners[0]
    area = np.cross(arms[1:-1], arms[2:]).sum(axis=0)
    return np.asarray(area / np.linalg.norm(area))


def find_faces(points: Array) -> list[list[int]]:
    """The faces of the hull of (k, 3) points within [-1, 1]."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(axes) == 3:
        axes[2] *= np.sign(np.linalg.det(axes))
    along = points @ axes.T
    extent = np.ptp(along, axis=0)
    rank = int((extent > THIN * extent.max()).sum())
    if rank < 2:
        return []
    if rank == 2:
        loop = flat_hull(along[:, :2])
        return [loop, loop[::-1]]
    return wrapped(along / extent)  # a stretch does not change which corners are those of a face


def wrapped(points: Array) -> list[list[int]]:
    """The faces of the hull of (k, 3) points of extent 1, by turning a plane about each edge of those found.

    This is the gift wrapping of Chand and Kapur, "An algorithm for convex polytopes", 1970, for all corners of a face
    at once. Where rounding makes faces that do not fit together, it ends with the largest number of faces there can be.
    """
    faces = [first_face(points)]
    left = set(steps(faces[0]))
    for face in faces:  # grows meanwhile
        normal = face_normal(points[face])
        for a, b in steps(face):
            if (b, a) not in left and len(faces) < 2 * len(points):
                faces.append(face_on(points, a, turned(points, a, points[b] - points[a], normal)))
                left |= set(steps(faces[-1]))
    return faces


def first_face(points: Array) -> list[int]:
    """A face at the lowest x: a plane turned first about a line along y, then about the edge or line that it meets."""
    start = int(points[:, 0].argmin())
    normal = turned(points, start, np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
    arms = points - points[start]
    touched = (arms @ normal > -COPLANAR) & (np.hypot(arms[:, 0], arms[:, 2]) > COPLANAR)
    along = arms[np.flatnonzero(touched)[0]]
    return face_on(points, start, turned(points, start, along, normal))


def turned(points: Array, start: int, along: Array, normal: Array) -> Array:
    """(3,): the normal of a plane that holds all points on its inner side, after it turns about a line in it.

    It turns away from the left side of the line through point ``start``, until it meets points beside the line.
    """
    along = along / np.linalg.norm(along)
    inward = np.cross(normal, along)
    arms = points - points[start]
    x, depth = arms @ inward, np.maximum(-arms @ normal, 0.0)
    angles = np.where(np.hypot(x, depth) > COPLANAR, np.arctan2(depth, x), -1.0)
    angle = angles.max()
    return np.asarray(-np.sin(angle) * inward - np.cos(angle) * normal)


def face_on(points: Array, start: int, normal: Array) -> list[int]:
    """The corners of the face in a plane through point ``start``."""
    on = np.flatnonzero((points - points[start]) @ normal > -COPLANAR)
    right = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    right = right / np.linalg.norm(right)
    flat = np.stack([points[on] @ right, points[on] @ np.cross(normal, right)], axis=1)
    return [int(on[k]) for k in flat_hull(flat)]
