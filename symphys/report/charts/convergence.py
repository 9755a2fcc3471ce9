"""Chart of the convergence of solvers: objective and errors against work and time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from symphys.findings.writing import capital
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.tables import Table, thin
from symphys.results.discovery import Study
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.types import Array

WORK, SECONDS = "equivalents", "seconds"
AXIS_TITLES = {WORK: "work [rollouts]", SECONDS: "time of the solve [s]"}
VIOLATION_FLOOR = 1e-3
"""Errors below this share of the tolerance are drawn as this: nothing is gained below it."""
GRID = 300
MOST_POINTS = 400
"""Iterations of a run that are drawn, at most about."""


@dataclass(frozen=True)
class Curve:
    """A quantity as a step function: ``y[i]`` holds from ``x[i]`` on."""

    x: Array
    y: Array


def best_so_far(run: Run) -> Array:
    """Return (rows,) the lowest objective up to each iteration, as the solver recorded it where it did."""
    recorded = run.trace["best"]
    known = recorded if np.isfinite(recorded).any() else run.trace["objective"]
    return falling(run, known, "objective", lambda stage: stage.exact_objective)


def violation_so_far(run: Run) -> Array:
    """Return (rows,) the smallest largest error / tolerance up to each iteration."""
    return falling(run, run.trace["max_violation"], "worst", lambda stage: stage.exact_worst)


def best_output(name: str) -> Quantity:
    """Return a function of a run: (rows,) a reported quantity of the best point so far."""
    return lambda run: np.where(run.trace["smoothing"] > 0, np.nan, run.trace[OUTPUT + name])


Quantity = Callable[[Run], Array]
QUANTITIES: tuple[tuple[str, Quantity], ...] = (
    ("Lowest objective so far", best_so_far),
    ("Largest error / tolerance, smallest so far", violation_so_far),
)


def falling(run: Run, recorded: Array, name: str, exact: Callable[[StageRecord], float]) -> Array:
    """Return (rows,) the lowest value that is known to hold exactly.

    A row of a stage with smoothing belongs to another problem: of such a stage only its start and its end count,
    judged exactly. ``name``: the quantity among those of the guess; ``exact``: that of a stage.
    """
    smoothing = run.trace["smoothing"]
    known = np.where(smoothing > 0, np.nan, recorded)
    if smoothed(run.stages) and known.size:
        known[0] = run.guess.get(name, np.nan)
    for stage in run.stages:
        rows = np.flatnonzero(smoothing == stage.smoothing)
        if stage.smoothing > 0 and rows.size:
            known[rows[-1]] = exact(stage)
    return np.fmin.accumulate(known) if known.size else known


def curve(run: Run, along: str, quantity: Quantity) -> Curve | None:
    """Return a run's curve; None if nothing of it is finite."""
    x, y = run.trace[along], quantity(run)
    known = np.isfinite(x) & np.isfinite(y)
    return Curve(x[known], y[known]) if known.any() else None


def median_curve(curves: Sequence[Curve]) -> Curve:
    """Return the median of step functions from where all have begun; a curve that has ended keeps its last value."""
    if len(curves) == 1:
        return curves[0]
    grid = np.unique(np.concatenate([c.x for c in curves]))
    grid = grid[grid >= max(c.x[0] for c in curves)]
    if grid.size > GRID:
        grid = grid[np.linspace(0, grid.size - 1, GRID).round().astype(int)]
    values = [c.y[np.searchsorted(c.x, grid, side="right") - 1] for c in curves]
    return Curve(grid, np.median(values, axis=0))


def convergence_chart(name: str, study: Study) -> Chart | None:
    """Chart all solvers together: objective, errors and reported quantities against rollout equivalents and time."""
    outputs = dict.fromkeys(output for run in study.runs for output in run.outputs)
    asked = [*QUANTITIES, *((f"{capital(each)}, of the best so far", best_output(each)) for each in outputs)]
    rows = [quantity for quantity in asked if any(curve(run, WORK, quantity[1]) for run in study.runs)]
    columns = [x for x in (WORK, SECONDS) if any(np.isfinite(run.trace[x]).any() for run in study.runs)]
    if not rows or not columns:
        return None
    panels = tuple(quantity_panel(study, along, *row) for row in rows for along in columns)
    medians = [table for row in rows for along in columns for table in median_tables(study, along, *row)]
    marks = palette.solver_marks(entry.solver for entry in study.entries)
    keys = [Key(palette.short(solver, 20), colour, "", mark) for solver, (colour, mark) in marks.items()]
    if any(entry.solved * 2 <= len(entry.runs) for entry in study.entries):
        keys.append(Key("hollow: ended unsolved", palette.GREY, "rings", "o"))
    if any(len(entry.runs) > 1 for entry in study.entries):
        keys.append(Key("thin: single seeds", palette.GREY, "thin"))
    tables = (run_table(study, columns, rows), *medians)
    return Chart(name, "Objective and errors", panels, len(columns), tuple(keys), tables, 2.45, points=MOST_POINTS)


def quantity_panel(study: Study, along: str, title: str, quantity: Quantity) -> Panel:
    """Chart a quantity: thin lines for seeds, a strong one for their median, a mark at each end."""
    marks = palette.solver_marks(entry.solver for entry in study.entries)
    relative, drawn, ends = quantity is violation_so_far, list[Line](), list[Line]()
    floor = VIOLATION_FLOOR if relative else -np.inf
    for entry in study.entries:
        colour, mark = marks[entry.solver]
        curves = [found for run in entry.runs if (found := curve(run, along, quantity)) is not None]
        curves = [Curve(each.x, np.maximum(each.y, floor)) for each in curves]
        if not curves:
            continue
        if len(curves) > 1:
            drawn += [Line("", colour, after_zero(each.x), each.y, 0.7, "steps pale") for each in curves]
        middle = median_curve(curves)
        places = after_zero(middle.x)
        drawn.append(Line(entry.solver, colour, places, middle.y, 1.9, "steps"))
        look = "dots" if entry.solved * 2 > len(entry.runs) else "rings"
        ends.append(Line("", colour, places[-1:], middle.y[-1:], look=look, mark=mark))
    heights = np.concatenate([np.zeros(0), *(line.y for line in drawn)])
    scale = -1.0 if relative and np.any(heights > 0) else palette.scale_of(heights)
    return Panel(title, (*drawn, *ends), AXIS_TITLES[along], scale, across=-1.0, met=relative)


def after_zero(x: Array) -> Array:
    """Return the places of a curve on a logarithmic axis: 0 just left of the first positive one."""
    positive = x[x > 0]
    return np.where(x > 0, x, float(positive.min()) * 0.8 if positive.size else 1.0)


def run_table(study: Study, columns: Sequence[str], rows: Sequence[tuple[str, Quantity]]) -> Table:
    """Return the quantities of every run at its iterations, thinned."""
    found: dict[str, Any] = {"solver": [], "seed": []}
    found |= {name: [] for name in [*(AXIS_TITLES[along] for along in columns), *(title for title, _ in rows)]}
    for run in study.runs:
        numbers = [*(run.trace[along] for along in columns), *(quantity(run) for _, quantity in rows)]
        _, thinned = thin(np.arange(float(run.trace.rows)), np.stack(numbers, axis=1), MOST_POINTS)
        named = [run.solver] * len(thinned), [run.seed] * len(thinned)
        for column, values in zip(found.values(), (*named, *thinned.T), strict=True):
            column += list(values)
    return found


def median_tables(study: Study, along: str, title: str, quantity: Quantity) -> list[Table]:
    """Return the median over the seeds of each solver that has several."""
    tables: list[Table] = []
    for entry in study.entries:
        curves = [found for run in entry.runs if (found := curve(run, along, quantity)) is not None]
        if len(curves) > 1:
            middle, name = median_curve(curves), f"median of {entry.solver}"
            tables.append({f"{AXIS_TITLES[along]} {name}": middle.x, f"{title} {name}": middle.y})
    return tables
