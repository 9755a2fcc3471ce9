"""Targets, constraints and goals by name: the error of every solver against the tolerance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import Column, DataFigure, keep
from symphys.results.discovery import Study, sample
from symphys.types import Array

MOST_CHECKS = 16
MOST_DOTS = 200
"""Seeds of a solver that are drawn as dots, at most."""
LOWEST, HIGHEST = 1e-3, 1e4
"""Ratios are drawn between these at most; beyond them stands an arrow."""

Ratios = dict[str, dict[str, Array]]


def ratios(study: Study) -> Ratios:
    """Error / tolerance by check and solver, one per seed; nan counts as inf."""
    found: dict[str, dict[str, list[float]]] = {}
    for run in study.runs:
        for check in run.checks:
            ratio = np.inf if np.isnan(check.ratio) else check.ratio
            found.setdefault(check.name, {}).setdefault(run.solver, []).append(ratio)
    return {name: {key: np.array(seeds) for key, seeds in solvers.items()} for name, solvers in found.items()}


def shown_checks(found: Ratios) -> list[str]:
    """The checks that get a row: all, or those with the largest medians, in the file's order."""
    worst = {name: max(float(np.median(seeds)) for seeds in solvers.values()) for name, solvers in found.items()}
    kept = set(sorted(worst, key=lambda name: -worst[name])[:MOST_CHECKS])
    return [name for name in found if name in kept]


def draw_checks(study: Study) -> DataFigure | None:
    """A row for each check, a lane for each solver: small dots for seeds, a mark for their median, a line at 1."""
    found = ratios(study)
    if not found:
        return None
    names = shown_checks(found)
    marks = style.solver_marks(entry.solver for entry in study.entries)
    lane = 0.15
    row = max(lane * len(marks) + 0.16, 0.36)
    figure = DataFigure(figsize=(style.WIDTH, 1.15 + row * len(names)), layout="constrained")
    axes = figure.subplots()
    low, high = limits(found)
    dress(axes, names, low, high)
    for place, name in enumerate(names):
        for order, solver in enumerate(marks):
            if solver in found[name]:
                height = place + (order - (len(marks) - 1) / 2) * lane / row
                draw_lane(axes, height, np.clip(found[name][solver], low, high), marks[solver], (low, high))
    keep_ratios(axes, sample(study, MOST_DOTS), names)
    handles = [Line2D([], [], color=c, marker=m, linestyle="none", markersize=6) for c, m in marks.values()]
    style.legend_above(figure, handles, [style.short(name, 20) for name in marks])
    return figure


def keep_ratios(axes: Axes, study: Study, names: list[str]) -> None:
    """Every run's errors in these checks."""
    rows = [(name, run, check) for name in names for run in study.runs for check in run.checks if check.name == name]
    columns: dict[str, Column] = {
        "check": [name for name, _, _ in rows],
        "solver": [run.solver for _, run, _ in rows],
        "seed": [run.seed for _, run, _ in rows],
        "error": [check.error for _, _, check in rows],
        "tolerance": [check.tolerance for _, _, check in rows],
        "error / tolerance": [check.ratio for _, _, check in rows],
    }
    keep(axes, columns)


def limits(found: Ratios) -> tuple[float, float]:
    """The range of the axis: whole decades around the ratios and 1."""
    every = np.concatenate([seeds for solvers in found.values() for seeds in solvers.values()])
    positive = every[np.isfinite(every) & (every > 0)]
    low = 10 ** np.floor(np.log10(min(positive.min(initial=1.0), 0.3)))
    high = 10 ** np.ceil(np.log10(max(positive.max(initial=1.0), 3.0)))
    return float(np.clip(low, LOWEST, 0.1)), float(np.clip(high, 10.0, HIGHEST))


def dress(axes: Axes, names: list[str], low: float, high: float) -> None:
    """Named rows, the logarithmic axis, the tolerance at 1."""
    axes.set_yticks(range(len(names)), [style.short(name, 46) for name in names])
    axes.tick_params(axis="y", labelcolor=style.INK, labelsize=8.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    for border in range(1, len(names)):
        axes.axhline(border - 0.5, color=style.GRID, linewidth=0.7)
    style.set_log(axes, "x", np.array([low, high]))
    axes.set_xlim(low / 1.3, high * 1.3)
    axes.axvspan(low / 1.3, 1, color=style.MET, linewidth=0, zorder=0.5)
    axes.axvline(1, color=style.GREEN, linewidth=1, linestyle=(0, (4, 2)), zorder=1)
    axes.set_xlabel("error / tolerance (met at 1 or below)")


def draw_lane(axes: Axes, height: float, seeds: Array, mark: tuple[str, str], ends: tuple[float, float]) -> None:
    """The seeds of one solver in one check."""
    colour, marker = mark
    middle = float(np.median(seeds))
    if seeds.size > 1:
        axes.plot([seeds.min(), seeds.max()], [height, height], color=colour, linewidth=0.8, alpha=0.4, zorder=2)
        dots = seeds[np.linspace(0, seeds.size - 1, min(seeds.size, MOST_DOTS)).round().astype(int)]
        axes.plot(dots, np.full(dots.size, height), "o", color=colour, markersize=3, alpha=0.35, zorder=2.5)
    face = colour if middle <= 1 else "white"
    beyond = {ends[0]: "<", ends[1]: ">"}
    axes.plot(middle, height, beyond.get(middle, marker), color=colour, markerfacecolor=face, markersize=6, zorder=3)
