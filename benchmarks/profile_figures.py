"""The figure of data profiles: the share of solves that have converged, against what they took."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from profile_tables import AXES, TOLERANCES, Axis, Profiles, costs

from symphys import files
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure

LABELS: dict[Axis, str] = {"work": "rollouts", "seconds": "seconds of one core"}


def write_profiles(recorded: Profiles, path: Path) -> None:
    """Write ``path``, an SVG file: a row for each axis, a column for each tolerance, a line for each method."""
    with style.paper():
        files.write_text(path, style.svg_text(profiles(recorded)))


def profiles(recorded: Profiles) -> DataFigure:
    """The figure."""
    figure = DataFigure(figsize=(style.WIDTH, 5.4), layout="constrained")
    panels = figure.subplots(len(AXES), len(TOLERANCES), sharey=True, sharex="row")
    marks = style.solver_marks(recorded.methods)
    lines = []
    for row, axis in zip(panels, AXES, strict=True):
        ends = getattr(recorded.budget, axis)
        for panel, tolerance in zip(row, TOLERANCES, strict=True):
            found = costs(recorded, tolerance, axis)
            lines = []
            for method, values in found.items():
                known = np.maximum(values[np.isfinite(values)], ends * 1e-5)
                share = np.arange(1, len(known) + 1) / len(values)
                x, y = np.append(known, ends), np.append(share, share[-1:] if len(share) else 0.0)
                lines += panel.plot(x, y, color=marks[method][0], drawstyle="steps-post", label=method)
            panel.set_title(f"converged at {tolerance:g}")
            panel.set(ylim=(0, 1), xlim=(ends * 1e-4, ends), xlabel=LABELS[axis])
            style.set_log(panel, "x", np.array([ends * 1e-4, ends]))
        row[0].set_ylabel("share of all starts")
    style.legend_above(figure, lines, list(found))
    return figure
