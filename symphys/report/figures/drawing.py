"""Charts drawn by matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel, by_abscissa
from symphys.report.charts.tables import thin, thinned
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure, keep
from symphys.report.figures.style import Picture
from symphys.types import Array

DASHES: Any = (0, (4, 2))
DOTS: Any = (0, (1, 1.5))
TICKS = {1: 8, 2: 6, 3: 5}
"""Numbers along the bottom of a panel, about, by the columns of its chart; 4 of narrower ones."""
MAX_MARKED_SAMPLES = 40
"""Samples up to which a plain line has a dot at each."""
FAR_EDGE = 16
"""An edge farther from the curves than so many times their range is not drawn."""
LETTERS = 14.0
"""Letters of a panel's title in an inch."""
MIN_STAGE_WIDTH = 0.09
"""Share of the axis that a stage needs for its name."""
HEADROOM = 0.16
"""Room above and below the curves where stages are named, as a share of the axis."""
BAR_HEIGHT = 0.64
"""Height of a bar, as a share of its row."""


def chart_pictures(charts: Sequence[Chart | None]) -> list[Picture]:
    """Draw charts, each as a picture; None is left out."""
    known = [chart for chart in charts if chart is not None]
    return [each for chart in known for each in style.picture(chart.name, chart.alt, draw_chart(chart))]


def draw_chart(chart: Chart) -> DataFigure:
    """Draw a chart; the figure keeps its tables."""
    rows = math.ceil(len(chart.panels) / chart.columns)
    tall = 0.5 + 0.25 * bool(chart.keys) + chart.height * rows
    figure = DataFigure(figsize=(style.WIDTH, tall), layout="constrained")
    widths = chart.widths or (1.0,) * chart.columns
    shared = one_range(chart)
    grid = figure.subplots(rows, chart.columns, sharex=shared, squeeze=False, width_ratios=widths)
    panels = [*chart.panels, *[None] * (grid.size - len(chart.panels))]
    for place, (axes, panel) in enumerate(zip(grid.flat, panels, strict=True)):
        if panel is None:
            axes.set_axis_off()
            continue
        room = LETTERS * (style.WIDTH * widths[place % chart.columns] / sum(widths) - 0.4)
        draw_panel(axes, panel, chart, int(room))
        lowest = place + chart.columns >= len(panels) or panels[place + chart.columns] is None
        axes.tick_params(labelbottom=lowest or not shared)
        axes.set_xlabel(panel.along if lowest else "")
    for table in chart.tables:
        keep(figure, thinned(table, chart.points))
    if chart.keys:
        style.legend_above(figure, list(map(handle, chart.keys)), [key.name for key in chart.keys])
    return figure


def one_range(chart: Chart) -> bool:
    """Whether all panels go over the same range, so that only the lowest need numbers along the bottom."""
    ends = {(line.x[0], line.x[-1]) for panel in chart.panels if panel for line in panel.lines[:1] if line.x.size}
    return len(ends) == 1


def draw_panel(axes: Axes, panel: Panel, chart: Chart, room: int) -> None:
    """Draw one panel; ``room``: letters of its title."""
    axes.set_title(palette.short(panel.title, room - len(panel.note)))
    axes.set_title(panel.note, loc="right", color=palette.VERMILION)
    style.set_linear(axes, "x", TICKS.get(chart.columns, 4))
    if panel.bars:
        draw_bars(axes, panel)
        return
    set_scale(axes, panel)
    axes.margins(x=0.01, y=HEADROOM if any(text for _, _, text in panel.stages) else 0.07)
    for group in by_abscissa(panel.lines):
        known = np.isfinite(group[0].x)
        x, columns = thin(group[0].x[known], np.stack([line.y[known] for line in group], axis=1), chart.points)
        for line, y in zip(group, columns.T, strict=True):
            draw_line(axes, line, x, y)
    fit_heights(axes, panel)
    draw_stages(axes, panel)
    if panel.end:
        draw_end(axes, *panel.end)
    if panel.ticks:
        axes.vlines(panel.ticks, 0, 0.05, transform=axes.get_xaxis_transform(), color=palette.ORANGE, linewidth=1.2)
    named = [line for line in panel.lines if line.name and not line.has("dashed")]
    if not chart.keys and len(named) > 1:
        name_lines(axes, named)


def values_of(panel: Panel) -> Array:
    """Return all finite heights of the curves."""
    values = np.concatenate([np.zeros(0), *(line.y for line in panel.lines)])
    return np.asarray(values[np.isfinite(values)])


def set_scale(axes: Axes, panel: Panel) -> None:
    """Set the scales of a panel."""
    if panel.across < 0:
        places = np.concatenate([line.x for line in panel.lines])
        style.set_log(axes, "x", places[np.isfinite(places)])
    if panel.scale < 0:
        style.set_log(axes, "y", np.concatenate([values_of(panel), panel.least, [1.0] * panel.met]))
    elif panel.scale > 0:
        style.set_symlog(axes, "y", panel.scale)
    else:
        style.set_linear(axes, "y", 5)


def draw_line(axes: Axes, line: Line, x: Array, y: Array) -> None:
    """Draw a line of a panel, thinned to (samples,) x and y."""
    if line.has("dots") or line.has("rings"):
        face = line.colour if line.has("dots") else "white"
        axes.plot(x, y, line.mark, color=line.colour, markerfacecolor=face, markersize=5.5, zorder=4, clip_on=False)
        return
    if line.has("points"):
        axes.plot(x, y, ".", color=line.colour, markersize=3, alpha=0.7, zorder=3.5)
        return
    kind = "steps-post" if line.has("steps") else "steps-mid" if line.has("middles") else "default"
    if line.has("area"):
        step = {"steps-post": "post", "steps-mid": "mid"}.get(kind)
        axes.fill_between(x, y, step=step, color=line.colour, alpha=0.14, linewidth=0)  # type: ignore[arg-type]
    marker = "o" if len(x) <= MAX_MARKED_SAMPLES and not line.look else ""
    alpha = 0.25 if line.has("pale") else 1.0
    look = {"color": line.colour, "linewidth": line.width, "linestyle": stroke(line), "alpha": alpha}
    axes.plot(x, y, drawstyle=kind, marker=marker, markersize=3, zorder=3 - line.has("pale"), **look)


def stroke(line: Line) -> Any:
    """Return matplotlib's style of a line."""
    return DASHES if line.has("dashed") else DOTS if line.has("dotted") else "solid"


def fit_heights(axes: Axes, panel: Panel) -> None:
    """Fit the vertical axis to the curves and to what it shows at least; draw edges that are near, and shaded areas."""
    values, (low, high) = values_of(panel), axes.get_ylim()
    if values.size and panel.scale == 0 and np.ptp(values) < 1e-9 * max(1.0, float(np.abs(values).max())):
        half = max(1.0, 0.1 * abs(float(values[0])))
        low, high = float(values[0]) - half, float(values[0]) + half
    far = FAR_EDGE * (high - low)
    near = [edge for edge in panel.edges if low - far <= edge <= high + far]
    for edge in near:
        axes.axhline(edge, color=palette.GROUND_EDGE, linewidth=0.9, linestyle=DOTS, zorder=1.5)
    if near and panel.scale == 0:
        margin = 0.07 * (max(high, *near) - min(low, *near))
        low, high = min(low, min(near) - margin), max(high, max(near) + margin)
    if panel.least:
        inside = not values.size or values.min() >= panel.least[0]
        low = panel.least[0] if inside else min(low, panel.least[0])
    if len(panel.least) == 2:
        high = panel.least[1] if not values.size or values.max() <= panel.least[1] else high
    if panel.met:
        low, high = min(low, 0.5), max(high, 2.0)
        axes.axhspan(low, 1, color=palette.MET, linewidth=0, zorder=0.5)
        axes.axhline(1, color=palette.GREEN, linewidth=0.9, linestyle=DASHES, zorder=1)
        place = {"xycoords": ("axes fraction", "data"), "xytext": (5, -3), "textcoords": "offset points"}
        axes.annotate("met below", (0, 1), ha="left", va="top", color="#00775a", fontsize=8, **place)  # type: ignore[arg-type]
    for band in panel.beyond:
        bottom, top = np.clip(band, low, high)
        axes.axhspan(bottom, top, color=palette.BEYOND, linewidth=0, zorder=0.5)
    axes.set_ylim(low, high)


def draw_stages(axes: Axes, panel: Panel) -> None:
    """Draw a pale band behind every other stage, and its name where there is room."""
    for index, (left, right, text) in enumerate(panel.stages):
        if index % 2:
            axes.axvspan(left, right, color=palette.GROUND, linewidth=0, alpha=0.7, zorder=0.2)
        if index:
            axes.axvline(left, color=palette.FAINT, linewidth=0.8, zorder=0.4)
        if text and right - left >= MIN_STAGE_WIDTH * (panel.stages[-1][1] - panel.stages[0][0]):
            place = {"xycoords": ("data", "axes fraction"), "xytext": (0, -3), "textcoords": "offset points"}
            middle = (0.5 * (left + right), 1)
            axes.annotate(text, middle, ha="center", va="top", color=palette.SOFT, fontsize=7.5, **place)  # type: ignore[arg-type]


def draw_end(axes: Axes, x: float, text: str) -> None:
    """Draw a vertical line with a text beside it."""
    axes.axvline(x, color=palette.VERMILION, linewidth=1, linestyle=DASHES)
    late = x > np.mean(axes.get_xlim())
    axes.annotate(text, (x, 0.97), xycoords=axes.get_xaxis_transform(), xytext=(-5 if late else 5, 0),
                  textcoords="offset points", ha="right" if late else "left", va="top", color=palette.VERMILION,
                  fontsize=8)  # fmt: skip


def name_lines(axes: Axes, named: Sequence[Line]) -> None:
    """Write the names of lines above the panel's right end, in their colours."""
    offset = 0.0
    for line in reversed(named):
        place = {"xycoords": "axes fraction", "xytext": (offset, 4), "textcoords": "offset points"}
        axes.annotate(line.name, (1.0, 1.0), color=line.colour, ha="right", fontweight="bold", **place)  # type: ignore[arg-type]
        offset -= 6.0 + 5.0 * len(line.name)


def draw_bars(axes: Axes, panel: Panel) -> None:
    """Draw rows of bars, named on the left and noted on the right."""
    for row, bar in enumerate(panel.bars):
        axes.axhspan(row - BAR_HEIGHT / 2, row + BAR_HEIGHT / 2, color=palette.GROUND, linewidth=0, zorder=1)
        parts = [(start, stop - start) for start, stop in bar.spans]
        axes.broken_barh(parts, (row - BAR_HEIGHT / 2, BAR_HEIGHT), facecolor=bar.colour, linewidth=0, zorder=3)
        axes.text(1.007, row, bar.note, va="center", color=palette.SOFT, transform=axes.get_yaxis_transform())
    axes.set_yticks(range(len(panel.bars)), [palette.short(bar.name, 24) for bar in panel.bars])
    axes.set(xlim=panel.least, ylim=(len(panel.bars) - 0.5, -0.5))
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    style.set_linear(axes, "x", 10)


def handle(key: Key) -> Artist:
    """Return what stands beside a key in the legend."""
    if key.look == "shade":
        return Patch(facecolor=key.colour, edgecolor=palette.GROUND_EDGE, linewidth=0.8)
    line = Line(key.name, key.colour, np.zeros(0), np.zeros(0), look=key.look)
    face, mark = "white" if line.has("rings") else key.colour, key.mark or "D"
    if line.has("points"):
        return Line2D([], [], color=key.colour, marker=".", linestyle="none")
    if line.has("dots") or line.has("rings"):
        return Line2D([], [], color=key.colour, marker=mark, markersize=5.5, linestyle="none", markerfacecolor=face)
    width = 1.0 if line.look else 1.5
    return Line2D([], [], color=key.colour, linewidth=width, linestyle=stroke(line), marker=key.mark, markersize=6)
