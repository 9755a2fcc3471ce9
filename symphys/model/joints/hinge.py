"""A hinge: the first side turns about the x axis of the frames."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from symphys.maths.smoothing import angle_of
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.specs import SingleAxisJoint
from symphys.records import dataclass
from symphys.types import Expr


def angle(placed: PlacedFrames) -> Expr:
    """Return the angle of the first side's y and z against the second's about x, in [-pi, pi] [rad]."""
    a, b = placed.a, placed.b
    cos = ca.dot(a[:, 1], b[:, 1]) + ca.dot(a[:, 2], b[:, 2])
    sin = ca.dot(a[:, 1], b[:, 2]) - ca.dot(a[:, 2], b[:, 1])
    return angle_of(sin, cos)


HINGE = Kind("hinge", turns=((0, 1), (0, 2)), coordinates=(Coordinate("angle", angle),))


@dataclass(frozen=True)
class Hinge(SingleAxisJoint):
    """The second turns about an axis.

    Attributes:
        axis: (3,) of any length but 0, as the bodies lie, world coordinates.

    Example:
        >>> from symphys import Problem, simulate
        >>> from symphys.model import Body, Hinge, Servo, Spring, make_world
        >>> rod = {"radius": 0.02, "length": 0.4, "mass": 0.5}
        >>> bodies = [Body.capsule(name, **rod, position=(0, 0, z)) for name, z in (("upper", 0.8), ("lower", 0.4))]
        >>> joints = [
        ...     Hinge("shoulder", ("world", "upper"), axis=(0, 1, 0), point=(0, 0, 1), start=0.4),
        ...     Hinge("elbow", ("upper", "lower"), axis=(0, 1, 0), point=(0, 0, 0.6), limits=(-2, 2),
        ...           motor=Servo(gain=20, torque=3, velocity=8), spring=Spring(stiffness=0.1, damping=0.01)),
        ... ]
        >>> problem = Problem.from_world(make_world(bodies, joints=joints), duration=0.5)
        >>> round(float(simulate(problem)["shoulder.angle"][0]), 12)
        0.4
    """

    summary: ClassVar[str] = "turns about an axis"
    example: ClassVar[str] = "{ axis = [0, 1, 0] }"

    @property
    def kind(self) -> Kind:
        """Return the kind of joint."""
        return HINGE
