"""The shapes of bodies, of their parts and of blocks, and where these are placed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.shapes import UPRIGHT, Box, Capsule, Shape, Sphere
from symphys.problem.parametric.sizes import flatness
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.shapes import PartTable, ShapeTable, SolidTable
from symphys.problem.schema.types import RollPitchYaw

Array = NDArray[np.float64]
SINGLE = ("sphere", "box", "capsule")
EXAMPLES = "{ sphere = { radius = 0.5 } }, { box = { size = [1, 2, 3] } } or { capsule = { radius = 0.1, length = 1 } }"
COMPOUND = "{ parts = [{ box = { size = [1, 2, 3] }, centre = [0.5, 0, 0] }, ...] }"


def read_shape(place: Place, table: ShapeTable | None, faults: Faults) -> tuple[Shape, ...]:
    """The surface of a body."""
    if table is None:
        return ()
    place = (*place, "shape")
    given = [key for key in (*SINGLE, "spheres", "parts") if getattr(table, key) is not None]
    if len(given) != 1:
        faults.add(
            place,
            f"{wanted(given)} one of sphere, box, capsule, spheres and parts: {EXAMPLES}, or several: {COMPOUND}",
        )
        return ()
    if table.spheres is not None:
        return tuple(Sphere(part.radius, three(part.centre)) for part in table.spheres)
    if table.parts is not None:
        found = [read_part((*place, "parts", k), part, faults) for k, part in enumerate(table.parts)]
        return tuple(shape for shape in found if shape) if all(found) else ()
    return (solid(place, table, three([0, 0, 0]), UPRIGHT, faults),)


def read_part(place: Place, table: PartTable, faults: Faults) -> Shape | None:
    """One part of a compound; None after a complaint."""
    orientation = read_orientation((*place, "orientation"), table.orientation, faults)
    return read_solid(place, table, table.centre, orientation, faults)


def read_solid(
    place: Place, table: SolidTable, centre: Sequence[float], orientation: Array, faults: Faults
) -> Shape | None:
    """The one shape of a table; None after a complaint."""
    given = [key for key in SINGLE if getattr(table, key) is not None]
    if len(given) != 1:
        faults.add(place, f"{wanted(given)} one of sphere, box and capsule: {EXAMPLES}")
        return None
    w, x, y, z = (float(q) for q in orientation)
    return solid(place, table, three(centre), (w, x, y, z), faults)


def solid(
    place: Place,
    table: ShapeTable | SolidTable,
    centre: tuple[float, float, float],
    orientation: tuple[float, float, float, float],
    faults: Faults,
) -> Shape:
    """The sphere, box or capsule of a table that has one; notes one that is too flat."""
    if table.sphere is not None:
        return Sphere(table.sphere.radius, centre)
    shape: Box | Capsule
    if table.box is not None:
        shape = Box(three([edge / 2 for edge in table.box.size]), centre, orientation)
        place = (*place, "box", "size")
    else:
        assert table.capsule is not None
        shape = Capsule(table.capsule.radius, table.capsule.length / 2, centre, orientation)
        place = (*place, "capsule")
    reason = flatness(shape)
    if reason:
        faults.add(place, reason)
    return shape


def wanted(given: Sequence[str]) -> str:
    """What to say where not exactly one shape is given."""
    return f"has {' and '.join(given)}; give only" if given else "give"


def three(numbers: Sequence[float]) -> tuple[float, float, float]:
    """A vector as a tuple."""
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def read_orientation(place: Place, given: Any, faults: Faults) -> Array:
    """(4,): the unit quaternion w x y z, from four numbers or from angles."""
    if isinstance(given, RollPitchYaw):
        quaternion = np.array(UPRIGHT)
        for axis, degrees in enumerate((given.roll_deg, given.pitch_deg, given.yaw_deg)):
            quaternion = turned(quaternion, axis, degrees)
        return quaternion
    length = float(np.linalg.norm(given))
    if not 1e-6 < length < 1e6:
        faults.add(place, "a quaternion must not be zero; [1, 0, 0, 0] is no rotation")
        return np.array(UPRIGHT)
    return np.array(given) / length


def turned(quaternion: Array, axis: int, degrees: float) -> Array:
    """The orientation after a turn about a world axis."""
    half = np.deg2rad(degrees % 360) / 2
    turn = np.zeros(4)
    turn[0], turn[1 + axis] = np.cos(half), np.sin(half)
    return np.asarray(rotation.multiply(turn, quaternion), float).ravel()
