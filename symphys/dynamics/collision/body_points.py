"""Shapes on bodies: their ends and corners in the body's frame, their axes over the step."""

from __future__ import annotations

from itertools import product
from typing import Any

import casadi as ca

from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.maths import rotation
from symphys.model.scalar import is_zero
from symphys.model.shapes import UPRIGHT, Box, Capsule, SolidShape
from symphys.types import Expr

Offset = tuple[Expr, Expr, Expr]
SIGNS = (-1.0, 1.0)


def ends(capsule: Capsule) -> list[Offset]:
    """Return the centres of a capsule's round ends, body frame."""
    return [placed(capsule, (0.0, 0.0, sign * capsule.half_length)) for sign in SIGNS]


def corners(box: Box) -> list[Offset]:
    """Return the eight corners of a box, body frame; the centres of their balls where its edges are round."""
    x, y, z = box.half_sizes if is_zero(box.edge) else [half - box.edge for half in box.half_sizes]
    return [placed(box, (a * x, b * y, c * z)) for a, b, c in product(SIGNS, repeat=3)]


def placed(shape: SolidShape, point: Offset) -> Offset:
    """Return a point given in the shape's own frame, body frame."""
    turned = turned_by(shape.orientation, point)
    return (turned[0] + shape.centre[0], turned[1] + shape.centre[1], turned[2] + shape.centre[2])


def turned_by(orientation: tuple[Any, ...], vector: Offset) -> Offset:
    """Return a vector after a rotation; unchanged, and without arithmetic, where that is none."""
    if all(is_zero(c - unit) for c, unit in zip(orientation, UPRIGHT, strict=True)):
        return vector
    x, y, z = ca.vertsplit(rotation.rotate(ca.vertcat(*map(ca.SX, orientation)), ca.vertcat(*map(ca.SX, vector))))
    return (x, y, z)


def axes(body_path: PredictedPath, shape: SolidShape) -> tuple[Parabola, Parabola, Parabola]:
    """Return the paths of a shape's own axes, world frame."""
    units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    x, y, z = (body_path.arm(turned_by(shape.orientation, unit)) for unit in units)
    return x, y, z
