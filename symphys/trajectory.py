"""A simulated motion as plain arrays: what is recorded, drawn and examined. The fields are those of trajectory.npz."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, get_type_hints

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class NotFinite(SymphysError):
    """A simulation produced a number that is not finite; the message names its time step and body."""


@dataclass(frozen=True)
class Trajectory:
    """N steps of B bodies with C pairs and J joints; world frame, SI units, velocities true at their time.

    The types of the fields hold the shapes.

    Attributes:
        time: (N + 1,) [s].
        body_names: (B,).
        position: [m].
        orientation: unit quaternions w x y z.
        velocity: [m/s].
        angular_velocity: [rad/s].
        force: applied at the centre of mass [N].
        torque: applied [N m].
        contact_names: (C,).
        contact_force: on the pair's first body, impulse over the step / dt [N]. Leapfrog applies half of a
            substep's impulse in the next one: a contact that begins shows up to a quarter less in its first step.
        contact_gap: [m]; the last row repeats the one before it.
        residual: largest change of an impulse in the last sweep [N s].
        crowded: 1 where a body had two or more impacts at once, or impacts of a chain come late.
        ambiguous: 1 where several bodies met at one instant and rebounded.
        paradox: 1 where friction pulled a sliding contact together.
        joint_names: (J,).
        joint_value, joint_rate: coordinates [rad] or [m] and their rates; K is that of the joint that has
            most, NaN where another has fewer.
        joint_torque: of motors [N m] or [N]; 0 without one.
        joint_command: commands of motors, in the unit of their kind; 0 without one.
        joint_separation: distance of the frames along the directions that a joint locks [m].
    """

    time: Array
    body_names: tuple[str, ...]
    position: Annotated[Array, "N + 1, B, 3"]
    orientation: Annotated[Array, "N + 1, B, 4"]
    velocity: Annotated[Array, "N + 1, B, 3"]
    angular_velocity: Annotated[Array, "N + 1, B, 3"]
    force: Annotated[Array, "N, B, 3"]
    torque: Annotated[Array, "N, B, 3"]
    contact_names: tuple[str, ...]
    contact_force: Annotated[Array, "N, C, 3"]
    contact_gap: Annotated[Array, "N + 1, C"]
    residual: Annotated[Array, "N"]
    crowded: Annotated[Array, "N"]
    ambiguous: Annotated[Array, "N"]
    paradox: Annotated[Array, "N"]
    joint_names: tuple[str, ...]
    joint_value: Annotated[Array, "N + 1, J, K"]
    joint_rate: Annotated[Array, "N + 1, J, K"]
    joint_torque: Annotated[Array, "N, J, K"]
    joint_command: Annotated[Array, "N, J, K"]
    joint_separation: Annotated[Array, "N + 1, J"]

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Every field as an array, ready for ``numpy.savez``."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}

    def require_finite(self) -> Trajectory:
        """Itself; NotFinite names the first bad step and body otherwise."""
        moving = np.concatenate([self.position, self.orientation, self.velocity, self.angular_velocity], axis=2)
        bad = ~np.isfinite(moving).all(axis=2)
        if bad.any():
            step = int(np.argmax(bad.any(axis=1)))
            names = ", ".join(repr(self.body_names[i]) for i in np.flatnonzero(bad[step]))
            raise NotFinite(f"the simulation is not finite from step {step} (t = {self.time[step]:g} s) on: {names}")
        return self


@cache
def shapes() -> dict[str, tuple[str, ...]]:
    """The sizes of every array over states or steps by their letters: ``{"position": ("N + 1", "B", "3"), ...}``."""
    hints = get_type_hints(Trajectory, include_extras=True)
    return {
        name: tuple(hint.__metadata__[0].split(", ")) for name, hint in hints.items() if hasattr(hint, "__metadata__")
    }
