"""Numbers of a world as data: what a problem file, a variable and a page know of a number beyond its value.

The classes of ``model`` declare their numbers in the metadata of their fields: ``field(metadata=declare("kg"))``.
Tables of problem files, bounds and scales of variables, the numbers that a phase may set, and units follow from there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from math import inf
from types import MappingProxyType
from typing import Any, Literal

from symphys.records import dataclass

TURNING: Mapping[str, str] = MappingProxyType({"torque": "N m", "angle": "rad", "inertia": "kg m^2"})
SLIDING: Mapping[str, str] = MappingProxyType({"torque": "N", "angle": "m", "inertia": "kg"})
"""Units along a coordinate that is an angle, and along one that is a displacement."""


@dataclass(frozen=True)
class Number:
    """The declaration of a number.

    Attributes:
        unit: empty for a pure number; None: not known. Of what acts along a coordinate: with ``{torque}``, ``{angle}``
            and ``{inertia}``, see ``TURNING``.
        least, most: what is physical.
        exceeds: whether it must exceed ``least``.
        floored: whether a variable keeps it above a share of its value in the file, unless that states ``lower``.
        scale: how much it typically changes; None: by its own size.
        structural: whether 0 leaves equations out of the step, so that a variable sets it only where it is not 0.
        phase: whether a phase may set it: from its ``start`` on, or as an ``impulse``, which covers half of the step
            before too; empty: a shape, a mass or a place follows from it.
    """

    unit: str | None = ""
    least: float = -inf
    most: float = inf
    exceeds: bool = False
    floored: bool = False
    scale: float | None = None
    structural: bool = False
    phase: Literal["", "start", "impulse"] = ""

    def along(self, turning: bool) -> Number:
        """Return the number of a joint whose coordinates are angles, or displacements."""
        return self if self.unit is None else replace(self, unit=self.unit.format(**(TURNING if turning else SLIDING)))

    @property
    def units(self) -> str:
        """Return the unit in brackets, of both kinds of coordinates, for descriptions; empty if there is none."""
        both = [self.along(turning).unit for turning in (True, False)]
        return " or ".join(f"[{unit}]" for unit in dict.fromkeys(both) if unit)


def declare(unit: str | None = "", about: str = "", value: str = "", **declared: Any) -> dict[str, Any]:
    """Make the metadata of a field that is a number.

    Args:
        unit: see ``Number``.
        about: its description in the schema of problem files, where the unit comes before a semicolon or at the end;
            empty: no table has it.
        value: which values a table takes; empty: those between ``least`` and ``most``.
        declared: other attributes of ``Number``.
    """
    made = Number(unit, **declared)
    first, semicolon, rest = about.partition(";")
    return {"number": made, **(table_key(value, f"{first} {made.units}".rstrip() + semicolon + rest) if about else {})}


def table_key(value: str, about: str) -> dict[str, Any]:
    """Make the metadata of a field that is a key of a table in problem files; see ``declare``."""
    return {"value": value, "about": about}


def numbers_of(thing: Any) -> dict[str, Number]:
    """Return the numbers that a class, or an object of it, declares, by field."""
    return {each.name: each.metadata["number"] for each in fields(thing) if "number" in each.metadata}
