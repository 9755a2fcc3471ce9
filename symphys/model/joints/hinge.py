"""A hinge: the first side turns about the x axis of the frames."""

from __future__ import annotations

import casadi as ca

from symphys.maths.smoothing import angle_of
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.types import Expr


def angle(placed: PlacedFrames) -> Expr:
    """In [-pi, pi] [rad]: of the first side's y and z against the second's, about x; whole turns are not seen."""
    a, b = placed.a, placed.b
    cos = ca.dot(a[:, 1], b[:, 1]) + ca.dot(a[:, 2], b[:, 2])
    sin = ca.dot(a[:, 1], b[:, 2]) - ca.dot(a[:, 2], b[:, 1])
    return angle_of(sin, cos)


HINGE = Kind("hinge", turns=((0, 1), (0, 2)), coordinates=(Coordinate("angle", angle),))
