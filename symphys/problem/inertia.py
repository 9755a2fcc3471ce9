"""Inertia of bodies: of compounds of spheres, and whether a given one is that of any real body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.shapes import Scalar, Sphere
from symphys.world import SOLID_SPHERE

Array = NDArray[np.float64]
ROUNDING = 1e-9
"""Relative slack for symmetry and the triangle inequality, which flat and thin bodies meet with equality."""


def volume(radius: Scalar) -> Scalar:
    """Of a sphere [m^3]."""
    return 4 / 3 * np.pi * radius**3


def shares(spheres: Sequence[Sphere]) -> Array:
    """(n,): the share of each sphere in the mass, for equal density."""
    volumes = np.array([volume(sphere.radius) for sphere in spheres])
    return np.asarray(volumes / volumes.sum())


def centre_of_mass(spheres: Sequence[Sphere]) -> Array:
    """(3,): of solid spheres of equal density [m], body frame; parts that overlap count twice."""
    return np.asarray(shares(spheres) @ np.array([sphere.centre for sphere in spheres], float))


def specific(spheres: Sequence[Sphere]) -> Array:
    """(3, 3): inertia per mass [m^2] of solid spheres of equal density about the body's origin."""
    total = np.zeros((3, 3))
    for share, sphere in zip(shares(spheres), spheres, strict=True):
        c = np.array(sphere.centre, float)
        own = SOLID_SPHERE * sphere.radius**2
        total += share * ((own + c @ c) * np.eye(3) - np.outer(c, c))
    return total


def complaint(value: float | Sequence[float] | Sequence[Sequence[float]]) -> str:
    """Why no rigid body has this inertia; empty if one has."""
    given = np.asarray(value, float)
    if given.ndim == 2 and not np.allclose(given, given.T, rtol=ROUNDING, atol=ROUNDING * np.abs(given).max()):
        return "the matrix must be symmetric"
    moments = np.sort(np.linalg.eigvalsh(given) if given.ndim == 2 else np.broadcast_to(given, 3))
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0:
        return f"the principal moments must be positive; they are {listed}"
    if moments[0] + moments[1] < moments[2] * (1 - ROUNDING):
        return f"no principal moment may exceed the sum of the other two; they are {listed}"
    return ""
