"""A slider: the first side moves along the x axis of the frames and does not turn."""

from __future__ import annotations

import casadi as ca

from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.types import Expr


def position(placed: PlacedFrames) -> Expr:
    """[m] along x."""
    return ca.dot(placed.apart, placed.b[:, 0])


ALONG = Coordinate("position", position, turns=False, lead=1.0)
SLIDER = Kind("slider", (1, 2), ((0, 1), (1, 2), (2, 0)), (ALONG,))
