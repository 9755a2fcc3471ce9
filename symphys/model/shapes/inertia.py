"""Inertia of compounds of solid shapes of equal density."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import numpy as np

from symphys.maths import rotation
from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes.shape import UPRIGHT, SolidShape
from symphys.types import Array

Tensor = list[list[Scalar]]
"""(3, 3)"""
MOMENT_ROUNDING = 1e-14
"""Products of inertia below this share of the trace are rounding."""
OFF_CENTRE = 1e-6
"""How far a compound's centre of mass may be from the body's origin, relative to the size of the compound."""


def shares(shapes: Sequence[SolidShape]) -> list[Scalar]:
    """The share of each shape in the mass, for equal density."""
    if len(shapes) == 1:
        return [1.0]
    volumes = [shape.volume for shape in shapes]
    whole = sum(volumes)
    if whole == 0:
        return [np.nan] * len(shapes)
    return [part / whole for part in volumes]


def centre_of_mass(shapes: Sequence[SolidShape]) -> Array:
    """(3,): of solid shapes of equal density [m], body frame; parts that overlap count twice."""
    return np.asarray(np.array(shares(shapes)) @ np.array([middle(shape) for shape in shapes], float))


def off_centre(shapes: Sequence[SolidShape]) -> bool:
    """Whether the centre of mass of solid shapes of equal density is not the origin, up to rounding."""
    size = max(hypot(*shape.centre) + shape.extent for shape in shapes)
    return not float(np.linalg.norm(centre_of_mass(shapes))) <= OFF_CENTRE * size


def centring(shapes: Sequence[SolidShape], called: str) -> str:
    """The message for shapes that are ``off_centre``; ``called``: what they are."""
    centre = centre_of_mass(shapes)
    off, listed = float(np.linalg.norm(centre)), ", ".join(f"{c:.6g}" for c in centre)
    placed = "point" if called == "convex" else "centre"
    called = "points" if called == "convex" else called
    return (
        f"the centre of mass of these {called} is {off:.4g} m from the body's origin, at [{listed}]; "
        f"subtract that from every {placed}"
    )


def specific(shapes: Sequence[SolidShape]) -> Tensor:
    """Inertia per mass [m^2] of solid shapes of equal density about the body's origin; sizes may be symbols."""
    total: Tensor = [[0.0] * 3 for _ in range(3)]
    for share, shape in zip(shares(shapes), shapes, strict=True):
        own, c, turned = tensor_of(shape), middle(shape), axes(shape)
        arm = sum(x * x for x in c)
        for i in range(3):
            for j in range(3):
                spun = sum(turned[i][k] * turned[j][m] * x for (k, m), x in own.items() if turned[i][k] * turned[j][m])
                total[i][j] = total[i][j] + share * (spun + (arm if i == j else 0.0) - c[i] * c[j])
    return total


def tensor_of(shape: SolidShape) -> dict[tuple[int, int], Scalar]:
    """The entries of a shape's own inertia by mass that are not zero, along its own axes, by row and column [m^2]."""
    own = {(k, k): moment for k, moment in enumerate(shape.moments)}
    for (i, j), product in zip(((1, 2), (0, 2), (0, 1)), shape.products, strict=True):
        if not is_zero(product):
            own[i, j] = own[j, i] = product
    return own


def middle(shape: SolidShape) -> tuple[Scalar, ...]:
    """(3,): a shape's centre of mass [m], body frame."""
    if all(is_zero(c) for c in shape.centroid):
        return shape.centre
    turned = axes(shape)
    return tuple(
        shape.centre[i] + sum(turned[i][k] * shape.centroid[k] for k in range(3) if turned[i][k]) for i in range(3)
    )


def axes(shape: SolidShape) -> list[list[float]]:
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


def inertia_of(tensor: Tensor, mass: Scalar) -> Any:
    """The inertia [kg m^2] as ``Body`` takes it: a number, three moments or a (3, 3) tensor; ``tensor``: per mass."""
    simple = simplest(tensor)
    if not isinstance(simple, tuple):
        return simple * mass
    return tuple(tuple(x * mass for x in row) if isinstance(row, tuple) else row * mass for row in simple)


def negligible(product: Scalar, diagonal: Sequence[Scalar]) -> bool:
    """Whether a product of inertia is zero up to rounding."""
    if all(isinstance(entry, int | float) for entry in (product, *diagonal)):
        return bool(abs(product) <= MOMENT_ROUNDING * sum(diagonal))
    return is_zero(product)
