"""A universal joint (Cardan): the first side turns about its own x, and that about the y of the second side."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import casadi as ca

from symphys.maths.smoothing import angle_of
from symphys.model.joints.frames import two_axes
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.specs import AXIS, MovingJoint, Vector
from symphys.model.numbers import table_key
from symphys.records import dataclass
from symphys.types import Array, Expr


def swing(placed: PlacedFrames) -> Expr:
    """Return the angle of the first side's x about the second side's y, in [-pi, pi] [rad], without whole turns."""
    a, b = placed.a, placed.b
    return angle_of(-ca.dot(a[:, 0], b[:, 2]), ca.dot(a[:, 0], b[:, 0]))


def twist(placed: PlacedFrames) -> Expr:
    """Return the angle of the first side about its own x, in [-pi, pi] [rad], without whole turns."""
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


@dataclass(frozen=True)
class UniversalJoint(MovingJoint):
    """The second turns about two axes (Cardan).

    Attributes:
        axes: two of (3,), perpendicular to each other, as the bodies lie, world coordinates; the first stays with the
            first body, the second with the second.
    """

    summary: ClassVar[str] = "turns about two axes"
    example: ClassVar[str] = "{ axes = [[0, 1, 0], [1, 0, 0]] }"

    axes: tuple[Vector, Vector] = field(
        kw_only=True,
        metadata=table_key(
            "directions",
            f"two perpendicular axes, of which the first moves with the first body; each {AXIS}",
        ),
    )

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return UNIVERSAL

    @property
    def frame_axes(self) -> Array:
        """Return the axes (3, 3) of both frames as columns, as the bodies lie, world frame."""
        return two_axes(self.axes)

    @classmethod
    def table(cls, kind: Kind, axes: Array) -> dict[str, Any]:
        """Return the keys of its table in problem files."""
        return {"axes": [axes[:, 1].tolist(), axes[:, 0].tolist()]}
