"""A simulated motion as plain arrays: what is recorded, drawn and examined."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError

Array = NDArray[np.float64]


class NotFinite(SymphysError):
    """A simulation produced a number that is not finite; the message names its time step and body."""


@dataclass(frozen=True)
class Trajectory:
    """N steps of B bodies with C pairs and J joints; world frame, SI units, velocities true at their time.

    Attributes:
        time: (N + 1,) [s].
        body_names: (B,).
        position: (N + 1, B, 3) [m].
        orientation: (N + 1, B, 4) unit quaternions w x y z.
        velocity: (N + 1, B, 3) [m/s].
        angular_velocity: (N + 1, B, 3) [rad/s].
        force: (N, B, 3) applied at the centre of mass [N].
        torque: (N, B, 3) applied [N m].
        contact_names: (C,).
        contact_force: (N, C, 3) on the pair's first body, impulse over the step / dt [N]. Leapfrog gives half of a
            stretch's impulse in the next one: a contact that begins shows up to a quarter less in its first step.
        contact_gap: (N + 1, C) [m]; the last row repeats the one before it.
        residual: (N,) largest change of an impulse in the last sweep [N s].
        crowded: (N,) 1 where a body had two or more impacts at once, or impacts of a chain come late.
        ambiguous: (N,) 1 where several bodies met at one instant and rebounded.
        paradox: (N,) 1 where friction pulled a sliding contact together.
        joint_names: (J,).
        joint_value, joint_rate: (N + 1, J, K) coordinates [rad] or [m] and their rates; K is that of the joint that has
            most, NaN where another has fewer.
        joint_torque: (N, J, K) of motors [N m] or [N]; 0 without one.
        joint_command: (N, J, K) what motors were told, in the unit of their kind; 0 where nothing tells them.
        joint_separation: (N + 1, J) how far apart the sockets are, as far as a joint holds them together [m].
    """

    time: Array
    body_names: tuple[str, ...]
    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array
    force: Array
    torque: Array
    contact_names: tuple[str, ...]
    contact_force: Array
    contact_gap: Array
    residual: Array
    crowded: Array
    ambiguous: Array
    paradox: Array
    joint_names: tuple[str, ...]
    joint_value: Array
    joint_rate: Array
    joint_torque: Array
    joint_command: Array
    joint_separation: Array

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
