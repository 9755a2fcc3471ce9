"""One run against its work: what the solver recorded at each iteration, stage by stage."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.findings.writing import show
from symphys.report.figures import style
from symphys.report.figures.convergence import AXIS_TITLES, VIOLATION_FLOOR, WORK, fit_values, mark_tolerance
from symphys.report.figures.data import DataFigure, keep
from symphys.results.result import StageRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.types import Array

NARROWEST = 0.09
"""A stage that takes less of the axis has no room for its name."""
MOST_ROWS = 2000
"""Iterations in the figure's table, at most about; trace.csv has all."""
HEADROOM = 0.16
"""Above and below the curves where names of stages stand over them, as a share of the axis."""


@dataclass(frozen=True)
class HistoryPanel:
    """One recorded column.

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


def draw_run(run: Run) -> DataFigure | None:
    """Objective, errors, gradient norm, step, reported quantities; what was not recorded is left out."""
    x, along = work_of(run)
    shown = shown_panels(run)
    if run.trace.rows < 2 or not shown:
        return None
    columns = 2 if len(shown) == 4 else min(len(shown), 3)
    rows = math.ceil(len(shown) / columns)
    figure = DataFigure(figsize=(style.WIDTH, 0.6 + 0.25 * smoothed(run.stages) + 2.0 * rows), layout="constrained")
    grid = list(figure.subplots(rows, columns, sharex=True, squeeze=False).flat)
    colour = style.solver_marks([run.solver])[run.solver][0]
    label = AXIS_TITLES.get(along, along)
    for place, (axes, panel) in enumerate(zip(grid, shown, strict=False)):
        draw_panel(axes, run, x, panel, colour, named=place < columns)
    keep_history(grid[0], run, label, x, shown)
    for axes in grid[len(shown) :]:
        axes.remove()
    for axes in grid[max(len(shown) - columns, 0) : len(shown)]:
        axes.set_xlabel(label)
        axes.tick_params(labelbottom=True)
    if smoothed(run.stages):
        style.legend_above(figure, *legend(colour))
    return figure


def work_of(run: Run) -> tuple[Array, str]:
    """(rows,) what the history is drawn over, and the name of its column."""
    along = WORK if np.isfinite(run.trace[WORK]).any() else "iteration"
    return run.trace[along], along


def shown_panels(run: Run) -> list[HistoryPanel]:
    """Those of which anything was recorded."""
    return [panel for panel in panels_of(run) if np.isfinite(panel.values).any()]


def panels_of(run: Run) -> list[HistoryPanel]:
    """All that may be drawn."""
    trace = run.trace
    return [
        HistoryPanel("Objective", trace["objective"], stage_best(run), lambda stage: stage.exact_objective),
        HistoryPanel(
            "Largest error / tolerance",
            trace["max_violation"],
            exact=lambda stage: stage.exact_worst,
            floor=VIOLATION_FLOOR,
        ),
        HistoryPanel("Norm of the gradient", trace["gradient_norm"]),
        HistoryPanel("Step" if not run.solver.startswith("cma") else "Step size σ", trace["step"]),  # noqa: RUF001
        *(HistoryPanel(name[:1].upper() + name[1:], trace[OUTPUT + name]) for name in trace.outputs),
    ]


def stage_best(run: Run) -> Array:
    """(rows,): the lowest objective of each stage so far, as the solver recorded it where it did."""
    recorded, objective = run.trace["best"], run.trace["objective"]
    if np.isfinite(recorded).any() or not recorded.size:
        return recorded
    return np.concatenate([np.fmin.accumulate(objective[part]) for part in segments(run)])


def draw_panel(axes: Axes, run: Run, x: Array, panel: HistoryPanel, colour: str, named: bool) -> None:
    """One column against the work; of a run in stages with their bands and exact ends."""
    values = np.maximum(panel.values, panel.floor) if panel.relative else panel.values
    for part in segments(run):
        draw_history(axes, x[part], values[part], None if panel.best is None else panel.best[part], colour)
    found = exact_ends(run, x, panel.exact) if smoothed(run.stages) and panel.exact else []
    ends = [(at, max(exact, panel.floor) if panel.relative else exact, met) for at, exact, met in found]
    fit_values(axes, np.append(values, [y for _, y, _ in ends]), panel.relative)
    axes.set_title(panel.title)
    if named and smoothed(run.stages):
        axes.margins(y=HEADROOM)
    if panel.relative:
        mark_tolerance([axes])
    if smoothed(run.stages):
        draw_bands(axes, run, x, named)
        draw_exact(axes, ends)


def keep_history(axes: Axes, run: Run, label: str, x: Array, shown: Sequence[HistoryPanel]) -> None:
    """The recorded columns, thinned, and the exact ends of stages."""
    columns = {"smoothing [m/s]": run.trace["smoothing"]} | {panel.title: panel.values for panel in shown}
    columns |= {f"{panel.title} lowest so far": panel.best for panel in shown if panel.best is not None}
    known = np.isfinite(x)
    work, values = style.thin(x[known], np.stack(list(columns.values()), axis=1)[known], MOST_ROWS)
    keep(axes, {label: work} | dict(zip(columns, values.T, strict=True)))
    for panel in shown:
        ends = exact_ends(run, x, panel.exact) if smoothed(run.stages) and panel.exact else []
        if ends:
            at, exact, _ = zip(*ends, strict=True)
            keep(axes, {f"{label} at the end of a stage": at, f"{panel.title} exact": exact})


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


def segments(run: Run) -> list[slice]:
    """The rows of the trace, split where the smoothing changes."""
    smoothing = np.nan_to_num(run.trace["smoothing"])
    cuts = [0, *(np.flatnonzero(np.diff(smoothing)) + 1).tolist(), len(smoothing)]
    return [slice(first, last) for first, last in pairwise(cuts) if last > first]


def draw_bands(axes: Axes, run: Run, x: Array, named: bool) -> None:
    """A pale band behind every other stage; ``named`` writes the smoothing on those that have room."""
    parts = segments(run)
    edges = [x[0], *(0.5 * (x[part.start - 1] + x[part.start]) for part in parts[1:]), x[-1]]
    for index, (part, left, right) in enumerate(zip(parts, edges, edges[1:], strict=False)):
        if index % 2:
            axes.axvspan(left, right, color=style.GROUND, linewidth=0, alpha=0.7, zorder=0.2)
        if index:
            axes.axvline(left, color=style.FAINT, linewidth=0.8, zorder=0.4)
        if named and right - left >= NARROWEST * (x[-1] - x[0]):
            value = run.trace["smoothing"][part.start]
            axes.annotate(
                f"smoothing {show(value)}" if value else "exact",
                (0.5 * (left + right), 1),
                xycoords=("data", "axes fraction"),
                xytext=(0, -3),
                textcoords="offset points",
                ha="center",
                va="top",
                color=style.SOFT,
                fontsize=7.5,
            )


def exact_ends(run: Run, x: Array, of: Callable[[StageRecord], float]) -> list[tuple[float, float, bool]]:
    """(x, exact number, whether met) at the end of each stage that is in the trace."""
    ends = {run.trace["smoothing"][part.start]: x[part.stop - 1] for part in segments(run)}
    found = [(ends[s.smoothing], of(s), s.solved) for s in run.stages if s.smoothing in ends]
    return [end for end in found if math.isfinite(end[0]) and math.isfinite(end[1])]


def draw_exact(axes: Axes, ends: Sequence[tuple[float, float, bool]]) -> None:
    """A diamond at the exact number of each stage's end, hollow where it misses something."""
    axes.plot([x for x, _, _ in ends], [y for _, y, _ in ends], color=style.INK, linewidth=0.8, linestyle=(0, (1, 2)))
    for x, y, met in ends:
        face = style.INK if met else "white"
        axes.plot(x, y, "D", color=style.INK, markerfacecolor=face, markersize=5.5, zorder=4, clip_on=False)


def legend(colour: str) -> tuple[list[Line2D], list[str]]:
    """Handles and labels of a run's figure."""
    own = Line2D([], [], color=colour, linewidth=1.4)
    ends = [Line2D([], [], color=style.INK, marker="D", markersize=5.5, linestyle="none", markerfacecolor=face)
            for face in (style.INK, "white")]  # fmt: skip
    return [own, *ends], ["at the stage's own smoothing", "exact, at its end", "the same, something missed"]
