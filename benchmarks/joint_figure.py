"""The figure of the study of joints: errors against sweeps and against the instructions of a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from contact_figures import logarithmic, save
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symphys.report.figures import style
from symphys.types import Array

MARKERS = "os^DvPX"
ROUNDING = 1e-13
"""What lies below is not drawn."""


@dataclass(frozen=True)
class Curve:
    """One variant of a study.

    Attributes:
        label: for the legend.
        sweeps: in rising order.
        instructions: (sweeps,) of a step.
        errors: (sweeps, measures).
    """

    label: str
    sweeps: tuple[int, ...]
    instructions: Array
    errors: Array


def joint_figure(panels: Mapping[str, tuple[str, Sequence[Curve]]], path: Path) -> None:
    """A row for each study: its first measure against sweeps, and against instructions; by title (measure, curves)."""
    with style.paper():
        figure = Figure(figsize=(style.WIDTH, 2.9 * len(panels)), layout="constrained")
        axes = figure.subplots(len(panels), 2, squeeze=False, sharey="row")
        for (title, (measure, curves)), (left, right) in zip(panels.items(), axes, strict=True):
            logarithmic(left, title, "sweeps", measure)
            logarithmic(right, "", "instructions of a step [1000]", "")
            for k, curve in enumerate(curves):
                draw(left, np.array(curve.sweeps), curve, k)
                draw(right, curve.instructions / 1e3, curve, k)
            right.set_xscale("linear")
            left.set_ylim(bottom=max(ROUNDING, left.get_ylim()[0]))
            left.set_xticks(curves[0].sweeps, [str(n) for n in curves[0].sweeps])
            right.legend(loc="upper left", bbox_to_anchor=(1, 1))
        save(figure, path)


def draw(axes: Axes, x: Array, curve: Curve, k: int) -> None:
    """A line; later ones are smaller, so that those that lie on each other are all seen."""
    look = {"color": style.CYCLE[k], "marker": MARKERS[k], "markersize": 7 - 0.8 * k, "linewidth": 2.2 - 0.25 * k}
    axes.plot(x, curve.errors[:, 0], label=curve.label, **look)  # type: ignore[arg-type]
