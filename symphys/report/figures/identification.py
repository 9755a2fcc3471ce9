"""Figures of an identification: estimates, correlations, residuals over time, the course of the fit, replays."""

from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.results.identification import HISTORY, Identification
from symphys.results.identification.replays import RecordingReplay
from symphys.types import Array

MOST_NAMES = 30
"""Numbers of which a figure shows correlations and intervals."""
MOST_PANELS = 6
POINTS = 4000
"""Residuals that are drawn of a quantity."""
BINS = 40


def draw_intervals(found: Identification) -> DataFigure | None:
    """Each number with both of its intervals, in standard errors from the estimate."""
    known = [each for each in found.parameters if np.isfinite(each.error) and each.error > 0][:MOST_NAMES]
    if not known:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 1.0 + 0.32 * len(known)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(known))[::-1]
    columns: dict[str, list[float]] = {}
    for row, each in zip(rows, known, strict=True):
        for low, high, colour, shift, name in (
            (each.lower, each.upper, style.BLUE, 0.14, "Jacobian"),
            (each.bootstrap_lower, each.bootstrap_upper, style.ORANGE, -0.14, "bootstrap"),
        ):
            ends = [(end - each.value) / each.error for end in (low, high)]
            axes.plot(ends, [row + shift] * 2, color=colour, linewidth=3, solid_capstyle="butt")
            for key, end in zip(("from", "to"), ends, strict=True):
                columns.setdefault(f"{name} {key} [standard errors]", []).append(end)
        if np.isfinite(each.prior_deviation):
            axes.plot((each.prior_mean - each.value) / each.error, row, "d", color=style.SOFT, markersize=4)
    axes.axvline(0.0, color=style.INK, linewidth=0.8)
    axes.set_yticks(rows, [each.name for each in known])
    axes.set_ylim(-0.7, len(known) - 0.3)
    axes.grid(visible=False, axis="y")
    style.set_linear(axes, "x", 8)
    axes.set_xlabel("from the estimate [standard errors]")
    keep(axes, {name: np.array(values) for name, values in columns.items()})
    names = ["95 % by the Jacobian"] + ["95 % by the bootstrap"] * (len(found.draws) > 0)
    handles = [Line2D([], [], color=colour, linewidth=3) for colour in (style.BLUE, style.ORANGE)[: len(names)]]
    style.legend_above(figure, handles, names)
    return figure


def draw_correlations(found: Identification) -> DataFigure | None:
    """The correlations of the shared numbers."""
    names = [each.name for each in found.parameters][:MOST_NAMES]
    if len(names) < 2 or not np.isfinite(found.correlation).any():
        return None
    shown = found.correlation[: len(names), : len(names)]
    side = min(1.6 + 0.36 * len(names), style.WIDTH)
    figure = DataFigure(figsize=(style.WIDTH, side), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(shown, cmap="RdBu_r", vmin=-1, vmax=1)
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.grid(visible=False)
    if len(names) <= 12:
        for (i, j), value in np.ndenumerate(shown):
            if np.isfinite(value) and i != j:
                colour = "white" if abs(value) > 0.6 else style.INK
                axes.text(
                    j, i, style.number_label(round(float(value), 2)), ha="center", va="center", color=colour, fontsize=7
                )
    figure.colorbar(image, ax=axes, shrink=0.8).outline.set_visible(False)
    keep(axes, {name: shown[:, k] for k, name in enumerate(names)})
    return figure


def draw_residuals(found: Identification) -> DataFigure | None:
    """Residuals by noise over time, of what was fitted to, with their running mean."""
    if not found.quantities:
        return None
    shown = list(range(len(found.quantities)))[:MOST_PANELS]
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.6 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    back = np.asarray(found.held_back, bool)[np.asarray(found.residual_recording, int)]
    for axes, q in zip(grid, shown, strict=True):
        mine = (np.asarray(found.residual_quantity, int) == q) & ~back
        time, value = found.residual_time[mine], found.residual[mine]
        few = np.linspace(0, len(time) - 1, min(len(time), POINTS)).astype(int) if len(time) else np.zeros(0, int)
        axes.plot(time[few], value[few], ".", color=style.SKY, markersize=1.6, alpha=0.6, rasterized=True)
        keep(axes, {TIME: time[few], f"{found.quantities[q].name} by noise": value[few]})
        middle, mean, deviation = _binned(time, value)
        axes.fill_between(middle, mean - deviation, mean + deviation, color=style.FAINT, alpha=0.35, linewidth=0)
        axes.plot(middle, mean, color=style.VERMILION, linewidth=1.4)
        axes.axhline(0.0, color=style.INK, linewidth=0.7)
        axes.set_title(f"{found.quantities[q].name}: {found.quantities[q].verdict}")
        reach = float(np.quantile(np.abs(value), 0.995)) if len(value) else 1.0
        axes.set_ylim(-max(reach, 2.0) * 1.1, max(reach, 2.0) * 1.1)
        style.set_linear(axes, "y", 4)
    style.set_linear(grid[-1], "x", 8)
    grid[-1].set_xlabel(TIME)
    handles = [Line2D([], [], color=style.SKY, marker=".", linestyle=""), Line2D([], [], color=style.VERMILION)]
    style.legend_above(figure, handles, ["residuals by noise", "their mean, and where two thirds lie"])
    return figure


def draw_course(found: Identification) -> DataFigure | None:
    """The merit and how many standard errors are left, by iteration."""
    history = np.asarray(found.history, float).reshape(-1, len(HISTORY))
    if len(history) < 2:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 2.7), layout="constrained")
    for axes, name, title in zip(
        figure.subplots(1, 2), ("merit", "left"), ("Merit", "Standard errors that are left"), strict=True
    ):
        column = history[:, HISTORY.index(name)]
        axes.plot(history[:, 0], column, "o-", color=style.BLUE, markersize=3)
        keep(axes, {"iteration": history[:, 0], name: column})
        positive = column[np.isfinite(column) & (column > 0)]
        if positive.size:
            style.set_log(axes, "y", positive)
        style.set_linear(axes, "x", 8)
        axes.set_title(title)
        axes.set_xlabel("iteration")
    return figure


def draw_replay(replay: RecordingReplay) -> DataFigure | None:
    """What was measured and what is simulated, over time."""
    shown = replay.quantities[:MOST_PANELS]
    if not shown:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.6 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, each in zip(grid, shown, strict=True):
        for m in range(each.measured.shape[1]):
            colour = style.AXES[m % len(style.AXES)] if each.measured.shape[1] > 1 else style.BLUE
            axes.plot(replay.time, each.measured[:, m], ".", color=colour, markersize=2.5, alpha=0.6)
            axes.plot(replay.time, each.simulated[:, m], color=colour, linewidth=1.2)
            label = f" {m + 1}" if each.measured.shape[1] > 1 else ""
            keep(
                axes,
                {TIME: replay.time, f"measured{label}": each.measured[:, m], f"simulated{label}": each.simulated[:, m]},
            )
        axes.set_title(f"{each.name} [{each.unit}]" if each.unit else each.name)
        style.set_linear(axes, "y", 4)
    style.set_linear(grid[-1], "x", 8)
    grid[-1].set_xlabel(TIME)
    handles = [Line2D([], [], color=style.SOFT, marker=".", linestyle=""), Line2D([], [], color=style.SOFT)]
    style.legend_above(figure, handles, ["measured", "simulated"])
    return figure


def _binned(time: Array, value: Array) -> tuple[Array, Array, Array]:
    """Middles of spans of time, and mean and deviation of the values in them."""
    if not len(time):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    edges = np.linspace(time.min(), time.max() + 1e-12, BINS + 1)
    places = np.clip(np.digitize(time, edges) - 1, 0, BINS - 1)
    count = np.bincount(places, minlength=BINS)
    kept = count > 0
    mean = np.bincount(places, value, BINS)[kept] / count[kept]
    square = np.bincount(places, value**2, BINS)[kept] / count[kept]
    return (edges[:-1] + edges[1:])[kept] / 2, mean, np.sqrt(np.maximum(square - mean**2, 0.0))
