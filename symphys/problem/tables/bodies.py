"""The [[body]] tables: mass, inertia and state at the start."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from symphys.model.shapes import Shape
from symphys.model.shapes.inertia import centring, off_centre
from symphys.model.world import COMBINE
from symphys.problem.checks.magnitude import check_magnitudes
from symphys.problem.parametric.parts import ParametricBody
from symphys.problem.reading.faults import Faults
from symphys.problem.schema.physics import BodyTable, MemberTable, SurfaceTable
from symphys.problem.tables.shapes import read_orientation, read_shape
from symphys.types import Array

ROUNDING = 1e-9
"""Relative slack for symmetry and the triangle inequality, which flat and thin bodies meet with equality."""


def inertia_fault(value: float | Sequence[float] | Sequence[Sequence[float]]) -> str:
    """Why no rigid body has this inertia; empty if one has."""
    given = np.asarray(value, float)
    if given.ndim == 2 and not np.allclose(given, given.T, rtol=ROUNDING, atol=ROUNDING * np.abs(given).max()):
        return "the matrix must be symmetric"
    moments = np.sort(np.linalg.eigvalsh(given) if given.ndim == 2 else np.broadcast_to(given, 3))
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0:
        return f"the principal moments must be positive; they are {listed}"
    if moments[0] + moments[1] < moments[2] * (1 - ROUNDING):
        return f"no principal moment may exceed the sum of the other two; they are {listed}"
    return ""


def read_body(index: int, table: BodyTable, faults: Faults) -> ParametricBody:
    """One body; notes a mass or inertia that is missing, doubled or impossible."""
    place = ("body", index)
    if table.mass == 0:
        return read_frame(place, table, faults)
    before = len(faults.issues)
    shapes = read_shape(place, table.shape, faults)
    single = table.shape.sphere if table.shape else None
    hollow = single is not None and single.hollow
    density = read_density(place, table, hollow, faults)
    check_inertia(place, table, shapes, faults)
    mass = table.mass or (density or 0.0) * sum(shape.volume for shape in shapes)
    body = ParametricBody(
        name=table.name,
        mass=mass,
        density=density if len(shapes) == 1 else None,
        shapes=shapes,
        hollow=hollow,
        inertia=frozen(table.inertia),
        states=states(table),
        collides_with=touching(table),
        group=table.group,
    )
    if len(faults.issues) == before:
        check_magnitudes(place, table, body, faults)
    return body


def read_frame(place: tuple[str, int], table: BodyTable, faults: Faults) -> ParametricBody:
    """A body without mass: a frame between two joints; notes what only bodies with mass have."""
    given = [key for key in ("shape", "inertia", "density") if getattr(table, key) is not None]
    if given:
        faults.add((*place, "mass"), "must be greater than 0, not 0")
    return ParametricBody(table.name, 0.0, None, (), False, 0.0, states(table), touching(table), table.group)


def read_density(place: tuple[str, int], table: BodyTable, hollow: bool, faults: Faults) -> float | None:
    """The density, where the mass is given by it."""
    if (table.mass is None) == (table.density is None):
        faults.add((*place, "mass"), "give either mass [kg] or density [kg/m^3]")
    elif table.density is not None and table.shape is None:
        faults.add((*place, "density"), "a body without a shape has no volume; give mass and inertia")
    elif table.density is not None and hollow:
        faults.add((*place, "density"), "a hollow sphere is a thin shell without volume; give mass")
    return table.density


def check_inertia(place: tuple[str, int], table: BodyTable, shapes: Sequence[Shape], faults: Faults) -> None:
    """A given inertia must be possible; one that is not given must follow from the shape."""
    if table.inertia is not None:
        reason = inertia_fault(table.inertia)
        if reason:
            faults.add((*place, "inertia"), reason)
    elif table.shape is None:
        faults.add((*place, "inertia"), "this key is required for a body without a shape")
    elif shapes and off_centre(shapes):
        key = next(key for key in ("spheres", "parts", "convex") if getattr(table.shape, key))
        faults.add((*place, "shape", key), f"{centring(shapes, key)}, or give inertia")


def read_state(table: BodyTable, index: int, faults: Faults) -> dict[str, Array]:
    """The state at the start by name."""
    given = {
        "position": np.array(table.position),
        "orientation": read_orientation(("body", index, "orientation"), table.orientation, faults),
        "velocity": np.array(table.velocity),
        "angular_velocity": np.array(table.angular_velocity),
    }
    return {f"{table.name}.{key}": value for key, value in given.items()}


def touching(table: MemberTable) -> frozenset[str] | None:
    """The names in collides_with; None: all."""
    return None if table.collides_with is None else frozenset(table.collides_with)


def states(table: SurfaceTable, keys: Iterable[str] = COMBINE) -> dict[str, Any]:
    """The coefficients that a table states, among those that its kind of table has."""
    given = {key: getattr(table, key) for key in keys}
    return {key: value for key, value in given.items() if value is not None}


def frozen(inertia: object) -> object:
    """Lists as tuples, numbers as floats."""
    if isinstance(inertia, list):
        return tuple(frozen(item) for item in inertia)
    return float(inertia) if isinstance(inertia, int | float) else None
