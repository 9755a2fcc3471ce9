"""A slider: the first side moves along the x axis of the frames and does not turn."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.specs import SingleAxisJoint
from symphys.records import dataclass
from symphys.types import Expr


def position(placed: PlacedFrames) -> Expr:
    """[m] along x."""
    return ca.dot(placed.apart, placed.b[:, 0])


ALONG = Coordinate("position", position, turns=False, lead=1.0)
SLIDER = Kind("slider", (1, 2), ((0, 1), (1, 2), (2, 0)), (ALONG,))


@dataclass(frozen=True)
class Slider(SingleAxisJoint):
    """The second moves along an axis and does not turn.

    Attributes:
        axis: (3,) of any length but 0, as the bodies lie, world coordinates.

    Example:
        >>> from symphys import Problem, simulate
        >>> from symphys.model import Body, Slider, TorqueMotor, make_world
        >>> cart = Body.box("cart", size=(0.2, 0.2, 0.1), mass=1)
        >>> rail = Slider("rail", ("world", "cart"), axis=(1, 0, 0), motor=TorqueMotor(torque=10))
        >>> push = {"sets": "rail.command", "guess": [2.0]}
        >>> pushed = Problem.from_world(make_world([cart], joints=[rail]), duration=1.0, variables={"push": push})
        >>> round(float(simulate(pushed)["rail.position"][-1]), 6)
        1.0
    """

    summary: ClassVar[str] = "moves along an axis"
    example: ClassVar[str] = "{ axis = [1, 0, 0] }"
    anywhere: ClassVar[bool] = True

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return SLIDER
