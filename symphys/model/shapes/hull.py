"""Convex hulls of points: corners, faces, volume, centre of mass and moments."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

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


MAX_SEARCHED = 12
"""Corners of a face up to which every four are tried; of more, those that are spread evenly around it."""


@dataclass(frozen=True)
class FaceTable:
    """Faces and edges of a hull, and the hull within it.

    Attributes:
        normals, origins, across: (m, 3) of each face: outward, its middle, and a direction in it, unit vectors.
        corners: (m, 4, 2) four of its corners, those that cover most of it, in order around it: along ``across`` and
            along normal x across from the middle [m]; of a triangle the last twice.
        edges: pairs of indices of corners between faces.
        core: (n, 3) corners of what lies a given share of its depth within all faces [m].
    """

    normals: Array
    origins: Array
    across: Array
    corners: Array
    edges: tuple[tuple[int, int], ...]
    core: Array


@lru_cache(maxsize=512)
def face_table(points: Corners, depth: float) -> FaceTable:
    """Return the faces of a hull; ``depth``: of its core, as a share of its centroid's distance from the nearest."""
    from scipy.spatial import HalfspaceIntersection

    hull = hull_of(points)
    assert hull is not None, "a hull has a volume"
    normals, origins, across, corners = [], [], [], []
    owners: dict[tuple[int, int], set[int]] = {}
    for number, face in enumerate(hull.faces):
        own = hull.corners[list(face)]
        middle = own.mean(axis=0)
        _, _, frame = np.linalg.svd(own - middle)
        normal, u = frame[2], frame[0]
        normal = normal if normal @ (middle - hull.centroid) > 0 else -normal
        flat = (own - middle) @ np.stack([u, np.cross(normal, u)], axis=1)
        order = np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))
        around = [face[k] for k in order]
        for pair in zip(around, [*around[1:], around[0]], strict=True):
            owners.setdefault((min(pair), max(pair)), set()).add(number)
        normals.append(normal)
        origins.append(middle)
        across.append(u)
        corners.append(_four(flat[order]))
    planes = np.array(normals)
    edges = tuple(pair for pair, faces in sorted(owners.items()) if len(faces) > 1)
    table = planes, np.array(origins), np.array(across), np.array(corners), edges
    if depth == 0:
        return FaceTable(*table, hull.corners)
    heights = (planes * np.array(origins)).sum(axis=1)
    room = heights - planes @ hull.centroid
    inner = heights - depth * room.min()
    core = HalfspaceIntersection(np.column_stack([planes, -inner]), hull.centroid).intersections
    core = np.unique(np.round(core / room.min(), 12), axis=0) * room.min()
    return FaceTable(*table, core)


def _four(places: Array) -> Array:
    """Return four of the corners (k, 2) of a polygon, in their order: those that enclose most."""
    count = len(places)
    if count <= 4:
        return places[[*range(count), *[count - 1] * (4 - count)]]
    tried = range(count) if count <= MAX_SEARCHED else np.linspace(0, count, MAX_SEARCHED, endpoint=False).astype(int)
    return max((places[list(each)] for each in combinations(tried, 4)), key=_enclosed)


def _enclosed(places: Array) -> float:
    """Return the area of a polygon."""
    x, y = places.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
