"""Motors: what turns a command into torque along a coordinate, or into force where the coordinate is a displacement."""

from __future__ import annotations

from dataclasses import dataclass

from symphys.model.shapes import Scalar


@dataclass(frozen=True)
class Servo:
    """Follows an angle (Degrave et al. 2019, section 3): target velocity = clip(gain (command - angle), +-velocity).

    Attributes:
        gain: [1/s].
        torque: largest [N m], or force [N].
        velocity: largest [rad/s], or [m/s].
        range: largest command [rad], or [m], either way; None: any.
    """

    gain: Scalar
    torque: Scalar
    velocity: Scalar
    range: Scalar | None = None


@dataclass(frozen=True)
class VelocityMotor:
    """Follows a velocity, the command, with at most ``torque``; the command is held in +-velocity."""

    torque: Scalar
    velocity: Scalar


@dataclass(frozen=True)
class TorqueMotor:
    """Gives the command as a torque, held in +-torque."""

    torque: Scalar


Motor = Servo | VelocityMotor | TorqueMotor
