"""What stands still: the ground, planes, blocks and terrain, by a formula of x and y or by heights on a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Any

import casadi as ca
import numpy as np

from symphys.expression import Formula, FormulaError, parse
from symphys.model.heightfield import Heightfield
from symphys.model.shapes import Fixture, Plane, Sphere, Terrain
from symphys.problem.parametric.parts import ParametricStatic
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema import Document
from symphys.problem.schema.physics import BlockTable, GroundTable, PlaneTable, TerrainTable
from symphys.problem.tables.bodies import states, touching
from symphys.problem.tables.shapes import read_orientation, read_solid, three
from symphys.suggest import quote

NAMES = ("x", "y")
GRID_KEYS = ("spacing", "origin")


def read_statics(document: Document, starts: Sequence[Sequence[float]], faults: Faults) -> tuple[ParametricStatic, ...]:
    """The ground, if there is one, then planes, blocks and terrain; ``starts``: where bodies are at first."""
    ground = () if document.ground is None else (read_ground(document.ground),)
    planes = tuple(read_plane(i, table, faults) for i, table in enumerate(document.plane))
    blocks = tuple(read_block(i, table, faults) for i, table in enumerate(document.block))
    terrain = tuple(read_terrain(i, table, starts, faults) for i, table in enumerate(document.terrain))
    return (*ground, *planes, *blocks, *terrain)


def read_ground(table: GroundTable) -> ParametricStatic:
    """The horizontal plane called ground."""
    return ParametricStatic(Plane.ground(table.height), states(table), table.group, touching(table))


def read_plane(index: int, table: PlaneTable, faults: Faults) -> ParametricStatic:
    """One plane."""
    place = ("plane", index)
    length = hypot(*table.normal)  # squares of large numbers overflow
    if not (isfinite(length) and length > 1e-12):
        faults.add((*place, "normal"), "must not be zero; [0, 0, 1] points up")
        length = 1.0
    normal = np.array(table.normal) / length
    if (table.point is None) == (table.offset is None):
        faults.add((*place, "offset"), "give either a point of the plane or its offset along the normal")
    offset = table.offset if table.point is None else float(normal @ np.array(table.point))
    plane = Plane(table.name, three(normal.tolist()), offset or 0.0)
    return ParametricStatic(plane, states(table), table.group, touching(table))


def read_block(index: int, table: BlockTable, faults: Faults) -> ParametricStatic:
    """One static solid."""
    place = ("block", index)
    orientation = read_orientation((*place, "orientation"), table.orientation, faults)
    shape = read_solid((*place, "shape"), table.shape, table.position, orientation, faults)
    return ParametricStatic(Fixture(table.name, shape or Sphere(1.0)), states(table), table.group, touching(table))


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


def read_terrain(
    index: int, table: TerrainTable, starts: Sequence[Sequence[float]], faults: Faults
) -> ParametricStatic:
    """One terrain; ``starts``: where bodies are at first, so that a formula can be tried there."""
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
    return ParametricStatic(Terrain(table.name, height or flat), states(table), table.group, touching(table))


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
    """Why a formula is no height; empty if it is one."""
    others = sorted(formula.names - set(NAMES))
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
