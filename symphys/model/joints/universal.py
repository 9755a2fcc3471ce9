"""A universal joint (Cardan): the first side turns about its own x, and that about the y of the second side."""

from __future__ import annotations

import casadi as ca

from symphys.maths.smoothing import angle_of
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.types import Expr


def swing(placed: PlacedFrames) -> Expr:
    """In [-pi, pi] [rad]: of the first side's x about the second side's y; whole turns are not seen."""
    a, b = placed.a, placed.b
    return angle_of(-ca.dot(a[:, 0], b[:, 2]), ca.dot(a[:, 0], b[:, 0]))


def twist(placed: PlacedFrames) -> Expr:
    """In [-pi, pi] [rad]: of the first side about its own x, against the second side's y, without whole turns."""
    a, b = placed.a, placed.b
    return angle_of(-ca.dot(a[:, 2], b[:, 1]), ca.dot(a[:, 1], b[:, 1]))


UNIVERSAL = Kind(
    "universal",
    turns=((0, 1),),
    coordinates=(
        Coordinate("angle1", swing, axis=1),
        Coordinate("angle2", twist, axis=0, fixed_in_first=True),
    ),
)
