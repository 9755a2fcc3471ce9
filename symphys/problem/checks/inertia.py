"""Inertia of bodies: of compounds of solid shapes, and whether a given one is that of any real body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.scalar import is_zero
from symphys.model.shapes import UPRIGHT, Scalar, Shape

Array = NDArray[np.float64]
Tensor = list[list[Scalar]]
"""(3, 3)"""
ROUNDING = 1e-9
"""Relative slack for symmetry and the triangle inequality, which flat and thin bodies meet with equality."""
NOISE = 1e-14
"""Products of inertia below this share of the trace are rounding."""


def shares(shapes: Sequence[Shape]) -> list[Scalar]:
    """The share of each shape in the mass, for equal density."""
    if len(shapes) == 1:
        return [1.0]
    volumes = [shape.volume for shape in shapes]
    whole = sum(volumes)
    if whole == 0:
        return [np.nan] * len(shapes)
    return [part / whole for part in volumes]


def centre_of_mass(shapes: Sequence[Shape]) -> Array:
    """(3,): of solid shapes of equal density [m], body frame; parts that overlap count twice."""
    return np.asarray(np.array(shares(shapes)) @ np.array([shape.centre for shape in shapes], float))


def specific(shapes: Sequence[Shape]) -> Tensor:
    """Inertia per mass [m^2] of solid shapes of equal density about the body's origin; sizes may be symbols."""
    total: Tensor = [[0.0] * 3 for _ in range(3)]
    for share, shape in zip(shares(shapes), shapes, strict=True):
        own, c, turned = shape.moments, shape.centre, axes(shape)
        arm = sum(x * x for x in c)
        for i in range(3):
            for j in range(3):
                spun = sum(turned[i][k] * turned[j][k] * own[k] for k in range(3) if turned[i][k] * turned[j][k])
                total[i][j] = total[i][j] + share * (spun + (arm if i == j else 0.0) - c[i] * c[j])
    return total


def axes(shape: Shape) -> list[list[float]]:
    """(3, 3): a shape's own axes as columns, body frame."""
    if shape.orientation == UPRIGHT:
        return [[float(i == j) for j in range(3)] for i in range(3)]
    found: list[list[float]] = np.array(rotation.matrix(shape.orientation)).tolist()
    return found


def simplest(tensor: Tensor) -> Any:
    """The tensor; its three principal moments if it is diagonal, one number if they are equal."""
    diagonal = (tensor[0][0], tensor[1][1], tensor[2][2])
    if not all(negligible(tensor[i][j], diagonal) for i, j in ((0, 1), (0, 2), (1, 2))):
        return tuple(tuple(row) for row in tensor)
    plain = all(isinstance(moment, float) for moment in diagonal)
    return diagonal[0] if plain and diagonal[0] == diagonal[1] == diagonal[2] else diagonal


def negligible(product: Scalar, diagonal: Sequence[Scalar]) -> bool:
    """Whether a product of inertia is zero up to rounding."""
    if all(isinstance(entry, int | float) for entry in (product, *diagonal)):
        return bool(abs(product) <= NOISE * sum(diagonal))
    return is_zero(product)


def inertia_fault(value: float | Sequence[float] | Sequence[Sequence[float]]) -> str:
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
