"""The [[body]] tables, and [ground], [[plane]], [[block]] and [[terrain]] for what stands still."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import hypot, isfinite
from typing import Any

import casadi as ca
import numpy as np

from symphys.expression import Formula, FormulaError, parse
from symphys.model.heightfield import Heightfield
from symphys.model.orientation import roll_pitch_yaw, unit_quaternion
from symphys.model.shapes import SHAPES, UPRIGHT, Fixture, Plane, Shape, Sphere, Static, Terrain
from symphys.model.shapes.inertia import centring, off_centre
from symphys.model.world import COMBINE
from symphys.problem.limits import check_magnitudes
from symphys.problem.parametric.parts import ParametricBody, ParametricStatic
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import listed, wanted
from symphys.problem.schema import Document
from symphys.problem.schema.physics import (
    BlockTable,
    BodyTable,
    MemberTable,
    PlaneTable,
    SurfaceTable,
    TerrainTable,
)
from symphys.problem.schema.shapes import EXAMPLES, ShapeTable, SolidTable
from symphys.problem.schema.types import RollPitchYaw
from symphys.records import dataclass
from symphys.suggest import quote
from symphys.types import Array

KINDS = tuple(SHAPES)
COMPOUND = "{ parts = [{ box = { size = [1, 2, 3] }, centre = [0.5, 0, 0] }, ...] }"
INERTIA_TOLERANCE = 1e-9
"""Relative slack for symmetry and the triangle inequality, which flat and thin bodies meet with equality."""
HEIGHT_NAMES = ("x", "y")
GRID_KEYS = ("spacing", "origin")


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
        found = []
        for k, part in enumerate(table.parts):
            where = (*place, "parts", k)
            orientation = read_orientation((*where, "orientation"), part.orientation, faults)
            found.append(read_solid(where, part, part.centre, orientation, faults))
        return tuple(shape for shape in found if shape) if all(found) else ()
    return (solid(place, table, given[0], three([0, 0, 0]), UPRIGHT, faults),)


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


def inertia_fault(value: float | Sequence[float] | Sequence[Sequence[float]]) -> str:
    """Return the reason why no rigid body has this inertia; empty if one has."""
    given = np.asarray(value, float)
    if given.ndim == 2 and not np.allclose(
        given, given.T, rtol=INERTIA_TOLERANCE, atol=INERTIA_TOLERANCE * np.abs(given).max()
    ):
        return "the matrix must be symmetric"
    moments = np.sort(np.linalg.eigvalsh(given) if given.ndim == 2 else np.broadcast_to(given, 3))
    listed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0:
        return f"the principal moments must be positive; they are {listed}"
    if moments[0] + moments[1] < moments[2] * (1 - INERTIA_TOLERANCE):
        return f"no principal moment may exceed the sum of the other two; they are {listed}"
    return ""


def read_body(index: int, table: BodyTable, faults: Faults) -> ParametricBody:
    """Read a body; note a mass or inertia that is missing, doubled or impossible."""
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


def read_statics(document: Document, starts: Sequence[Sequence[float]], faults: Faults) -> tuple[ParametricStatic, ...]:
    """The ground, if there is one, then planes, blocks and terrain; ``starts``: where bodies are at first."""
    found: list[tuple[MemberTable, Static]] = []
    if document.ground is not None:
        found.append((document.ground, Plane.ground(document.ground.height)))
    found += [(table, read_plane(i, table, faults)) for i, table in enumerate(document.plane)]
    found += [(table, read_block(i, table, faults)) for i, table in enumerate(document.block)]
    found += [(table, read_terrain(i, table, starts, faults)) for i, table in enumerate(document.terrain)]
    return tuple(ParametricStatic(static, states(table), table.group, touching(table)) for table, static in found)


def read_plane(index: int, table: PlaneTable, faults: Faults) -> Plane:
    """Read a plane."""
    place = ("plane", index)
    length = hypot(*table.normal)  # squares of large numbers overflow
    if not (isfinite(length) and length > 1e-12):
        faults.add((*place, "normal"), "must not be zero; [0, 0, 1] points up")
        length = 1.0
    normal = np.array(table.normal) / length
    if (table.point is None) == (table.offset is None):
        faults.add((*place, "offset"), "give either a point of the plane or its offset along the normal")
    offset = table.offset if table.point is None else float(normal @ np.array(table.point))
    return Plane(table.name, three(normal.tolist()), offset or 0.0)


def read_block(index: int, table: BlockTable, faults: Faults) -> Fixture:
    """Read a static solid."""
    place = ("block", index)
    orientation = read_orientation((*place, "orientation"), table.orientation, faults)
    shape = read_solid((*place, "shape"), table.shape, table.position, orientation, faults)
    return Fixture(table.name, shape or Sphere(1.0))


@dataclass(frozen=True)
class FormulaHeight:
    """The height [m] that a formula of x and y [m] gives."""

    formula: Formula

    def __call__(self, x: Any, y: Any) -> Any:
        """A casadi scalar; x and y are casadi scalars or numbers."""
        return self.formula.evaluate({"x": x, "y": y})


def flat(x: Any, y: Any) -> Any:
    """Return a placeholder for a terrain that cannot be read."""
    return 0 * x * y


def read_terrain(index: int, table: TerrainTable, starts: Sequence[Sequence[float]], faults: Faults) -> Terrain:
    """Read a terrain; ``starts``: where bodies are at first, so that a formula can be tried there."""
    place = ("terrain", index)
    height: Callable[[Any, Any], Any] | None = None
    if (table.height is None) == (table.heights is None):
        faults.add((*place, "height"), "give either height (a formula of x and y) or heights (a grid) with spacing")
    elif table.height is not None:
        height = read_formula(place, table, table.height, starts, faults)
    elif table.spacing is None:
        faults.add((*place, "spacing"), "this key is required with heights: the distance of neighbours [m]")
    else:
        rows = tuple(tuple(row) for row in table.heights or ())
        (dx, dy), (x, y) = table.spacing, table.origin or (0.0, 0.0)
        height = Heightfield(rows, (dx, dy), (x, y))
    return Terrain(table.name, height or flat)


def read_formula(
    place: Place, table: TerrainTable, text: str, starts: Sequence[Sequence[float]], faults: Faults
) -> FormulaHeight | None:
    """The height by a formula; None after a fault."""
    for key in GRID_KEYS:
        if getattr(table, key) is not None:
            faults.add((*place, key), "belongs to a grid of heights; a formula needs none")
    try:
        formula = parse(text)
        reason = refusal(formula, starts)
    except FormulaError as error:
        reason = str(error)
    if reason:
        faults.add((*place, "height"), reason)
        return None
    return FormulaHeight(formula)


def refusal(formula: Formula, starts: Sequence[Sequence[float]]) -> str:
    """Return the reason why a formula is no height; empty if it is one."""
    others = sorted(formula.names - set(HEIGHT_NAMES))
    if others:
        return f"{', '.join(quote(name) for name in others)}: a height is a formula of x and y alone"
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    height = formula.evaluate({"x": x, "y": y})
    if height.shape[0] != 1:
        return f"must be a number, but is a vector of {height.shape[0]}"
    both = ca.vertcat(x, y)
    slope = ca.gradient(ca.SX(height), both)
    surface = ca.Function("surface", [x, y], [height, slope, ca.jacobian(slope, both)])
    for start in starts:
        for value, what in zip(surface(start[0], start[1]), ("height", "slope", "curvature"), strict=True):
            if not value.is_regular():
                at = f"x = {start[0]:g}, y = {start[1]:g}, where a body starts"
                return f"its {what} is not finite at {at}; a height must be twice differentiable"
    return ""
