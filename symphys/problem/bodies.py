"""The [[body]] tables: mass, inertia and state at the start."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from symphys import rotation
from symphys.problem.faults import Faults
from symphys.problem.inertia import centre_of_mass, complaint, volume
from symphys.problem.plan import COMBINE, BodyPlan
from symphys.problem.schema.physics import BodyTable, ShapeTable, SurfaceTable
from symphys.problem.schema.types import RollPitchYaw
from symphys.shapes import Sphere

Array = NDArray[np.float64]
OFF_CENTRE = 1e-6
"""How far a compound's centre of mass may be from the body's origin, relative to the size of the compound."""


def read_body(index: int, table: BodyTable, faults: Faults) -> BodyPlan:
    """The plan of one body; notes a mass or inertia that is missing, doubled or impossible."""
    place = ("body", index)
    spheres = read_shape(place, table.shape, faults)
    single = table.shape.sphere if table.shape else None
    hollow = single is not None and single.hollow
    density = read_density(place, table, hollow, faults)
    check_inertia(place, table, spheres, faults)
    mass = table.mass or (density or 0.0) * sum(volume(sphere.radius) for sphere in spheres)
    if not isfinite(mass) or (mass == 0 and not faults.issues):
        faults.add((*place, "density"), "the mass that follows from it is no positive finite number")
    return BodyPlan(
        name=table.name,
        mass=mass,
        density=density if len(spheres) == 1 else None,
        spheres=spheres,
        hollow=hollow,
        inertia=frozen(table.inertia),
        states=states(table),
        mates=None if table.collides_with is None else frozenset(table.collides_with),
    )


def read_shape(place: tuple[str, int], shape: ShapeTable | None, faults: Faults) -> tuple[Sphere, ...]:
    """The spheres of a body."""
    if shape is None:
        return ()
    if (shape.sphere is None) == (shape.spheres is None):
        faults.add(
            (*place, "shape"),
            "give either sphere or spheres: { sphere = { radius = 0.5 } } or "
            "{ spheres = [{ radius = 0.1, centre = [0.2, 0, 0] }, ...] }",
        )
        return ()
    if shape.sphere is not None:
        return (Sphere(shape.sphere.radius),)
    parts = shape.spheres or []
    return tuple(Sphere(part.radius, (part.centre[0], part.centre[1], part.centre[2])) for part in parts)


def read_density(place: tuple[str, int], table: BodyTable, hollow: bool, faults: Faults) -> float | None:
    """The density, where the mass is given by it."""
    if (table.mass is None) == (table.density is None):
        faults.add((*place, "mass"), "give either mass [kg] or density [kg/m^3]")
    elif table.density is not None and table.shape is None:
        faults.add((*place, "density"), "a body without a shape has no volume; give mass and inertia")
    elif table.density is not None and hollow:
        faults.add((*place, "density"), "a hollow sphere is a thin shell without volume; give mass")
    return table.density


def check_inertia(place: tuple[str, int], table: BodyTable, spheres: tuple[Sphere, ...], faults: Faults) -> None:
    """A given inertia must be possible; one that is not given must follow from the shape."""
    if table.inertia is not None:
        reason = complaint(table.inertia)
        if reason:
            faults.add((*place, "inertia"), reason)
    elif table.shape is None:
        faults.add((*place, "inertia"), "this key is required for a body without a shape")
    elif table.shape.spheres and spheres:
        off = float(np.linalg.norm(centre_of_mass(spheres)))
        extent = max(float(np.linalg.norm(sphere.centre)) + sphere.radius for sphere in spheres)
        if not off <= OFF_CENTRE * extent:
            centre = ", ".join(f"{c:.6g}" for c in centre_of_mass(spheres))
            faults.add(
                (*place, "shape", "spheres"),
                f"the centre of mass of these spheres is {off:.4g} m from the body's origin, at [{centre}]; "
                "subtract that from every centre, or give inertia",
            )


def read_state(table: BodyTable, index: int, faults: Faults) -> dict[str, Array]:
    """The state at the start by name."""
    given = {
        "position": np.array(table.position),
        "orientation": read_orientation(table, index, faults),
        "velocity": np.array(table.velocity),
        "angular_velocity": np.array(table.angular_velocity),
    }
    return {f"{table.name}.{key}": value for key, value in given.items()}


def read_orientation(table: BodyTable, index: int, faults: Faults) -> Array:
    """(4,): the unit quaternion w x y z."""
    given = table.orientation
    if isinstance(given, RollPitchYaw):
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        for axis, degrees in enumerate((given.roll_deg, given.pitch_deg, given.yaw_deg)):
            quaternion = turned(quaternion, axis, degrees)
        return quaternion
    length = float(np.linalg.norm(given))
    if not 1e-6 < length < 1e6:
        faults.add(("body", index, "orientation"), "a quaternion must not be zero; [1, 0, 0, 0] is no rotation")
        return np.array([1.0, 0.0, 0.0, 0.0])
    return np.array(given) / length


def turned(quaternion: Array, axis: int, degrees: float) -> Array:
    """The orientation after a turn about a world axis."""
    half = np.deg2rad(degrees % 360) / 2
    turn = np.zeros(4)
    turn[0], turn[1 + axis] = np.cos(half), np.sin(half)
    return np.asarray(rotation.multiply(turn, quaternion), float).ravel()


def states(table: SurfaceTable) -> dict[str, float]:
    """The coefficients that a table states."""
    given = {key: getattr(table, key) for key in COMBINE}
    return {key: value for key, value in given.items() if value is not None}


def frozen(inertia: object) -> object:
    """Lists as tuples, numbers as floats."""
    if isinstance(inertia, list):
        return tuple(frozen(item) for item in inertia)
    return float(inertia) if isinstance(inertia, int | float) else None
