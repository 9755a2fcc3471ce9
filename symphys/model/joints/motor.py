"""Motors: what turns a command into torque along a coordinate, or into force where the coordinate is a displacement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from math import inf
from types import MappingProxyType
from typing import ClassVar

from symphys.model.numbers import Number, declare, table_key
from symphys.model.scalar import Scalar, is_zero
from symphys.records import dataclass

LARGEST = declare("{torque}", "largest torque or force", "positive", least=0.0, phase="impulse")
"""Metadata of the largest torque of a motor that aims at a velocity."""
FASTEST = declare("{angle}/s", "largest target velocity", "positive", least=0.0, phase="start")
"""Metadata of the largest velocity at which a motor aims."""


@dataclass(frozen=True)
class Servo:
    """Follows an angle (Degrave et al. 2019, section 3): target velocity = clip(gain (command - angle), +-velocity).

    Attributes:
        gain: [1/s].
        torque: largest [N m], or force [N].
        velocity: largest [rad/s], or [m/s].
        range: largest command [rad], or [m], either way; None: any.
    """

    summary: ClassVar[str] = (
        "A motor whose command is an angle or a position: the target velocity is gain (command - angle). Angles "
        "count whole turns."
    )
    example: ClassVar[str] = "{ gain = 20, torque = 30, velocity = 8 }"
    command: ClassVar[Number] = Number("{angle}", scale=1.0)

    gain: Scalar = field(
        metadata=declare("1/s", "target velocity per error of angle or position", "positive", least=0.0, phase="start")
    )
    torque: Scalar = field(metadata=LARGEST)
    velocity: Scalar = field(metadata=FASTEST)
    range: Scalar | None = field(
        default=None,
        metadata=declare(
            "{angle}", "largest command, in both directions; default: any", "positive", least=0.0, phase="start"
        ),
    )


@dataclass(frozen=True)
class VelocityMotor:
    """Follows a velocity, the command, with at most ``torque``; the command is held in +-velocity."""

    summary: ClassVar[str] = "A motor whose command is a velocity."
    example: ClassVar[str] = "{ torque = 30, velocity = 8 }"
    command: ClassVar[Number] = Number("{angle}/s", scale=1.0)

    torque: Scalar = field(metadata=LARGEST)
    velocity: Scalar = field(metadata=FASTEST)


@dataclass(frozen=True)
class TorqueMotor:
    """Gives the command as a torque, held in +-torque."""

    summary: ClassVar[str] = "A motor whose command is a torque [N m], or a force [N] where the joint slides."
    example: ClassVar[str] = "{ torque = 30 }"
    command: ClassVar[Number] = Number("{torque}", scale=1.0)

    torque: Scalar = field(
        metadata=declare("{torque}", "largest torque or force", "positive", least=0.0, phase="start")
    )


@dataclass(frozen=True)
class AffineMotor:
    """A torque that is affine in command, coordinate and rate, through a gear (MuJoCo's general actuator).

    With the command u, the coordinate q and its rate v it gives
    gear clip(gain clip(u, command_range) + offset - kp gear q - kv gear v, force_range).

    Attributes:
        gain: force before the gear by command.
        offset: [N m] or [N], before the gear.
        kp: by the position behind the gear [N m/rad] or [N/m].
        kv: by the velocity behind the gear [N m s/rad] or [N s/m].
        gear: ratio; a negative one turns the direction around.
        command_range: least and largest command; None: any.
        force_range: least and largest force before the gear; None: any.
    """

    summary: ClassVar[str] = (
        "The torque gear clip(gain clip(command, command_range) + offset - kp gear q - kv gear v, force_range), with "
        "the joint's coordinate q and rate v, as MuJoCo's motor, position, velocity and general actuators."
    )
    example: ClassVar[str] = "{ gear = 150, command_range = [-1, 1] }"
    command: ClassVar[Number] = Number(None, scale=1.0)

    gain: Scalar = field(default=1.0, metadata=declare(None, "force per command, before the gear", phase="start"))
    offset: Scalar = field(
        default=0.0, metadata=declare("{torque}", "force at command 0, before the gear", phase="start")
    )
    kp: Scalar = field(
        default=0.0, metadata=declare("{torque}/{angle}", "position gain, behind the gear", phase="impulse")
    )
    kv: Scalar = field(
        default=0.0, metadata=declare("{torque} s/{angle}", "velocity gain, behind the gear", phase="impulse")
    )
    gear: Scalar = field(default=1.0, metadata=declare("", "gear ratio; a negative one reverses the direction"))
    command_range: tuple[float, float] | None = field(
        default=None, metadata=table_key("ends", "least and largest command; default: any")
    )
    force_range: tuple[float, float] | None = field(
        default=None, metadata=table_key("ends", "least and largest force before the gear [N m] or [N]; default: any")
    )

    @property
    def passive(self) -> bool:
        """Whether it depends on the command alone; a matter of structure."""
        return is_zero(self.kp) and is_zero(self.kv)

    @property
    def torque(self) -> float:
        """The largest that its ranges let it give [N m] or [N]; infinite if none does. Numbers only, no symbols."""
        bounds = [abs(float(self.gear)) * max(map(abs, self.force_range))] if self.force_range is not None else []
        if self.command_range is not None and self.passive:
            ends = (abs(float(self.gain) * end + float(self.offset)) for end in self.command_range)
            bounds.append(abs(float(self.gear)) * max(ends))
        return min(bounds, default=inf)


Motor = Servo | VelocityMotor | TorqueMotor | AffineMotor

MOTORS: Mapping[str, type[Motor]] = MappingProxyType(
    {"servo": Servo, "velocity": VelocityMotor, "torque": TorqueMotor, "affine": AffineMotor}
)
"""By their keys in the ``motor`` of [[joint]] tables; each class says what its keys are."""


def motor_kind(motor: Motor) -> str:
    """Return the key of a motor's kind in problem files."""
    return next(word for word, kind in MOTORS.items() if type(motor) is kind)


def given_torque(motor: Motor | None) -> bool:
    """Whether a motor gives what its command says, whatever its joint does."""
    return isinstance(motor, TorqueMotor) or (isinstance(motor, AffineMotor) and motor.passive)
