"""Motors: what turns a command into torque along a coordinate, or into force where the coordinate is a displacement."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from symphys.model.scalar import Scalar, is_zero


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

    gain: Scalar = 1.0
    offset: Scalar = 0.0
    kp: Scalar = 0.0
    kv: Scalar = 0.0
    gear: Scalar = 1.0
    command_range: tuple[float, float] | None = None
    force_range: tuple[float, float] | None = None

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


def given_torque(motor: Motor | None) -> bool:
    """Whether a motor gives what its command says, whatever its joint does."""
    return isinstance(motor, TorqueMotor) or (isinstance(motor, AffineMotor) and motor.passive)
