"""The shapes of bodies, of their parts and of blocks, and where these are placed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symphys.model.orientation import roll_pitch_yaw, unit_quaternion
from symphys.model.shapes import SHAPES, UPRIGHT, Shape, Sphere
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.value_texts import listed
from symphys.problem.schema.shapes import EXAMPLES, PartTable, ShapeTable, SolidTable
from symphys.problem.schema.types import RollPitchYaw
from symphys.types import Array

KINDS = tuple(SHAPES)
COMPOUND = "{ parts = [{ box = { size = [1, 2, 3] }, centre = [0.5, 0, 0] }, ...] }"


def read_shape(place: Place, table: ShapeTable | None, faults: Faults) -> tuple[Shape, ...]:
    """The surface of a body."""
    if table is None:
        return ()
    place = (*place, "shape")
    given = [key for key in (*KINDS, "spheres", "parts") if getattr(table, key) is not None]
    if len(given) != 1:
        faults.add(
            place,
            f"{wanted(given)} one of {', '.join(KINDS)}, spheres and parts: {EXAMPLES}, or several: {COMPOUND}",
        )
        return ()
    if table.spheres is not None:
        return tuple(Sphere(part.radius, three(part.centre)) for part in table.spheres)
    if table.parts is not None:
        found = [read_part((*place, "parts", k), part, faults) for k, part in enumerate(table.parts)]
        return tuple(shape for shape in found if shape) if all(found) else ()
    return (solid(place, table, given[0], three([0, 0, 0]), UPRIGHT, faults),)


def read_part(place: Place, table: PartTable, faults: Faults) -> Shape | None:
    """One part of a compound; None after a fault."""
    orientation = read_orientation((*place, "orientation"), table.orientation, faults)
    return read_solid(place, table, table.centre, orientation, faults)


def read_solid(
    place: Place, table: SolidTable, centre: Sequence[float], orientation: Array, faults: Faults
) -> Shape | None:
    """The one shape of a table; None after a fault."""
    given = [key for key in KINDS if getattr(table, key) is not None]
    if len(given) != 1:
        faults.add(place, f"{wanted(given)} one of {listed(KINDS, 'and')}: {EXAMPLES}")
        return None
    w, x, y, z = (float(q) for q in orientation)
    return solid(place, table, given[0], three(centre), (w, x, y, z), faults)


def solid(
    place: Place,
    table: SolidTable,
    kind: str,
    centre: tuple[float, float, float],
    orientation: tuple[float, float, float, float],
    faults: Faults,
) -> Shape:
    """The shape of this kind that a table has; notes one that is too flat."""
    cls, own = SHAPES[kind], getattr(table, kind)
    keys = [key.name for key in cls.size_keys]
    given = [*keys, *(key.name for key in cls.optional_keys)]
    shape = cls.from_sizes({key: getattr(own, key) for key in given}, centre, orientation)
    reason = shape.flatness
    if reason:
        faults.add((*place, kind, *(keys if len(keys) == 1 else [])), reason)
    elif shape.optional_fault:
        faults.add((*place, kind, cls.optional_keys[0].name), shape.optional_fault)
    return shape


def wanted(given: Sequence[str]) -> str:
    """Return the message for a table without exactly one shape."""
    return f"has {' and '.join(given)}; give only" if given else "give"


def three(numbers: Sequence[float]) -> tuple[float, float, float]:
    """A vector as a tuple."""
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def read_orientation(place: Place, given: Any, faults: Faults) -> Array:
    """(4,): the unit quaternion w x y z, from four numbers or from angles."""
    if isinstance(given, RollPitchYaw):
        return roll_pitch_yaw(given.roll_deg, given.pitch_deg, given.yaw_deg)
    try:
        return unit_quaternion(given)
    except ValueError as fault:
        faults.add(place, str(fault))
        return np.array(UPRIGHT)
