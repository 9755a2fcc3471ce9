"""A slider: the first side moves along the x axis of the frames and does not turn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import casadi as ca

from symphys.model.joints.frames import single_axis
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.specs import DIRECTION, MovingJoint, Vector
from symphys.types import Array, Expr


def position(placed: PlacedFrames) -> Expr:
    """[m] along x."""
    return ca.dot(placed.apart, placed.b[:, 0])


ALONG = Coordinate("position", position, turns=False, lead=1.0)
SLIDER = Kind("slider", (1, 2), ((0, 1), (1, 2), (2, 0)), (ALONG,))


@dataclass(frozen=True)
class Slider(MovingJoint):
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

    axis: Vector = field(kw_only=True, metadata=DIRECTION)

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return SLIDER

    @property
    def frame_axes(self) -> Array:
        """Return the axes (3, 3) of both frames as columns, as the bodies lie, world frame."""
        return single_axis(self.axis)

    @classmethod
    def table(cls, kind: Kind, axes: Array) -> dict[str, Any]:
        """Return the keys of its table in problem files."""
        return {"axis": axes[:, 0].tolist()}
