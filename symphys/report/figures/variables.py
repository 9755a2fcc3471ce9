"""Variables with many knots as curves: found, guess and bounds."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import DataFigure, keep
from symphys.results.result import VariableRecord
from symphys.results.run import Run
from symphys.types import Array

MOST_PANELS = 8
VECTORS = ("position", "velocity", "angular_velocity", "force", "torque", "gravity")
SLOT = re.compile(r"(?P<name>\w+)(\[\s*(?P<first>-?\d+)?\s*:\s*(?P<last>-?\d+)?\s*\])?")
"""A quantity, with a range of components or without."""


def component_names(variable: VariableRecord) -> list[str]:
    """x, y, z for a vector in space, numbers otherwise, nothing for a scalar."""
    size = variable.value.shape[0]
    if size == 1:
        return [""]
    slot = SLOT.fullmatch(variable.sets[0].rpartition(".")[2]) if variable.sets else None
    if slot and slot["name"] in VECTORS:
        first, last = (int(slot[key]) if slot[key] else None for key in ("first", "last"))
        chosen = "xyz"[first:last]
        if len(chosen) == size:
            return list(chosen)
    return [str(index) for index in range(size)]


def knotted(run: Run) -> list[VariableRecord]:
    """The variables that are curves."""
    return [variable for variable in run.variables if variable.value.shape[1] > 1]


def draw_variables(run: Run) -> DataFigure | None:
    """A panel for each variable with knots; None without any."""
    shown = knotted(run)[:MOST_PANELS]
    if not shown:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.7 + 2.1 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    for axes, variable in zip(panels, shown, strict=True):
        draw_curves(axes, variable)
    handles = [Line2D([], [], color=style.GREY), Line2D([], [], color=style.GREY, linewidth=0.9, linestyle=(0, (4, 2)))]
    style.legend_above(figure, handles, ["found", "guess"])
    return figure


def draw_curves(axes: Axes, variable: VariableRecord) -> None:
    """The components of one variable against the number of the knot."""
    knots = np.arange(1, variable.value.shape[1] + 1, dtype=float)
    colours = component_colours()
    names = component_names(variable)[: len(colours)]
    widths = [*style.AXIS_WIDTHS, 1.4, 1.4, 1.4]
    for component, (name, colour) in enumerate(zip(names, colours, strict=False)):
        before, guess = style.thin(knots, variable.guess[component][:, None], 600)
        shown, value = style.thin(knots, variable.value[component][:, None], 600)
        label = ".".join(filter(None, [variable.name, name]))
        keep(axes, {"knot": shown.astype(int), label: value[:, 0]})
        keep(axes, {"knot": before.astype(int), f"{label} at the guess": guess[:, 0]})
        axes.plot(before, guess[:, 0], color=colour, linewidth=0.9, linestyle=(0, (4, 2)), alpha=0.8)
        axes.plot(shown, value[:, 0], color=colour, linewidth=widths[component])
        if name:
            end = np.clip(len(names) - component, 1, 6)
            axes.annotate(name, (1.0, 1.0), xycoords="axes fraction", xytext=(-10.0 * end, 4), color=colour,
                          textcoords="offset points", fontweight="bold")  # fmt: skip
    draw_bounds(axes, variable)
    axes.set_title(f"{variable.name}  ({style.short(', '.join(variable.sets), 60)})")
    axes.set_xlabel("knot")
    style.set_linear(axes, "x")
    style.set_linear(axes, "y")
    axes.margins(x=0.01)


def component_colours() -> list[str]:
    """Of the components of a variable, in their order."""
    return [*style.AXES, style.PURPLE, style.ORANGE, style.SKY]


def near_bounds(variable: VariableRecord) -> Array:
    """The bounds that are near the values, each once."""
    shown = finite(np.concatenate([variable.value.ravel(), variable.guess.ravel()]))
    if not shown.size:
        return shown
    room = max(float(np.ptp(shown)), 1e-9)
    bounds = np.unique(finite(np.concatenate([variable.lower.ravel(), variable.upper.ravel()])))
    near: Array = bounds[(bounds >= shown.min() - room) & (bounds <= shown.max() + room)]
    return near


def draw_bounds(axes: Axes, variable: VariableRecord) -> None:
    """Lines at bounds that are near the values."""
    near = near_bounds(variable)
    for bound in near:
        axes.axhline(bound, color=style.GROUND_EDGE, linewidth=1, linestyle=(0, (1, 2)))
    if near.size:
        keep(axes, {f"bounds of {variable.name}": near})


def finite(values: Array) -> Array:
    """Those that are finite."""
    return values[np.isfinite(values)]
