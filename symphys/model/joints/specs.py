"""Joints as they are described: what they hold, their place and axes as the bodies lie, and what acts along them.

``make_world`` makes a ``Joint`` with frames of each. The words are those of [[joint]] tables in problem files, which
have a table for each kind, with a key for each field whose metadata say what ``value`` it takes, ``direction``,
``directions`` (two) or ``nonzero``, and what the schema says ``about`` it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import Field, field, fields
from math import inf, isfinite
from typing import Any, ClassVar

import numpy as np

from symphys.model.joints.frames import single_axis
from symphys.model.joints.joint import Limits, Spring
from symphys.model.joints.kind import Kind
from symphys.model.joints.motor import Motor
from symphys.model.numbers import table_key
from symphys.model.scalar import Scalar
from symphys.records import dataclass
from symphys.types import Array

Vector = Sequence[float] | Array
"""three of them"""
AXIS = "[x, y, z], world coordinates at the start, any length but 0"
"""Description of an axis in the schema of problem files."""
DIRECTION = table_key("direction", f"about or along which the second body moves: {AXIS}")
"""Metadata of the field of a kind with one axis."""


@dataclass(frozen=True)
class JointSpec(ABC):
    """The data that all joints share.

    Attributes:
        name: how states, commands and formulas refer to it.
        between: two bodies, or "world" and a body; coordinates are those of the second against the first.
        point: (3,) where the joint is as the bodies lie [m], world coordinates.
        anchors: instead of point: (3,) on the first and on the second, each in its body's frame [m], that of the world
            in world coordinates; as the bodies lie the two must meet.
        frequency: natural frequency of a compliant joint [Hz]; 0: rigid.
        damping: damping ratio of a compliant joint.
        collide: whether the two bodies may touch each other.
    """

    summary: ClassVar[str]
    """Description of its table in the schema of problem files."""
    example: ClassVar[str] = "{}"
    """An example of its table in problem files."""
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
    @abstractmethod
    def kind(self) -> Kind:
        """Return the kind of joint."""

    @property
    def frame_axes(self) -> Array:
        """(3, 3): the axes of both frames as columns, as the bodies lie, world frame; ValueError for axes of none."""
        return np.eye(3)

    @classmethod
    def own_fields(cls) -> list[Field[Any]]:
        """Return the fields that are keys of its table in problem files."""
        return [each for each in fields(cls) if "value" in each.metadata]

    @classmethod
    def table(cls, kind: Kind, axes: Array) -> dict[str, Any]:
        """Return the keys of its table from a kind of numbers and the axes (3, 3) of its frames at coordinates 0."""
        return {}


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
        """Return one for each coordinate, empty if all are 0; ValueError for a wrong number or one out of bounds."""
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
class SingleAxisJoint(MovingJoint):
    """A joint with one coordinate, about or along an axis.

    Attributes:
        axis: (3,) of any length but 0, as the bodies lie, world coordinates.
    """

    axis: Vector = field(kw_only=True, metadata=DIRECTION)

    @property
    def frame_axes(self) -> Array:
        """Return the axes (3, 3) of both frames as columns, as the bodies lie, world frame."""
        return single_axis(self.axis)

    @classmethod
    def table(cls, kind: Kind, axes: Array) -> dict[str, Any]:
        """Return the keys of its table in problem files."""
        return {"axis": axes[:, 0].tolist()}
