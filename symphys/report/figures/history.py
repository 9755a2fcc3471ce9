"""One run against its work: what the solver recorded at each iteration, stage by stage."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symphys.report.figures import style
from symphys.report.figures.convergence import AXIS_TITLES, MISS_FLOOR, WORK, fit_values, mark_tolerance
from symphys.report.pages import stages
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.trajectory import Array

HEADROOM = 0.16
"""Above and below the curves where names of stages stand over them, as a share of the axis."""


@dataclass(frozen=True)
class Panel:
    """One recorded column.

    Attributes:
        title: of the panel.
        values: (rows,).
        best: (rows,) the lowest so far of its stage; None where that is not drawn.
        exact: what a stage's end is in the exact rollout; None where there is no such thing.
        relative: whether the values are errors / tolerance.
    """

    title: str
    values: Array
    best: Array | None = None
    exact: Callable[[StageRecord], float] | None = None
    relative: bool = False


def draw_run(run: Run) -> Figure | None:
    """Objective, errors, gradient norm, step, what is told; what was not recorded is left out."""
    x = run.trace[WORK]
    x = x if np.isfinite(x).any() else run.trace["iteration"]
    shown = [panel for panel in panels_of(run) if np.isfinite(panel.values).any()]
    if run.trace.rows < 2 or not shown:
        return None
    columns = 2 if len(shown) == 4 else min(len(shown), 3)
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(style.WIDTH, 0.6 + 0.25 * smoothed(run.stages) + 2.0 * rows), layout="constrained")
    grid = list(figure.subplots(rows, columns, sharex=True, squeeze=False).flat)
    colour = style.solver_marks([run.solver])[run.solver][0]
    for place, (axes, panel) in enumerate(zip(grid, shown, strict=False)):
        draw_panel(axes, run, x, panel, colour, named=place < columns)
    label = AXIS_TITLES[WORK] if np.isfinite(run.trace[WORK]).any() else "iteration"
    for axes in grid[len(shown) :]:
        axes.remove()
    for axes in grid[max(len(shown) - columns, 0) : len(shown)]:
        axes.set_xlabel(label)
        axes.tick_params(labelbottom=True)
    if smoothed(run.stages):
        style.legend_above(figure, *stages.legend(colour))
    return figure


def panels_of(run: Run) -> list[Panel]:
    """All that may be drawn."""
    trace = run.trace
    return [
        Panel("Objective", trace["objective"], stage_best(run), lambda stage: stage.exact_objective),
        Panel(
            "Largest error / tolerance",
            np.maximum(trace["max_violation"], MISS_FLOOR),
            exact=lambda stage: max(stage.exact_worst, MISS_FLOOR),
            relative=True,
        ),
        Panel("Norm of the gradient", trace["gradient_norm"]),
        Panel("Step" if not run.solver.startswith("cma") else "Step size σ", trace["step"]),  # noqa: RUF001
        *(Panel(name[:1].upper() + name[1:], trace[OUTPUT + name]) for name in trace.outputs),
    ]


def stage_best(run: Run) -> Array:
    """(rows,): the lowest objective of each stage so far, as the solver recorded it where it did."""
    recorded, objective = run.trace["best"], run.trace["objective"]
    if np.isfinite(recorded).any() or not recorded.size:
        return recorded
    return np.concatenate([np.fmin.accumulate(objective[part]) for part in stages.segments(run)])


def draw_panel(axes: Axes, run: Run, x: Array, panel: Panel, colour: str, named: bool) -> None:
    """One column against the work; of a run in stages with their bands and exact ends."""
    for part in stages.segments(run):
        draw_history(axes, x[part], panel.values[part], None if panel.best is None else panel.best[part], colour)
    ends = stages.exact_ends(run, x, panel.exact) if smoothed(run.stages) and panel.exact else []
    fit_values(axes, np.append(panel.values, [y for _, y, _ in ends]), panel.relative)
    axes.set_title(panel.title)
    if named and smoothed(run.stages):
        axes.margins(y=HEADROOM)
    if panel.relative:
        mark_tolerance([axes])
    if smoothed(run.stages):
        stages.draw_bands(axes, run, x, named)
        stages.draw_exact(axes, ends)


def draw_history(axes: Axes, x: Array, values: Array, best: Array | None, colour: str) -> None:
    """A recorded column, and the lowest so far behind it where that differs."""
    known = np.isfinite(x) & np.isfinite(values)
    if best is not None and np.any(best[known] < values[known]):
        axes.plot(x[known], best[known], drawstyle="steps-post", color=colour, linewidth=2.4, alpha=0.25)
    times, shown = style.thin(x[known], values[known][:, None], 500)
    few = len(times) <= 40
    axes.plot(times, shown[:, 0], color=colour, linewidth=1.4, marker="o" if few else "", markersize=3)
    style.set_linear(axes, "x")
    axes.margins(x=0.02)
