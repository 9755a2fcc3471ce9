"""Figures of a closed loop: plans against what happened, commands, latencies."""

from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.results.closed_loop import ClosedLoopRecord
from symphys.types import Array

MOST_PANELS = 6
BINS = 60
MILLI = 1e3


def draw_plans(record: ClosedLoopRecord) -> DataFigure | None:
    """What some plans predicted, as fans, and what happened; the quantities that move most."""
    shown = _most(record.actual)
    if not shown or not len(record.plan_time):
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.7 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, column in zip(grid, shown, strict=True):
        name = record.value_names[column]
        for k, (time, value) in enumerate(zip(record.plan_time, record.plan_value[:, :, column], strict=True)):
            axes.plot(time, value, color=style.VERMILION, linewidth=0.9, alpha=0.7)
            axes.plot(time[0], value[0], "o", color=style.VERMILION, markersize=3)
            keep(axes, {f"plan {k + 1} {TIME}": time, f"plan {k + 1} {name}": value})
        time, value = style.thin(record.actual_time, record.actual[:, [column]])
        axes.plot(time, value[:, 0], color=style.INK, linewidth=1.8, zorder=3)
        keep(axes, {TIME: time, name: value[:, 0]})
        axes.set_title(name)
        style.set_linear(axes, "y")
    style.set_linear(grid[-1], "x", 8)
    grid[-1].set_xlabel(TIME)
    handles = [Line2D([], [], color=style.INK, linewidth=1.8), Line2D([], [], color=style.VERMILION, linewidth=0.9)]
    style.legend_above(figure, handles, ["what happened", "plans, from where they began"])
    return figure


def draw_commands(record: ClosedLoopRecord) -> DataFigure | None:
    """What acted on the plant over time."""
    shown = _most(record.command)
    if not shown:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.5 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, column in zip(grid, shown, strict=True):
        name = record.command_names[column]
        time, value = style.thin(record.command_time, record.command[:, [column]])
        axes.plot(time, value[:, 0], color=style.BLUE, linewidth=1.2, drawstyle="steps-post")
        keep(axes, {TIME: time, name: value[:, 0]})
        axes.set_title(name)
        style.set_linear(axes, "y")
    style.set_linear(grid[-1], "x", 8)
    grid[-1].set_xlabel(TIME)
    return figure


def draw_latencies(record: ClosedLoopRecord) -> DataFigure | None:
    """How long plans took: a histogram of wall time with the period of a tick, and over time."""
    if not len(record.latency):
        return None
    figure = DataFigure(figsize=(style.WIDTH, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    wall, work, period = (MILLI * each for each in (record.latency, record.work, np.array(1 / record.rate)))
    edges = _edges(np.concatenate([wall, work, [float(period)]]))
    for numbers, colour, name in ((wall, style.BLUE, "wall time"), (work, style.ORANGE, "processor time")):
        counts, _ = np.histogram(numbers, edges)
        left.stairs(counts, edges, color=colour, linewidth=1.3)
        keep(left, {f"{name} from [ms]": edges[:-1], f"{name} plans": counts})
        time, value = style.thin(record.asked, numbers[:, None])
        right.plot(time, value[:, 0], ".", color=colour, markersize=2.5)
        keep(right, {f"{name} at {TIME}": time, f"{name} [ms]": value[:, 0]})
    for axes, along in ((left, left.axvline), (right, right.axhline)):
        along(float(period), color=style.VERMILION, linewidth=1.0, linestyle=(0, (4, 2)))
        which = "x" if axes is left else "y"
        style.set_log(axes, which, edges)
    left.set_title("Plans by the time they took")
    left.set_xlabel("[ms]")
    style.set_symlog(left, "y", 1.0)
    style.set_linear(right, "x", 6)
    right.set_title("Time that each plan took [ms]")
    right.set_xlabel(TIME)
    handles = [Line2D([], [], color=colour) for colour in (style.BLUE, style.ORANGE)]
    handles.append(Line2D([], [], color=style.VERMILION, linestyle=(0, (4, 2))))
    style.legend_above(figure, handles, ["wall time", "processor time", "a tick"])
    return figure


def _most(values: Array) -> list[int]:
    """The columns that vary most for their size, in their order."""
    if not values.size:
        return []
    spread = np.ptp(values, axis=0)
    return sorted(int(k) for k in np.argsort(-spread, kind="stable")[:MOST_PANELS])


def _edges(numbers: Array) -> Array:
    """Of bins that are equally wide on a logarithmic axis."""
    known = numbers[np.isfinite(numbers) & (numbers > 0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (1.0, 1.0)
    return np.geomspace(low / 1.05, high * 1.05, BINS + 1)
