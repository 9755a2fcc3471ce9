"""A gait diagram: a row for each foot, with a bar while it carries load."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symphys.findings.writing import percent
from symphys.report.figures import style
from symphys.report.figures.spans import spans
from symphys.report.robots.branches import colours
from symphys.report.robots.gait import Stance, has_gait, stances
from symphys.results.scene import Scene
from symphys.trajectory import Array, Trajectory

MOST_ROWS = 24
ROW = 0.3
"""[in]"""
BAR = 0.64
"""Height of a bar in rows."""


def draw_gait(trajectory: Trajectory, scene: Scene) -> Figure | None:
    """The diagram; None where no body comes down or leaves the ground."""
    found = stances(trajectory, scene)
    if not has_gait(found):
        return None
    rows = sorted(sorted(found, key=changes, reverse=True)[:MOST_ROWS], key=lambda stance: stance.body)
    figure = Figure(figsize=(style.WIDTH, 0.75 + ROW * len(rows)), layout="constrained")
    axes = figure.subplots()
    colour = colours(trajectory, scene)
    for row, stance in enumerate(rows):
        draw_row(axes, row, trajectory.time, stance, colour[stance.body])
    axes.set_yticks(range(len(rows)), [style.short(trajectory.body_names[stance.body], 24) for stance in rows])
    axes.set(xlim=(trajectory.time[0], trajectory.time[-1]), ylim=(len(rows) - 0.5, -0.5), xlabel="time [s]")
    axes.set_title("On the ground")
    axes.set_title("duty factor", loc="right", fontweight="normal", color=style.SOFT)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    style.set_linear(axes, "x", 10)
    return figure


def draw_row(axes: Axes, row: int, time: Array, stance: Stance, colour: str) -> None:
    """The bars of one body, and its duty factor beside them."""
    axes.axhspan(row - BAR / 2, row + BAR / 2, color=style.GROUND, linewidth=0, zorder=1)
    bars = [(time[start], time[stop] - time[start]) for start, stop in spans(stance.stands)]
    axes.broken_barh(bars, (row - BAR / 2, BAR), facecolor=colour, linewidth=0, zorder=3)
    axes.text(1.007, row, percent(stance.duty), va="center", color=style.SOFT, transform=axes.get_yaxis_transform())


def changes(stance: Stance) -> int:
    """How often a body comes down."""
    return len(spans(stance.stands))
