"""Sensitivity growth and energy along the horizon."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from symphys.findings.examination import Energy, Growth
from symphys.findings.numerics import reach
from symphys.findings.writing import show
from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.trajectory import Trajectory
from symphys.types import Array

HEIGHT = 2.3
LEAST_RANGE = 100.0
"""The factors that the axis spans at least, so that little growth looks little."""
MOST_TOUCHES = 150


def draw_growth(growth: Growth, motion: Trajectory | None) -> DataFigure | None:
    """|dx_T/dx_t| against t on a logarithmic axis, a tick below where a contact begins; None without two numbers."""
    time, factor = known_growth(growth)
    if time.size < 2:
        return None
    figure = DataFigure(figsize=(style.WIDTH, HEIGHT), layout="constrained")
    axes = figure.subplots()
    axes.plot(time, factor, color=style.BODIES[0])
    keep(axes, {TIME: time, "growth of a change until the end": factor})
    low = 10 ** math.floor(math.log10(min(factor.min(), 1.0)))
    high = max(float(factor.max()) * 1.5, low * LEAST_RANGE)
    style.set_log(axes, "y", np.array([low, high]))
    axes.set_ylim(low, high)
    axes.set(title="Growth of a change at t until the end", xlabel="time t [s]")
    style.set_linear(axes, "x")
    axes.margins(x=0.01)
    mark_end(axes, reach(growth).end)
    if motion is not None:
        mark_touches(axes, touches(motion))
        keep(axes, {"a contact begins at [s]": touches(motion)})
    return figure


def known_growth(growth: Growth) -> tuple[Array, Array]:
    """Times [s] and factors, as far as they are known."""
    known = np.isfinite(growth.factor) & (growth.factor > 0)
    return growth.time[known], growth.factor[known]


def mark_end(axes: Axes, end: float) -> None:
    """Where the gradient is not to be trusted any more, if anywhere."""
    if math.isfinite(end):
        axes.axvline(end, color=style.VERMILION, linewidth=1, linestyle=(0, (4, 2)))
        late = end > np.mean(axes.get_xlim())
        axes.annotate(
            f"no gradient reaches from the start beyond {show(end, 2)} s",
            (end, 0.97),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-5 if late else 5, 0),
            textcoords="offset points",
            ha="right" if late else "left",
            va="top",
            color=style.VERMILION,
            fontsize=8,
        )


def touches(motion: Trajectory) -> Array:
    """The times [s] at which a contact begins to act."""
    acting = np.abs(np.nan_to_num(motion.contact_force)).sum(axis=2) > 0
    begins = acting.copy()
    begins[1:] &= ~acting[:-1]
    return np.asarray(motion.time[:-1][begins.any(axis=1)])


def mark_touches(axes: Axes, times: Array) -> None:
    """Short ticks along the bottom, unless there are too many to tell apart."""
    if 0 < times.size <= MOST_TOUCHES:
        axes.vlines(times, 0, 0.05, transform=axes.get_xaxis_transform(), color=style.ORANGE, linewidth=1.2)


def energy_lines(energy: Energy) -> list[tuple[str, Array, str, float]]:
    """Name, values [J], colour and width of each; nothing where no energy was recorded."""
    total = energy.kinetic + energy.potential
    if energy.time.size < 2 or not np.isfinite(total).any():
        return []
    lines = [("kinetic", energy.kinetic, style.SKY, 1.2), ("potential", energy.potential, style.ORANGE, 1.2)]
    lines.append(("total", total, style.BODIES[0], 1.8))
    if np.any(energy.applied != 0):
        lines.append(("put in by forces", energy.applied, style.GREY, 1.0))
    return lines


def draw_energy(energy: Energy) -> DataFigure | None:
    """Kinetic, potential and total energy against time; None where it was not recorded."""
    lines = energy_lines(energy)
    if not lines:
        return None
    figure = DataFigure(figsize=(style.WIDTH, HEIGHT + 0.25), layout="constrained")
    axes = figure.subplots()
    keep(axes, {TIME: energy.time} | {f"energy {name} [J]": values for name, values, *_ in lines})
    for _, values, colour, width in lines:
        axes.plot(energy.time, values, color=colour, linewidth=width)
    axes.set(title="Energy [J]", xlabel="time [s]")
    style.set_linear(axes, "x")
    style.set_linear(axes, "y")
    axes.margins(x=0.01)
    style.legend_above(figure, axes.get_lines(), [name for name, *_ in lines])
    return figure
