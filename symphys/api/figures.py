"""Figures of a solution; matplotlib is imported when one is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from symphys.errors import SymphysError
from symphys.results.trace import Trace
from symphys.suggest import hint, quote
from symphys.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACE = "trace."
"""Before the names of columns of the trace."""
AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")


def draw(folder: Path, motion: Trajectory) -> Figure:
    """The motion of a run folder from the side and from above, with the guess."""
    from symphys.report.figures import style
    from symphys.report.scene.motion import draw_motion
    from symphys.results.file_names import GUESS, SCENE
    from symphys.results.scene import read_scene
    from symphys.results.trajectories import read_trajectory

    guess = folder / GUESS
    with style.paper():
        shown = read_trajectory(guess) if guess.exists() else None
        return draw_motion(motion, read_scene(folder / SCENE), shown)


def plot(motion: Trajectory, trace: Trace, names: Sequence[str]) -> Figure:
    """A panel for each quantity of a motion or column of a trace, one below the other."""
    from matplotlib.figure import Figure

    from symphys.report.figures import style

    with style.paper():
        figure = Figure(figsize=(style.WIDTH * 0.7, 0.6 + 1.8 * len(names)), layout="constrained")
        grid = figure.subplots(len(names), 1, squeeze=False)[:, 0]
        for axes, name in zip(grid, names, strict=True):
            if name.startswith(TRACE):
                plot_column(axes, trace, name.removeprefix(TRACE))
            else:
                plot_quantity(axes, motion, name)
    return figure


def plot_column(axes: Axes, trace: Trace, name: str) -> None:
    """A column of the trace against the iteration."""
    from symphys.report.figures import style

    if name not in trace.columns:
        raise SymphysError(f"the trace has no {quote(name)}; {hint(name, trace.columns)}")
    axes.plot(trace["iteration"], trace[name], color=style.BLUE)
    axes.set_xlabel("iteration")
    axes.set_title(name)


def plot_quantity(axes: Axes, motion: Trajectory, name: str) -> None:
    """A quantity against time, a line for each component."""
    from symphys.report.figures import style

    if name not in motion.units:
        raise SymphysError(f"the motion has no {quote(name)}; {hint(name, motion.units)}")
    values, unit = motion[name], motion.units[name]
    lines = values.reshape(len(values), -1)
    labels = {1: ("",), 3: AXES, 4: QUATERNION}.get(lines.shape[1], tuple(map(str, range(lines.shape[1]))))
    for line, label, colour in zip(lines.T, labels, (*style.AXES, style.GREY)[: len(labels)], strict=False):
        axes.plot(motion.time[: len(line)], line, label=label, color=colour)
    if len(labels) > 1:
        axes.legend(ncols=len(labels), loc="best")
    axes.set_xlabel("time [s]")
    axes.set_title(f"{name} [{unit}]" if unit else name)
    axes.margins(x=0.01)
