"""Joints as they are described: what they hold, their place and axes as the bodies lie, and what acts along them.

``make_world`` makes a ``Joint`` with frames of each. The words are those of [[joint]] tables in problem files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import ClassVar

import numpy as np

from symphys.model.joints.ball import BALL
from symphys.model.joints.fixed import FIXED
from symphys.model.joints.frames import single_axis, two_axes
from symphys.model.joints.hinge import HINGE
from symphys.model.joints.joint import Limits, Spring
from symphys.model.joints.kind import Kind
from symphys.model.joints.motor import Motor
from symphys.model.joints.slider import SLIDER
from symphys.model.joints.universal import UNIVERSAL
from symphys.model.scalar import Scalar
from symphys.types import Array

Vector = Sequence[float] | Array
"""three of them"""


@dataclass(frozen=True)
class JointSpec:
    """What all joints have.

    Attributes:
        name: how states, commands and formulas refer to it.
        between: two bodies, or "world" and a body; coordinates are those of the second against the first.
        point: (3,) where the joint is as the bodies lie [m], world coordinates.
        anchors: instead of point: (3,) on the first and on the second, each in its body's frame [m], that of the world
            in world coordinates; as the bodies lie the two must meet.
        frequency: [Hz] of a joint that gives way; 0: rigid.
        damping: damping ratio of a joint that gives way.
        collide: whether the two bodies may touch each other.
    """

    kind: ClassVar[Kind]
    anywhere: ClassVar[bool] = False
    """Whether it needs no point."""

    name: str
    between: tuple[str, str]
    point: Vector | None = field(default=None, kw_only=True)
    anchors: tuple[Vector, Vector] | None = field(default=None, kw_only=True)
    frequency: Scalar = field(default=0.0, kw_only=True)
    damping: Scalar = field(default=1.0, kw_only=True)
    collide: bool = field(default=False, kw_only=True)

    @property
    def frame_axes(self) -> Array:
        """(3, 3): the axes of both frames as columns, as the bodies lie, world frame; ValueError for axes of none."""
        return np.eye(3)


@dataclass(frozen=True)
class BallJoint(JointSpec):
    """Two points stay together; all turns are free."""

    kind: ClassVar[Kind] = BALL


@dataclass(frozen=True)
class FixedJoint(JointSpec):
    """Nothing is left free."""

    kind: ClassVar[Kind] = FIXED
    anywhere: ClassVar[bool] = True


@dataclass(frozen=True)
class MovingJoint(JointSpec):
    """A joint with coordinates, which are 0 as the bodies lie. Angles count whole turns.

    Attributes:
        motor: drives every coordinate.
        limits: (lower, upper) of every coordinate [rad] or [m]; None, -inf and inf are none.
        spring: along every coordinate.
        armature: inertia of what turns with each coordinate, seen through its gear [kg m^2] or [kg].
        friction: dry friction along every coordinate [N m] or [N].
        start: the coordinate at the start [rad] or [m], or a sequence of all; None: 0. ``make_world`` carries the
            second body, and all that hangs on it, there; if the world holds these, the first, the other way.
    """

    motor: Motor | None = field(default=None, kw_only=True)
    limits: tuple[float | None, float | None] | None = field(default=None, kw_only=True)
    spring: Spring | None = field(default=None, kw_only=True)
    armature: Scalar = field(default=0.0, kw_only=True)
    friction: Scalar = field(default=0.0, kw_only=True)
    start: float | Sequence[float] | None = field(default=None, kw_only=True)

    def check_acting(self) -> None:
        """ValueError for a motor or a spring that is none."""
        if not (self.motor is None or isinstance(self.motor, Motor)):
            kinds = "a Servo, a VelocityMotor, a TorqueMotor or an AffineMotor"
            raise ValueError(f"motor must be {kinds}, not {self.motor!r}")
        if not (self.spring is None or isinstance(self.spring, Spring)):
            raise ValueError(f"spring must be a Spring, not {self.spring!r}")
        for key, value in (("armature", self.armature), ("friction", self.friction)):
            if isinstance(value, int | float) and not 0 <= value < inf:
                raise ValueError(f"{key} must not be negative, but it is {value}")

    @property
    def bounds(self) -> Limits:
        """The limits; ValueError for bounds that cannot be."""
        if self.limits is None:
            return Limits()
        if np.shape(np.array(self.limits, object)) != (2,):
            raise ValueError(f"limits must be (lower, upper), not {self.limits}")
        low, high = self.limits
        lower, upper = -inf if low is None else low, inf if high is None else high
        if not lower < upper:
            raise ValueError(f"limits: the lower, {lower:g}, must be below the upper, {upper:g}")
        return Limits(lower if isfinite(lower) else None, upper if isfinite(upper) else None)

    @property
    def start_coordinates(self) -> tuple[float, ...]:
        """One for each coordinate, empty if all are 0; ValueError for a wrong number of them or one out of bounds."""
        bounds = self.bounds
        if self.start is None:
            return ()
        count = len(self.kind.coordinates)
        values = tuple(np.atleast_1d(np.asarray(self.start, float)).tolist())
        if not np.isfinite(values).all():
            raise ValueError(f"start must be finite, not {self.start}")
        if len(values) != count:
            which = f"a {self.kind.name} has {count} coordinate{'s' * (count > 1)}"
            raise ValueError(f"start: {which}, but {len(values)} are given")
        lower, upper = bounds.lower, bounds.upper
        for value in values:
            if (lower is not None and value < lower) or (upper is not None and value > upper):
                raise ValueError(f"start: {value:g} is beyond the limits of this joint")
        return values if any(values) else ()


@dataclass(frozen=True)
class Hinge(MovingJoint):
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

    kind: ClassVar[Kind] = HINGE

    axis: Vector = field(kw_only=True)

    @property
    def frame_axes(self) -> Array:
        """See ``JointSpec``."""
        return single_axis(self.axis)


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

    kind: ClassVar[Kind] = SLIDER
    anywhere: ClassVar[bool] = True

    axis: Vector = field(kw_only=True)

    @property
    def frame_axes(self) -> Array:
        """See ``JointSpec``."""
        return single_axis(self.axis)


@dataclass(frozen=True)
class UniversalJoint(MovingJoint):
    """The second turns about two axes (Cardan).

    Attributes:
        axes: two of (3,), perpendicular to each other, as the bodies lie, world coordinates; the first stays with the
            first body, the second with the second.
    """

    kind: ClassVar[Kind] = UNIVERSAL

    axes: tuple[Vector, Vector] = field(kw_only=True)

    @property
    def frame_axes(self) -> Array:
        """See ``JointSpec``."""
        return two_axes(self.axes)
