"""A joint of a world: two bodies, or a body and the world, and what acts between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

from symphys.maths.angles import nearest
from symphys.model.joints.kind import Kind, PlacedFrames
from symphys.model.joints.motor import AffineMotor, Motor, given_torque
from symphys.model.numbers import Number, declare, numbers_of
from symphys.model.scalar import Scalar, is_zero
from symphys.records import dataclass

PARTS = ("motor", "lower", "upper", "spring", "friction")
UNWRAPPED = "unwrapped"
"""Angles to within half a turn [rad]; see ``Joint.unwrapped``."""
DRIVE = "drive"
"""What a command alone gives, where the state's ``motor`` does not tell it; see ``Joint.drive``."""
Vector = Sequence[Any]
"""three of them"""


@dataclass(frozen=True)
class JointFrame:
    """A point with axes on one side of a joint.

    Attributes:
        point: (3,) [m] from the centre of mass, body frame; of the world: world frame.
        orientation: (4,) unit quaternion w x y z from the frame's axes to the body's, or the world's.
    """

    point: Vector = (0.0, 0.0, 0.0)
    orientation: Vector = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Limits:
    """Bounds of a coordinate [rad] or [m]; None where there is none."""

    lower: Scalar | None = None
    upper: Scalar | None = None


@dataclass(frozen=True)
class Spring:
    """Along a coordinate: torque = -stiffness (angle - rest) - damping rate; SI units, forces where it slides."""

    stiffness: Scalar = field(
        default=0.0,
        metadata=declare("{torque}/{angle}", "torque per angle, or force per length", least=0.0, phase="impulse"),
    )
    damping: Scalar = field(
        default=0.0,
        metadata=declare("{torque} s/{angle}", "torque per rate, or force per velocity", least=0.0, phase="impulse"),
    )
    rest: Scalar = field(
        default=0.0,
        metadata=declare("{angle}", "rest position", phase="impulse"),
    )


def joint_numbers(kind: Kind, motor: Motor | None, spring: Spring | None) -> dict[str, Number]:
    """Return what is known of the numbers of a joint by key: its own, those of its kind, its motor and its spring."""
    declared = [numbers_of(each) for each in (kind, Joint, motor, spring) if each is not None]
    return {key: each.along(kind.turning) for found in declared for key, each in found.items()}


@dataclass(frozen=True)
class Joint:
    """Holds the first body to the second, or to the world.

    Attributes:
        name: how states, commands and formulas refer to it.
        kind: what it locks.
        first, second: indices of bodies; second None: the world. Coordinates are those of the first against the second.
        frames: of the first and of the second.
        motor, limits, spring: along every coordinate.
        armature: inertia of what turns with each coordinate, seen through its gear [kg m^2] or [kg].
        friction: dry friction along every coordinate [N m] or [N].
        start: coordinates where a motion begins [rad] or [m]; empty: all 0. Of an initial pose, which says nothing of
            whole turns, angles are those nearest to these.
        frequency, damping: [Hz] and damping ratio of a joint that is soft (Catto, GDC 2011); 0 is a rigid one.
    """

    name: str
    kind: Kind
    first: int
    second: int | None
    frames: tuple[JointFrame, JointFrame]
    motor: Motor | None = None
    limits: Limits = Limits()
    spring: Spring | None = None
    frequency: Scalar = 0.0
    damping: Scalar = 1.0
    armature: Scalar = field(
        default=0.0,
        metadata=declare(
            "{inertia}",
            "inertia that turns with each coordinate, as a rotor does, seen through its gear",
            least=0.0,
            structural=True,
        ),
    )
    friction: Scalar = field(
        default=0.0,
        metadata=declare(
            "{torque}", "dry friction along every coordinate", least=0.0, structural=True, phase="impulse"
        ),
    )
    start: tuple[float, ...] = ()

    def value(self, k: int, placed: PlacedFrames, near: Any) -> Any:
        """Its coordinate k [rad] or [m], of frames in the world.

        Frames tell an angle but for whole turns: it is the one nearest to ``near`` (k,), see ``unwrapped``.
        """
        coordinate = self.kind.coordinates[k]
        value = coordinate.value(placed)
        return nearest(value, near[k]) if coordinate.turns else value

    @property
    def unwrapped(self) -> str | None:
        """The state's entry for its angles to within half a turn, which poses make exact; None if nothing turns."""
        return f"{self.name}.{UNWRAPPED}" if self.kind.winds else None

    @property
    def bodies(self) -> tuple[int, ...]:
        """The indices of those that can move."""
        return (self.first,) if self.second is None else (self.first, self.second)

    @property
    def soft(self) -> bool:
        """Whether it is soft; a matter of structure, so never a symbol's value."""
        return not (isinstance(self.frequency, int | float) and self.frequency == 0)

    @property
    def driven(self) -> bool:
        """Whether it has a command."""
        return self.motor is not None and bool(self.kind.coordinates)

    @property
    def acting(self) -> tuple[str, ...]:
        """Return which of motor, lower, upper, spring and friction act along its coordinates."""
        if not self.kind.coordinates:
            return ()
        dry = None if is_zero(self.friction) else self.friction
        present = (self.motor, self.limits.lower, self.limits.upper, self.spring, dry)
        return tuple(part for part, what in zip(PARTS, present, strict=True) if what is not None)

    @property
    def drive(self) -> str | None:
        """Return the field of the state for what a step's command gives by itself until the next step begins.

        None for a motor that aims at a velocity, whose commands act through what it aims at.
        """
        if not self.driven:
            return None
        if given_torque(self.motor):
            return "motor"
        return DRIVE if isinstance(self.motor, AffineMotor) else None

    @property
    def locked(self) -> int:
        """Return the number of locked rows."""
        return self.kind.locked
