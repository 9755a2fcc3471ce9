"""Simulated motions as arrays, with the fields of trajectory.npz."""

from __future__ import annotations

import re
from dataclasses import fields
from functools import cache, cached_property
from typing import Annotated, get_type_hints

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

OF_BODIES = {
    "position": "m",
    "orientation": "",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "force": "N",
    "torque": "N m",
}
"""Fields of the quantities of a body, with their units."""
COORDINATES = ("joint_value", "joint_rate", "joint_torque", "joint_command")
"""Fields with a column for each coordinate of a joint; of a joint with one coordinate they have no columns."""
NAMED = 6
"""Largest number of contacts in a message."""


class NotFinite(SymphysError):
    """A simulation produced a number that is not finite; the message names its time step and body."""


@dataclass(frozen=True)
class Trajectory:
    """A motion of N steps of B bodies with C contacts and J joints, in the world frame and SI units.

    Quantities are also found by the names that formulas use: ``motion["ball.position"]``, ``motion["knee.angle"]``;
    ``units`` lists these names.

    Attributes:
        time: (N + 1,) instants [s].
        body_names: (B,) names of the bodies.
        position: positions of the centres of mass [m].
        orientation: unit quaternions w x y z.
        velocity: velocities at the instants [m/s].
        angular_velocity: angular velocities at the instants [rad/s].
        force: applied forces at the centres of mass [N], constant over a step.
        torque: applied torques [N m], constant over a step.
        contact_names: (C,) names of the contacts.
        contact_force: force on the first body of each contact [N], its impulse over the step / dt. Leapfrog applies
            half of a substep's impulse in the next one: the first step of a contact shows up to a quarter less.
        contact_gap: distances of the surfaces [m]; the last row repeats the one before it.
        residual: largest change of an impulse in the last sweep of the contact solver [N s].
        crowded: 1 for steps in which a body had two or more impacts at once, or impacts of a chain came late.
        ambiguous: 1 for steps in which several bodies met at one instant and rebounded.
        paradox: 1 for steps in which friction pulled a sliding contact together.
        joint_names: (J,) names of the joints.
        joint_value, joint_rate: coordinates [rad] or [m] and their rates; K is the largest number of coordinates of a
            joint, and entries that a joint does not have are NaN.
        joint_torque: torques [N m] or forces [N] of motors; 0 without a motor.
        joint_command: commands of motors, in the unit of their kind; 0 without a motor.
        joint_separation: distances of the joints' frames along locked directions [m].
        joint_units: (J,) units of the coordinates, "rad" or "m"; empty in older files.

    Example:
        >>> import symphys
        >>> motion = symphys.simulate("ball_throw", throw=[8, 0, 3])
        >>> motion["ball.position"].shape, motion.units["ball.velocity"], motion.contact_names
        ((501, 3), 'm/s', ('ball-ground',))
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
    joint_units: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Array:
        """Return a quantity by its name: (N + 1, ...), or (N, ...) if it acts during steps.

        Raises:
            KeyError: there is no such quantity; names those that are similar.
        """
        if name not in self._columns:
            raise KeyError(f"there is no {quote(name)}; {self._meant(name)}")
        field_name, index, _ = self._columns[name]
        array = getattr(self, field_name)[:, index] if index is not None else getattr(self, field_name)
        if field_name not in COORDINATES:
            return np.asarray(array)
        count = int((~np.isnan(self.joint_value[0, index])).sum())
        return np.asarray(array[:, 0] if count == 1 else array[:, :count])

    def __contains__(self, name: object) -> bool:
        """Whether there is a quantity of this name."""
        return name in self._columns

    @property
    def units(self) -> dict[str, str]:
        """The unit of each quantity by its name: ``{"ball.position": "m", ...}``; empty if it has none."""
        return {name: unit for name, (_, _, unit) in self._columns.items()}

    def _meant(self, name: str) -> str:
        """Suggest names that are similar to one that does not exist."""
        owner, _, quantity = name.rpartition(".")
        touching = [each for each in self.contact_names if owner in re.split("[-:]", each)]
        if touching and ("contact" in quantity or "gap" in quantity):
            known = [f"{each}.{'gap' if 'gap' in quantity else 'force'}" for each in touching]
            more = f" and {len(known) - NAMED} more" if len(known) > NAMED else ""
            return f"contacts go by their two surfaces: {', '.join(map(quote, known[:NAMED]))}{more}"
        own = [known for known in self._columns if known.rpartition(".")[0] == owner]
        return hint(name, own or self._columns)

    @cached_property
    def _columns(self) -> dict[str, tuple[str, int | None, str]]:
        """The field, the index and the unit of each quantity."""
        found: dict[str, tuple[str, int | None, str]] = {"time": ("time", None, "s")}
        for index, body in enumerate(self.body_names):
            found |= {f"{body}.{key}": (key, index, unit) for key, unit in OF_BODIES.items()}
        for index, joint in enumerate(self.joint_names):
            found[f"{joint}.separation"] = ("joint_separation", index, "m")
            if np.isnan(self.joint_value[:1, index]).all():
                continue
            unit = self.joint_units[index] if self.joint_units else ""
            found[f"{joint}.{'position' if unit == 'm' else 'angle'}"] = ("joint_value", index, unit)
            found[f"{joint}.rate"] = ("joint_rate", index, unit and f"{unit}/s")
            found[f"{joint}.torque"] = ("joint_torque", index, {"m": "N", "rad": "N m"}.get(unit, ""))
            found[f"{joint}.command"] = ("joint_command", index, "")
        for index, contact in enumerate(self.contact_names):
            found[f"{contact}.force"] = ("contact_force", index, "N")
            found[f"{contact}.gap"] = ("contact_gap", index, "m")
        return found

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return each field as an array, ready for ``numpy.savez``."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}

    def require_finite(self) -> Trajectory:
        """Return this motion.

        Raises:
            NotFinite: a number is not finite; names the first such step and its bodies.
        """
        moving = np.concatenate([self.position, self.orientation, self.velocity, self.angular_velocity], axis=2)
        bad = ~np.isfinite(moving).all(axis=2)
        if bad.any():
            step = int(np.argmax(bad.any(axis=1)))
            names = ", ".join(repr(self.body_names[i]) for i in np.flatnonzero(bad[step]))
            raise NotFinite(f"the simulation is not finite from step {step} (t = {self.time[step]:g} s) on: {names}")
        return self


@cache
def shapes() -> dict[str, tuple[str, ...]]:
    """Return the sizes of each array as letters: ``{"position": ("N + 1", "B", "3"), ...}``."""
    hints = get_type_hints(Trajectory, include_extras=True)
    return {
        name: tuple(hint.__metadata__[0].split(", ")) for name, hint in hints.items() if hasattr(hint, "__metadata__")
    }
