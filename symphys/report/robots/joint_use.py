"""What the joints of a motion did, in numbers: how far they went, what their motors gave, how well they held."""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.results.scene import Scene
from symphys.results.scene_joints import SceneJoint
from symphys.trajectory import Trajectory
from symphys.types import Array, Bools

SATURATED_SHARE = 1 - 1e-3
"""A motor is saturated from this share of its largest torque on."""
LIMIT_TOLERANCE = 1e-3
"""[rad] or [m]: how near to a limit a coordinate counts as there."""


@dataclass(frozen=True)
class Channel:
    """A coordinate of a joint over N steps.

    Attributes:
        name: the joint's, with a number where it has several coordinates.
        turns: whether it is an angle.
        value: (N + 1,) [rad] or [m].
        torque: (N,) [N m] or [N] of its motor.
        command: (N,) command of the motor; nan in files that do not have it.
    """

    name: str
    joint: SceneJoint
    turns: bool
    value: Array
    torque: Array
    command: Array

    @property
    def quantity(self) -> str:
        """Return "angle" or "position"."""
        return "angle" if self.turns else "position"

    @property
    def effort(self) -> str:
        """Return "torque" or "force", what its motor gives."""
        return "torque" if self.turns else "force"

    @property
    def unit(self) -> str:
        """Return the unit of its value."""
        return "rad" if self.turns else "m"

    @property
    def torque_unit(self) -> str:
        """Return the unit of what its motor gives."""
        return "N m" if self.turns else "N"

    @property
    def driven(self) -> bool:
        """Whether it has a motor."""
        return self.joint.motor is not None

    @property
    def bound(self) -> float:
        """Return the most that its motor can give; nan without one."""
        return np.nan if self.joint.motor is None else self.joint.motor.torque

    @property
    def saturated(self) -> Bools:
        """Return (N,) whether its motor gives the most that it can."""
        found: Bools = (np.abs(self.torque) >= SATURATED_SHARE * self.bound) & (self.bound > 0)
        return found

    @property
    def share(self) -> float:
        """Return the share of the time in saturation; nan without a bound."""
        return float(self.saturated.mean()) if self.saturated.size and self.bound > 0 else np.nan

    @property
    def target(self) -> Array | None:
        """Return (N,) the commanded angle or position of a servo; None for anything else."""
        if self.joint.motor is None or self.joint.motor.kind != "servo" or not np.isfinite(self.command).all():
            return None
        return self.command

    @property
    def at_limit(self) -> bool:
        """Whether it reached one of its limits."""
        near = (self.value <= self.joint.lower + LIMIT_TOLERANCE) | (self.value >= self.joint.upper - LIMIT_TOLERANCE)
        return bool(near.any())


@dataclass(frozen=True)
class Separation:
    """The distance [m] by which the sides of joints came apart: over all joints and times, and at the worst."""

    rms: float
    most: float
    joint: str
    time: float


def channels(trajectory: Trajectory, scene: Scene) -> list[Channel]:
    """Return all coordinates of all joints, in the file's order."""
    known = {joint.name: joint for joint in scene.joints}
    found = []
    for index, name in enumerate(trajectory.joint_names):
        joint = known.get(name, SceneJoint(name))
        columns = [
            k for k in range(trajectory.joint_value.shape[2]) if np.isfinite(trajectory.joint_value[:, index, k]).any()
        ]
        for k in columns:
            found.append(
                Channel(
                    name=name if len(columns) == 1 else f"{name} {k + 1}",
                    joint=joint,
                    turns=joint.turns[k] if k < len(joint.turns) else True,
                    value=trajectory.joint_value[:, index, k],
                    torque=trajectory.joint_torque[:, index, k],
                    command=trajectory.joint_command[:, index, k],
                )
            )
    return found


def separation(trajectory: Trajectory) -> Separation | None:
    """Return the separation of the joints; None where none is known."""
    apart = trajectory.joint_separation
    if not np.isfinite(apart).any():
        return None
    step, joint = np.unravel_index(int(np.nanargmax(apart)), apart.shape)
    return Separation(
        rms=float(np.sqrt(np.nanmean(apart**2))),
        most=float(apart[step, joint]),
        joint=trajectory.joint_names[joint],
        time=float(trajectory.time[step]),
    )
