"""The [[terrain]] tables: ground of varying height, by a formula of x and y or by heights on a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.expression import Formula, FormulaError, parse
from symphys.model.heightfield import Heightfield
from symphys.model.shapes import Terrain
from symphys.problem.parametric.parts import ParametricStatic
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.physics import TerrainTable
from symphys.problem.tables.bodies import states
from symphys.suggest import quote

NAMES = ("x", "y")
GRID_KEYS = ("spacing", "origin")


@dataclass(frozen=True)
class FormulaHeight:
    """The height [m] that a formula of x and y [m] gives."""

    formula: Formula

    def __call__(self, x: Any, y: Any) -> Any:
        """A casadi scalar; x and y are casadi scalars or numbers."""
        return self.formula.evaluate({"x": x, "y": y})


def flat(x: Any, y: Any) -> Any:
    """What stands in for a terrain that cannot be read."""
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
    return ParametricStatic(Terrain(table.name, height or flat), states(table), table.group)


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
