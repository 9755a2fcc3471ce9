"""Solids with free sizes and pose: distances of points, and points on the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symphys.model.shapes import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from symphys.types import Array

FOOT_STEPS = 8
"""Newton steps towards the foot of a perpendicular on an ellipsoid."""
SURFACE_POINTS = 1500
"""Points on the surface of a solid."""


@dataclass(frozen=True)
class Placed:
    """A solid: kind, place (3,), axes (3, 3) in columns, and sizes: radius, radius and half length, or three [m]."""

    kind: str
    centre: Array
    axes: Array
    sizes: Array

    def distance(self, points: Array) -> Array:
        """Return the signed distances (n,) [m], negative inside."""
        return DISTANCES[self.kind]((points - self.centre) @ self.axes, self.sizes)

    def surface(self) -> Array:
        """Return points (k, 3) all over the surface."""
        return np.asarray(self.centre + SURFACES[self.kind](self.sizes) @ self.axes.T)

    def shape(self) -> Shape:
        """Return the shape of the model."""
        centre = tuple(self.centre.tolist())
        orientation = quaternion(self.axes)
        a, *more = self.sizes.tolist()
        if self.kind == "sphere":
            return Sphere(a, centre)
        if self.kind == "capsule":
            return Capsule(a, more[0], centre, orientation)
        if self.kind == "cylinder":
            return Cylinder(a, more[0], centre, orientation)
        kind = Box if self.kind == "box" else Ellipsoid
        return kind((a, *more), centre, orientation)


def to_sphere(p: Array, sizes: Array) -> Array:
    """Return distances from a sphere about the origin."""
    return np.asarray(np.linalg.norm(p, axis=1) - sizes[0])


def to_capsule(p: Array, sizes: Array) -> Array:
    """Return distances from a capsule along z."""
    along = np.clip(p[:, 2], -sizes[1], sizes[1])
    return np.asarray(np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + (p[:, 2] - along) ** 2) - sizes[0])


def to_cylinder(p: Array, sizes: Array) -> Array:
    """Return distances from a cylinder along z."""
    over = np.stack([np.hypot(p[:, 0], p[:, 1]) - sizes[0], np.abs(p[:, 2]) - sizes[1]])
    return np.asarray(np.linalg.norm(np.maximum(over, 0), axis=0) + np.minimum(over.max(axis=0), 0))


def to_box(p: Array, sizes: Array) -> Array:
    """Return distances from a box by its half sizes."""
    over = np.abs(p) - sizes
    return np.asarray(np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0))


def to_ellipsoid(p: Array, sizes: Array) -> Array:
    """Return distances from an ellipsoid, by the same iteration as ``EllipsoidField`` of the collision."""
    squares, scaled = sizes**2, sizes * p
    low = -0.98 * squares.min()
    m = np.maximum((np.abs(scaled) - squares).max(axis=1), low)
    for _ in range(FOOT_STEPS):
        parts = scaled / (squares + m[:, None])
        square = (parts**2).sum(axis=1) + 1e-30
        slope = (parts**2 / (squares + m[:, None])).sum(axis=1) + 1e-30
        m = np.maximum(m + (np.sqrt(square) - 1) * square / slope, low)
    return np.asarray(m * np.linalg.norm(p / (squares + m[:, None]), axis=1))


DISTANCES: dict[str, Callable[[Array, Array], Array]] = {
    "sphere": to_sphere,
    "capsule": to_capsule,
    "cylinder": to_cylinder,
    "box": to_box,
    "ellipsoid": to_ellipsoid,
}
"""Signed distances by the kinds of shapes."""


def directions(count: int = SURFACE_POINTS) -> Array:
    """Return unit vectors (count, 3), spread evenly by a Fibonacci spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)


def capsule_surface(sizes: Array) -> Array:
    """Return points (k, 3) on both ends and the side."""
    ball = sizes[0] * directions()
    ball[:, 2] += np.where(ball[:, 2] > 0, sizes[1], -sizes[1])
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(-sizes[1], sizes[1], 30))
    side = np.stack([sizes[0] * np.cos(turn), sizes[0] * np.sin(turn), z], axis=-1).reshape(-1, 3)
    return np.concatenate([ball, side])


def cylinder_surface(sizes: Array) -> Array:
    """Return points (k, 3) on both faces and the side."""
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(-sizes[1], sizes[1], 24))
    side = np.stack([sizes[0] * np.cos(turn), sizes[0] * np.sin(turn), z], axis=-1).reshape(-1, 3)
    turn, out = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, 1, 10))
    face = sizes[0] * np.stack([out * np.cos(turn), out * np.sin(turn), 0 * out], axis=-1).reshape(-1, 3)
    end = np.array([0.0, 0.0, sizes[1]])
    return np.concatenate([side, face + end, face - end])


def box_surface(sizes: Array) -> Array:
    """Return points (k, 3) of a grid on each face."""
    side = np.linspace(-1, 1, 16)
    u, v = (each.ravel() for each in np.meshgrid(side, side))
    found = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.zeros((u.size, 3))
            face[:, axis], face[:, axis - 2], face[:, axis - 1] = sign, u, v
            found.append(face * sizes)
    return np.concatenate(found)


SURFACES: dict[str, Callable[[Array], Array]] = {
    "sphere": lambda sizes: sizes[0] * directions(),
    "capsule": capsule_surface,
    "cylinder": cylinder_surface,
    "box": box_surface,
    "ellipsoid": lambda sizes: sizes * directions(),
}
"""Points on the surface by the kinds of shapes."""


def quaternion(axes: Array) -> tuple[float, float, float, float]:
    """Return the unit quaternion w x y z of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat(canonical=True).tolist()
    return w, x, y, z


def union_distance(solids: list[Placed], points: Array) -> Array:
    """Return the distances (n,) [m] from the nearest of several solids."""
    return np.asarray(np.min([solid.distance(points) for solid in solids], axis=0))
