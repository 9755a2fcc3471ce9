"""A simulated motion as plain arrays: what is recorded, drawn and examined. The fields are those of trajectory.npz."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from functools import cache, cached_property
from typing import Annotated, get_type_hints

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
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
"""The quantities of a body by their fields, and their units."""
COORDINATES = ("joint_value", "joint_rate", "joint_torque", "joint_command")
"""Fields with as many columns as the joint has coordinates, or one number where there is one."""


NAMED = 6
"""Contacts in a message."""


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
        joint_units: (J,) of the coordinates, "rad" or "m"; empty in older files.

    Quantities also go by the names of formulas: ``motion["ball.position"]``, ``motion["knee.angle"]``; see ``units``.

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
        """(N + 1, ...), or (N, ...) of what acts in a step: a quantity by its name; KeyError says which there are."""
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
        """The unit of every quantity by its name: ``{"ball.position": "m", ...}``; empty where there is none."""
        return {name: unit for name, (_, _, unit) in self._columns.items()}

    def _meant(self, name: str) -> str:
        """What somebody may have meant who asked for a name that is none."""
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
