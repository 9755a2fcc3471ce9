"""Figures of the studies of contact: errors against steps and CPU time, on logarithmic axes with slopes to compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from symphys.report.figures import style
from symphys.types import Array

LOOKS = {
    "symphys, e = 0": (style.BLUE, "o", "-"),
    "symphys, e = 0.5": (style.GREEN, "^", "-"),
    "symphys": (style.BLUE, "o", "-"),
    "symphys without time of impact": (style.SKY, "s", "-"),
    "MuJoCo, default contact": (style.VERMILION, "o", "-"),
    "MuJoCo, stiff contact": (style.ORANGE, "s", "-"),
    "MuJoCo, default, RK4": (style.PURPLE, "^", "-"),
    "MuJoCo, Euler": (style.VERMILION, "o", "-"),
    "MuJoCo, implicitfast": (style.ORANGE, "s", "--"),
    "MuJoCo, RK4": (style.PURPLE, "^", "-"),
    "MuJoCo, linear spring": (style.PURPLE, "v", "-"),
    "MuJoCo, gradual spring": (style.GREY, "D", "-"),
}
"""Colour, marker and line of each curve that is drawn: MuJoCo's are warm."""
BELOW = 0.04
"""Of the first curve's error at the largest step: where lines of an order begin."""

NOTE: dict[str, Any] = {"fontsize": 7.5, "color": style.SOFT}
ROUNDING, WORST = 1e-12, 30.0
"""Of gradients: what counts as rounding; the top of a figure, above which nothing is left of a gradient."""


@dataclass(frozen=True)
class Curve:
    """How an engine does at several steps.

    Attributes:
        label: a key of LOOKS.
        steps: [s].
        errors: (steps, initial states).
        alone: (steps,) CPU seconds of a simulated one, one state; empty if not measured.
        eight: the same, a share of eight states side by side.
    """

    label: str
    steps: tuple[float, ...]
    errors: Array
    alone: Array
    eight: Array


def draw(axes: Axes, x: Array, errors: Array, label: str, band: bool = True) -> None:
    """A curve of medians and a band of quartiles."""
    colour, marker, line = LOOKS[label]
    low, middle, high = np.quantile(errors, [0.25, 0.5, 0.75], axis=1)
    if band:
        axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)
    axes.plot(x, middle, line, color=colour, marker=marker, markersize=3.5, linewidth=1.4, label=label)


def logarithmic(axes: Axes, title: str, xlabel: str, ylabel: str) -> None:
    """Both axes, with powers of ten as ticks."""
    axes.set_title(title)
    axes.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
    axes.minorticks_off()
    style.use_numbers(axes)


def named_steps(axes: Axes, steps: Sequence[float]) -> None:
    """Ticks at the steps themselves."""
    axes.set_xticks([1e3 * dt for dt in steps], [f"{1e3 * dt:.3g}" for dt in steps])


def slope(axes: Axes, order: int, steps: Array, top: float, reach: int = 8) -> None:
    """A thin line of an order through ``top`` at the largest step, over a factor of ``reach``."""
    x = np.array([steps.max() / reach, steps.max()])
    y = top * (x / x[1]) ** order
    axes.plot(x, y, "--", color=style.FAINT, linewidth=0.9, zorder=1)
    axes.annotate(
        f"order {order}", (x[0], y[0]), xytext=(-4, -2), textcoords="offset points", ha="right", **NOTE,
    )  # fmt: skip


def consistency_figure(panels: dict[str, list[Curve]], path: Path) -> None:
    """A row for each scene: error against step, and against CPU time."""
    with style.paper():
        figure = Figure(figsize=(style.WIDTH, 3.6 * len(panels)), layout="constrained")
        rows = figure.subplots(len(panels), 2, squeeze=False, sharey="row")
        for (title, curves), (left, right) in zip(panels.items(), rows, strict=True):
            logarithmic(left, title, "step [ms]", "error against the same engine at 1/64 ms [m]")
            logarithmic(right, "", "CPU time of a simulated second [ms]", "")
            for curve in [c for c in curves if c.label in LOOKS]:
                draw(left, 1e3 * np.array(curve.steps), curve.errors, curve.label)
                draw(right, 1e3 * curve.alone, curve.errors, curve.label, band=False)
            shares(right, curves[0])
            for order in (1, 2):
                top = BELOW * float(np.median(curves[0].errors[0]))
                slope(left, order, 1e3 * np.array(curves[0].steps), top, reach=4)
            named_steps(left, curves[0].steps)
        handles, labels = rows[0][1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
        save(figure, path)


def shares(axes: Axes, curve: Curve) -> None:
    """The first curve once more, as one of eight side by side."""
    colour = LOOKS[curve.label][0]
    middle = np.median(curve.errors, axis=1)
    label = f"{curve.label}, one of eight side by side"
    axes.plot(1e3 * curve.eight, middle, ":", color=colour, linewidth=1.4, label=label)


def save(figure: Figure, path: Path) -> None:
    """As SVG, and as PNG beside it where asked for by the name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        FigureCanvasAgg(figure)
        figure.savefig(path, dpi=110)
        return
    path.write_text(style.svg_text(figure), encoding="utf-8")


def gradient_figure(panels: dict[str, list[Curve]], path: Path) -> None:
    """A panel for each case: relative error of the gradient against the step."""
    with style.paper():
        figure = Figure(figsize=(style.WIDTH, 6.8), layout="constrained")
        shared: dict[str, Artist] = {}
        for (title, curves), axes in zip(panels.items(), figure.subplots(2, 2).flat, strict=True):
            logarithmic(axes, title, "step [ms]", "relative error of the gradient")
            for curve in curves:
                draw(axes, 1e3 * np.array(curve.steps), curve.errors, curve.label)
            lowest = min(np.median(curve.errors, axis=1).min() for curve in curves)
            axes.set_ylim(max(lowest, 1e-17) / 5, WORST)
            named_steps(axes, curves[0].steps)
            if lowest > ROUNDING:
                slope(axes, 1, 1e3 * np.array(curves[0].steps), 0.5 * float(curves[0].errors[0].min()))
                axes.set_ylabel("error against the engine at 1/32 ms")
            else:
                axes.axhspan(axes.get_ylim()[0], ROUNDING, color=style.GROUND, zorder=0)
                axes.text(1e3 * curves[0].steps[0], ROUNDING / 2, "rounding", ha="right", va="top", **NOTE)
            handles, labels = axes.get_legend_handles_labels()
            shared |= dict(zip(labels, handles, strict=True))
        figure.legend(list(shared.values()), list(shared), loc="outside upper left", ncols=3)
        save(figure, path)
