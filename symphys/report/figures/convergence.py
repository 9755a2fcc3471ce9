"""Convergence of solvers: objective and errors against work and time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.findings.writing import capital
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure, keep, thin
from symphys.results.discovery import Study
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.types import Array

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
    """The median of step functions from where all have begun; a curve that has ended keeps its last value."""
    if len(curves) == 1:
        return curves[0]
    grid = np.unique(np.concatenate([c.x for c in curves]))
    grid = grid[grid >= max(c.x[0] for c in curves)]
    if grid.size > GRID:
        grid = grid[np.linspace(0, grid.size - 1, GRID).round().astype(int)]
    values = [c.y[np.searchsorted(c.x, grid, side="right") - 1] for c in curves]
    return Curve(grid, np.median(values, axis=0))


WORK, SECONDS = "equivalents", "seconds"
AXIS_TITLES = {WORK: "work [rollout equivalents]", SECONDS: "time of the solve [s]"}
VIOLATION_FLOOR = 1e-3
"""Errors below this share of the tolerance are drawn as this: nothing is gained below it."""


def draw_convergence(study: Study) -> DataFigure | None:
    """Draw all solvers together: objective, errors and reported quantities against rollout equivalents and time."""
    outputs = dict.fromkeys(name for run in study.runs for name in run.outputs)
    asked = [
        *QUANTITIES,
        *((f"{capital(name)}, of the best so far", best_output(name)) for name in outputs),
    ]
    rows = [quantity for quantity in asked if any(curve(run, WORK, quantity[1]) for run in study.runs)]
    columns = [x for x in (WORK, SECONDS) if any(np.isfinite(run.trace[x]).any() for run in study.runs)]
    if not rows or not columns:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.9 + 2.45 * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), len(columns), sharex="col", sharey="row", squeeze=False)
    for row, (title, quantity) in enumerate(rows):
        for column, along in enumerate(columns):
            draw_panel(grid[row, column], study, along, quantity)
            grid[row, column].set_xlabel(AXIS_TITLES[along] if row == len(rows) - 1 else "")
        grid[row, 0].set_title(title)
        if quantity is violation_so_far:
            mark_tolerance(list(grid[row]))
    keep_runs(grid[0, 0], study, columns, rows)
    for row, column in itertools.product(rows, columns):
        keep_medians(grid[0, 0], study, column, row)
    add_legend(figure, study)
    return figure


def keep_runs(axes: Axes, study: Study, columns: Sequence[str], rows: Sequence[tuple[str, Quantity]]) -> None:
    """Keep the quantities of every run at its iterations, thinned."""
    names = [*(AXIS_TITLES[along] for along in columns), *(title for title, _ in rows)]
    found: list[tuple[list[str], list[int], Array]] = []
    for run in study.runs:
        numbers = [*(run.trace[along] for along in columns), *(quantity(run) for _, quantity in rows)]
        _, thinned = thin(np.arange(float(run.trace.rows)), np.stack(numbers, axis=1), MOST_POINTS)
        found.append(([run.solver] * len(thinned), [run.seed] * len(thinned), thinned))
    numbers_of_all = np.concatenate([numbers for _, _, numbers in found])
    words = {"solver": [name for names, _, _ in found for name in names]}
    seeds = {"seed": [seed for _, seeds, _ in found for seed in seeds]}
    keep(axes, words | seeds | dict(zip(names, numbers_of_all.T, strict=True)))


def keep_medians(axes: Axes, study: Study, along: str, row: tuple[str, Quantity]) -> None:
    """The median over the seeds of each solver that has several."""
    title, quantity = row
    for entry in study.entries:
        curves = [found for run in entry.runs if (found := curve(run, along, quantity)) is not None]
        if len(curves) > 1:
            middle = median_curve(curves)
            name = f"median of {entry.solver}"
            keep(axes, {f"{AXIS_TITLES[along]} {name}": middle.x, f"{title} {name}": middle.y})


def draw_panel(axes: Axes, study: Study, along: str, quantity: Quantity) -> None:
    """Thin lines for seeds, a strong one for their median, a mark at each end."""
    marks = style.solver_marks(entry.solver for entry in study.entries)
    floor = VIOLATION_FLOOR if quantity is violation_so_far else -np.inf
    seen_x, seen_y = [], []
    for entry in study.entries:
        colour, marker = marks[entry.solver]
        pairs = [(run, curve(run, along, quantity)) for run in entry.runs]
        curves = [raise_to(c, floor) for _, c in pairs if c is not None]
        if not curves:
            continue
        if len(curves) > 1:
            for single in curves:
                draw_steps(axes, single, color=colour, linewidth=0.7, alpha=0.35)
        middle = median_curve(curves)
        draw_steps(axes, middle, color=colour, linewidth=1.9, zorder=3)
        met = entry.solved * 2 > len(entry.runs)
        face = colour if met else "white"
        axes.plot(middle.x[-1], middle.y[-1], marker, color=colour, markerfacecolor=face, markersize=6, zorder=4)
        seen_x += [c.x for c in curves]
        seen_y += [c.y for c in curves]
    if seen_x:
        scale_panel(axes, np.concatenate(seen_x), np.concatenate(seen_y), quantity is violation_so_far)


def raise_to(source: Curve, floor: float) -> Curve:
    """The curve with all that lies below ``floor`` drawn at it."""
    return Curve(source.x, np.maximum(source.y, floor))


def scale_panel(axes: Axes, x: Array, y: Array, relative: bool) -> None:
    """Logarithmic work and relative errors; an objective on the scale that fits it."""
    fit_values(axes, y, relative)
    positive = x[x > 0]
    if positive.size:
        style.set_log(axes, "x", positive)
        axes.set_xlim(left=float(positive.min()) * 0.8)


def fit_values(axes: Axes, values: Array, relative: bool) -> None:
    """Logarithmic for errors relative to a tolerance, whatever fits for other values."""
    positive = values[np.isfinite(values) & (values > 0)]
    if relative and positive.size:
        style.set_log(axes, "y", np.append(positive, 1.0))
    else:
        style.fit_scale(axes, "y", values)


def draw_steps(axes: Axes, source: Curve, **look: object) -> None:
    """A step function, thinned; x = 0 is drawn just left of the first positive x."""
    x, y = thin(source.x, source.y[:, None], MOST_POINTS)
    positive = x[x > 0]
    first = float(positive.min()) * 0.8 if positive.size else 1.0
    axes.plot(np.where(x > 0, x, first), y[:, 0], drawstyle="steps-post", **look)  # type: ignore[arg-type]


def mark_tolerance(panels: Sequence[Axes]) -> None:
    """The line at 1, and the region where everything is met."""
    low, high = panels[0].get_ylim()
    for axes in panels:
        axes.axhspan(min(low, 0.5), 1, color=style.MET, linewidth=0, zorder=0.5)
        axes.axhline(1, color=style.GREEN, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
        axes.set_ylim(min(low, 0.5), max(high, 2))
    panels[0].annotate(
        "met below",
        (0, 1),
        xycoords=("axes fraction", "data"),
        xytext=(5, -3),
        textcoords="offset points",
        ha="left",
        va="top",
        color="#00775a",
        fontsize=8,
    )


def add_legend(figure: DataFigure, study: Study) -> None:
    """Explain solvers by colour and mark, and what a hollow mark means."""
    marks = style.solver_marks(entry.solver for entry in study.entries)
    handles = [Line2D([], [], color=c, marker=m, markersize=6, linewidth=1.9) for c, m in marks.values()]
    labels = [style.short(name, 20) for name in marks]
    if any(entry.solved * 2 <= len(entry.runs) for entry in study.entries):
        handles.append(Line2D([], [], color=style.GREY, marker="o", markerfacecolor="white", linestyle="none"))
        labels.append("hollow: ended unsolved")
    if any(len(entry.runs) > 1 for entry in study.entries):
        handles.append(Line2D([], [], color=style.GREY, linewidth=0.7, alpha=0.6))
        labels.append("thin: single seeds")
    style.legend_above(figure, handles, labels)
