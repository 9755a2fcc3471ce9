"""Charts of what a solver did and found: convergence, variables, growth of changes, and energy."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from symphys.findings.examination import Energy, Growth
from symphys.findings.numerics import reach
from symphys.findings.writing import capital, show, titled
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel, lines
from symphys.report.charts.convergence import AXIS_TITLES, VIOLATION_FLOOR, WORK
from symphys.report.charts.tables import TIME, Table
from symphys.results.result import StageRecord, VariableRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.trajectory import Trajectory
from symphys.types import Array

COLUMNS = 3
MOST_ROWS = 2000
"""Iterations in the table of a figure, at most about; trace.csv has all."""
MOST_PANELS = 8
"""Variables that are drawn, at most."""
MOST_TOUCHES = 150
"""Beginnings of contacts that are marked, at most: more cannot be told apart."""
GROWTH_RANGE = 100.0
"""The smallest ratio of the ends of the axis of growth, so that little growth looks little."""
COLOURS = (*palette.AXES, palette.PURPLE, palette.ORANGE, palette.SKY)
"""Colours of the components of a variable, in their order."""
WIDTHS = (*palette.AXIS_WIDTHS, 1.4, 1.4, 1.4)
VECTORS = ("position", "velocity", "angular_velocity", "force", "torque", "gravity")
SLOT = re.compile(r"(?P<name>\w+)(\[\s*(?P<first>-?\d+)?\s*:\s*(?P<last>-?\d+)?\s*\])?")
"""A quantity, with a range of components or without."""


def run_charts(run: Run, motion: Trajectory | None) -> list[Chart]:
    """Chart a run; what was not recorded is left out."""
    found = [convergence_chart(run), variables_chart(run)]
    found += [growth_chart(run.examination.growth, motion), energy_chart(run.examination.energy)]
    return [chart for chart in found if chart is not None]


@dataclass(frozen=True)
class HistoryPanel:
    """A recorded column of the iterations.

    Attributes:
        title: of the panel.
        values: (rows,).
        best: (rows,) the lowest so far of its stage; None where that is not drawn.
        exact: what a stage's end is in the exact rollout; None where there is no such thing.
        floor: of errors / tolerance; smaller ones are drawn there. nan where the values are something else.
    """

    title: str
    values: Array
    best: Array | None = None
    exact: Callable[[StageRecord], float] | None = None
    floor: float = math.nan

    @property
    def relative(self) -> bool:
        """Whether the values are errors / tolerance."""
        return not math.isnan(self.floor)

    def drawn(self, values: Array) -> Array:
        """Return values as they are drawn."""
        return np.maximum(values, self.floor) if self.relative else values


def history_panels(run: Run) -> list[HistoryPanel]:
    """Return the columns of which anything was recorded."""
    trace, step = run.trace, "Step size σ" if run.solver.startswith("cma") else "Step"  # noqa: RUF001
    errors = trace["max_violation"]
    every = [
        HistoryPanel("Objective", trace["objective"], stage_best(run), lambda stage: stage.exact_objective),
        HistoryPanel("Largest error / tolerance", errors, None, lambda stage: stage.exact_worst, VIOLATION_FLOOR),
        HistoryPanel("Norm of the gradient", trace["gradient_norm"]),
        HistoryPanel(step, trace["step"]),
        *(HistoryPanel(capital(name), trace[OUTPUT + name]) for name in trace.outputs),
    ]
    return [panel for panel in every if np.isfinite(panel.values).any()]


def stage_best(run: Run) -> Array:
    """Return (rows,) the lowest objective of each stage so far, as the solver recorded it where it did."""
    recorded, objective = run.trace["best"], run.trace["objective"]
    if np.isfinite(recorded).any() or not recorded.size:
        return recorded
    return np.concatenate([np.fmin.accumulate(objective[part]) for part in segments(run)])


def segments(run: Run) -> list[slice]:
    """Split the rows of the trace where the smoothing changes."""
    smoothing = np.nan_to_num(run.trace["smoothing"])
    cuts = [0, *(np.flatnonzero(np.diff(smoothing)) + 1).tolist(), len(smoothing)]
    return [slice(first, last) for first, last in pairwise(cuts) if last > first]


def exact_ends(run: Run, x: Array, of: Callable[[StageRecord], float]) -> list[tuple[float, float, bool]]:
    """Return (x, exact number, whether met) at the end of each stage that is in the trace."""
    ends = {run.trace["smoothing"][part.start]: x[part.stop - 1] for part in segments(run)}
    found = [(ends[s.smoothing], of(s), s.solved) for s in run.stages if s.smoothing in ends]
    return [end for end in found if math.isfinite(end[0]) and math.isfinite(end[1])]


def convergence_chart(run: Run) -> Chart | None:
    """Chart objective, errors, gradient norm, step, reported quantities; None without two iterations."""
    shown = history_panels(run)
    if run.trace.rows < 2 or not shown:
        return None
    column = WORK if np.isfinite(run.trace[WORK]).any() else "iteration"
    x, along = run.trace[column], AXIS_TITLES.get(column, column)
    colour, staged = palette.solver_marks([run.solver])[run.solver][0], smoothed(run.stages)
    columns = 2 if len(shown) == 4 else min(len(shown), COLUMNS)
    stages = stage_bands(run, x) if staged else ()
    silent = tuple((left, right, "") for left, right, _ in stages)
    panels, known = list[Panel](), np.isfinite(x)
    table: dict[str, Any] = {along: x[known], "smoothing [m/s]": run.trace["smoothing"][known]}
    table |= {panel.title: panel.values[known] for panel in shown}
    table |= {f"{panel.title} lowest so far": panel.best[known] for panel in shown if panel.best is not None}
    tables: list[Table] = [table]
    for place, panel in enumerate(shown):
        ends = exact_ends(run, x, panel.exact) if staged and panel.exact else []
        panels.append(history_panel(run, x, along, panel, colour, ends, stages if place < columns else silent))
        if ends:
            at, exact, _ = zip(*ends, strict=True)
            tables.append({f"{along} at the end of a stage": at, f"{panel.title} exact": exact})
    keys = (
        Key("at the stage's own smoothing", colour),
        Key("exact, at its end", palette.INK, "dots"),
        Key("the same, something missed", palette.INK, "rings"),
    )
    return Chart("convergence", "Convergence of this run", tuple(panels), columns, keys if staged else (),
                 tuple(tables), 2.0, points=MOST_ROWS)  # fmt: skip


def history_panel(
    run: Run,
    x: Array,
    along: str,
    panel: HistoryPanel,
    colour: str,
    ends: list[tuple[float, float, bool]],
    stages: tuple[tuple[float, float, str], ...],
) -> Panel:
    """Chart one column against the work, with a gap between stages, and the exact ``ends`` of stages."""
    values, drawn = panel.drawn(panel.values), list[Line]()
    for part in segments(run):
        if panel.best is not None and np.any(panel.best[part] < values[part]):
            drawn += lines(x[part], panel.best[part, None], ["lowest so far"], [colour], width=2.4, look="pale steps")
        drawn += lines(x[part], values[part, None], [panel.title], [colour])
    if ends:
        at, exact, met = (np.array(each) for each in zip(*ends, strict=True))
        exact = panel.drawn(exact)
        drawn.append(Line("", palette.INK, at, exact, 0.8, "dotted"))
        for look, some in (("dots", met), ("rings", ~met)):
            drawn += [Line("exact", palette.INK, at[some], exact[some], look=look)] if some.any() else []
    heights = np.concatenate([values, *(line.y for line in drawn)])
    scale = -1.0 if panel.relative and np.any(heights > 0) else palette.scale_of(heights)
    return Panel(panel.title, tuple(drawn), along, scale, met=panel.relative, stages=stages)


def stage_bands(run: Run, x: Array) -> tuple[tuple[float, float, str], ...]:
    """Return from where to where each stage goes, and its smoothing in words."""
    parts = segments(run)
    edges = [x[0], *(0.5 * (x[part.start - 1] + x[part.start]) for part in parts[1:]), x[-1]]
    smoothing = [run.trace["smoothing"][part.start] for part in parts]
    words = [f"smoothing {show(value)}" if value else "exact" for value in smoothing]
    return tuple((float(left), float(right), text) for (left, right), text in zip(pairwise(edges), words, strict=True))


def variables_chart(run: Run) -> Chart | None:
    """Chart each variable with knots; None without any."""
    shown = knotted(run)[:MOST_PANELS]
    if not shown:
        return None
    tables = [table for variable in shown for table in variable_tables(variable)]
    panels = tuple(map(variable_panel, shown))
    return Chart("variables", "Inputs over time", panels, tables=tuple(tables), height=2.1)


def knotted(run: Run) -> list[VariableRecord]:
    """Return the variables that have several knots."""
    return [variable for variable in run.variables if variable.value.shape[1] > 1]


def component_names(variable: VariableRecord) -> list[str]:
    """Name the components: x, y, z of a vector in space, numbers otherwise, nothing for a scalar."""
    size = variable.value.shape[0]
    if size == 1:
        return [""]
    slot = SLOT.fullmatch(variable.sets[0].rpartition(".")[2]) if variable.sets else None
    if slot and slot["name"] in VECTORS:
        first, last = (int(slot[key]) if slot[key] else None for key in ("first", "last"))
        chosen = "xyz"[first:last]
        if len(chosen) == size:
            return list(chosen)
    return [str(index) for index in range(size)]


def component_labels(variable: VariableRecord) -> list[str]:
    """Name the components with the variable, as ``throw.x``."""
    return [".".join(filter(None, [variable.name, name])) for name in component_names(variable)]


def variable_panel(variable: VariableRecord) -> Panel:
    """Chart the components over time, found and at the guess, and bounds that are near."""
    (along, knots), held = abscissa(variable), variable.held > 0
    if held:  # until its end
        knots = np.append(knots, knots[-1] + variable.held)
    names = [name or variable.name for name in component_names(variable)][: len(COLOURS)]
    guess = [f"{name} at the guess" for name in names]
    found, guessed = (np.pad(each, ((0, 0), (0, held)), "edge") for each in (variable.value, variable.guess))
    drawn = [*lines(knots, guessed.T, guess, COLOURS, width=0.9, look="dashed" + " steps" * held)]
    for name, colour, values, width in zip(names, COLOURS, found, WIDTHS, strict=False):
        drawn.append(Line(name, colour, knots, values, width, "steps" * held))
    title = f"{titled(variable.name, variable.unit)}, {palette.short(', '.join(variable.sets), 60)}; dashed: the guess"
    return Panel(title, tuple(drawn), along, edges=tuple(near_bounds(variable).tolist()))


def abscissa(variable: VariableRecord) -> tuple[str, Array]:
    """Return title and values (knots,) of the axis of a variable: time, or numbers of knots in older files."""
    if variable.time.size == variable.value.shape[1]:
        return TIME, variable.time
    return "knot", np.arange(1, variable.value.shape[1] + 1, dtype=float)


def variable_tables(variable: VariableRecord) -> list[Table]:
    """Return the numbers of ``variable_panel``."""
    table: dict[str, Any] = dict([abscissa(variable)])
    for k, label in enumerate(component_labels(variable)[: len(COLOURS)]):
        table |= {label: variable.value[k], f"{label} at the guess": variable.guess[k]}
    near = near_bounds(variable)
    return [table, {f"bounds of {variable.name}": near}] if near.size else [table]


def near_bounds(variable: VariableRecord) -> Array:
    """Return the bounds that are near the values, each once."""
    shown = finite(np.concatenate([variable.value.ravel(), variable.guess.ravel()]))
    if not shown.size:
        return shown
    room = max(float(np.ptp(shown)), 1e-9)
    bounds = np.unique(finite(np.concatenate([variable.lower.ravel(), variable.upper.ravel()])))
    near: Array = bounds[(bounds >= shown.min() - room) & (bounds <= shown.max() + room)]
    return near


def finite(values: Array) -> Array:
    """Return the values that are finite."""
    return values[np.isfinite(values)]


def growth_chart(growth: Growth, motion: Trajectory | None) -> Chart | None:
    """Chart |dx_T/dx_t| against t, with a tick where a contact begins; None without two numbers."""
    known = np.isfinite(growth.factor) & (growth.factor > 0)
    time, factor = growth.time[known], growth.factor[known]
    if time.size < 2:
        return None
    begins = None if motion is None else touches(motion)
    ticks = () if begins is None or begins.size > MOST_TOUCHES else tuple(begins.tolist())
    low = 10 ** math.floor(math.log10(min(factor.min(), 1.0)))
    least = low, max(float(factor.max()) * 1.5, low * GROWTH_RANGE)
    lost = reach(growth).end
    end = (lost, f"no gradient reaches from the start beyond {show(lost, 2)} s") if math.isfinite(lost) else ()
    title, drawn = "Growth of a change at t until the end", lines(time, factor[:, None], ["growth"], palette.BODIES)
    panel = Panel(title, drawn, TIME, -1.0, edges=(1.0,), least=least, ticks=ticks, end=end)
    tables: list[Table] = [{TIME: time, "growth of a change until the end": factor}]
    tables += [] if begins is None else [{"a contact begins at [s]": begins}]
    return Chart("growth", "Growth of changes until the end", (panel,), tables=tuple(tables), height=1.8)


def touches(motion: Trajectory) -> Array:
    """Return the times [s] at which a contact begins to act."""
    acting = np.any(np.abs(motion.contact_force) > 0, axis=2)
    begins = acting.copy()
    begins[1:] &= ~acting[:-1]
    return np.asarray(motion.time[:-1][begins.any(axis=1)])


def energy_chart(energy: Energy) -> Chart | None:
    """Chart kinetic, potential and total energy against time; None where it was not recorded."""
    time, total = energy.time, energy.kinetic + energy.potential
    if time.size < 2 or not np.isfinite(total).any():
        return None
    drawn = [Line("kinetic", palette.SKY, time, energy.kinetic, 1.2)]
    drawn.append(Line("potential", palette.ORANGE, time, energy.potential, 1.2))
    drawn.append(Line("total", palette.BODIES[0], time, total, 1.8))
    if np.any(energy.applied != 0):
        drawn.append(Line("put in by forces", palette.GREY, time, energy.applied, 1.0))
    keys = tuple(Key(line.name, line.colour) for line in drawn)
    table: Table = {TIME: time} | {f"energy {line.name} [J]": line.y for line in drawn}
    return Chart("energy", "Energy over time", (Panel("Energy [J]", tuple(drawn), TIME),), 1, keys, (table,), 1.8)
