"""A solution as figures, tables and markup: what its methods, terminals and notebooks show.

matplotlib is imported when a figure is drawn; pandas and xarray need not be installed.
"""

from __future__ import annotations

import html as markup
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symphys.errors import SymphysError
from symphys.findings.writing import show, with_unit
from symphys.results.file_names import GUESS, SCENE
from symphys.results.result import CheckRecord
from symphys.results.run import Run
from symphys.results.trace import Trace
from symphys.results.trajectories import read_trajectory
from symphys.suggest import hint, quote
from symphys.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACE = "trace."
"""Prefix of the names of columns of the trace."""
FRAME_HEIGHT = 640
"""[px] Of the motion in a notebook."""
MOST_ROWS = 24
"""Rows of what was found, at most."""
COMPONENTS = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
"""Names of the components of vectors and quaternions."""


def components(size: int) -> tuple[str, ...]:
    """Name the components of a quantity of this size; numbers where it is neither a vector nor a quaternion."""
    return COMPONENTS.get(size, tuple(map(str, range(size))))


# Figures


def draw_run(folder: Path, motion: Trajectory) -> Figure:
    """Draw the motion of a run folder from the side and from above, together with its guess."""
    from symphys.report.figures import style
    from symphys.report.scene.motion import draw_motion
    from symphys.results.scene import read_scene

    guess = folder / GUESS
    with style.paper():
        guessed = read_trajectory(guess) if guess.exists() else None
        return draw_motion(motion, read_scene(folder / SCENE), guessed)


def plot(motion: Trajectory, trace: Trace, names: Sequence[str]) -> Figure:
    """Plot quantities of a motion and columns of a trace, a panel for each, one below the other."""
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
    """Plot a column of the trace against the iteration."""
    from symphys.report.charts import palette

    if name not in trace.columns:
        raise SymphysError(f"the trace has no {quote(name)}; {hint(name, trace.columns)}")
    axes.plot(trace["iteration"], trace[name], color=palette.BLUE)
    axes.set_xlabel("iteration")
    axes.set_title(name)


def plot_quantity(axes: Axes, motion: Trajectory, name: str) -> None:
    """Plot a quantity against time, a line for each component."""
    from symphys.report.charts import palette

    if name not in motion.units:
        raise SymphysError(f"the motion has no {quote(name)}; {hint(name, motion.units)}")
    values, unit = motion[name], motion.units[name]
    lines = values.reshape(len(values), -1)
    labels = components(lines.shape[1]) if lines.shape[1] > 1 else ("",)
    for line, label, colour in zip(lines.T, labels, (*palette.AXES, palette.GREY)[: len(labels)], strict=False):
        axes.plot(motion.time[: len(line)], line, label=label, color=colour)
    if len(labels) > 1:
        axes.legend(ncols=len(labels), loc="best")
    axes.set_xlabel("time [s]")
    axes.set_title(f"{name} [{unit}]" if unit else name)
    axes.margins(x=0.01)


# Tables of pandas and xarray


def trace_frame(trace: Trace) -> Any:
    """Return a pandas.DataFrame with a row for each iteration."""
    return library("pandas").DataFrame(dict(trace.columns)).set_index("iteration")


def motion_frame(motion: Trajectory) -> Any:
    """Return a pandas.DataFrame with a row for each time and a column for each number, ``ball.position.x``."""
    pandas = library("pandas")
    found = {}
    for name in motion.units:
        values = padded(motion[name], len(motion.time))
        if name == "time":
            continue
        if values.ndim == 1:
            found[name] = values
            continue
        found |= {f"{name}.{each}": values[:, k] for k, each in enumerate(components(values.shape[1]))}
    return pandas.DataFrame(found, index=pandas.Index(motion.time, name="time"))


def motion_dataset(motion: Trajectory) -> Any:
    """Return an xarray.Dataset with a variable for each quantity over "time"."""
    xarray = library("xarray")
    found = {}
    for name, unit in motion.units.items():
        values = padded(motion[name], len(motion.time))
        if name != "time":
            dims = ("time",) if values.ndim == 1 else ("time", {3: "axis", 4: "quaternion"}.get(values.shape[1], name))
            found[name] = (dims, values, {"units": unit})
    axes = {"axis": list(COMPONENTS[3]), "quaternion": list(COMPONENTS[4])}
    return xarray.Dataset(found, coords={"time": ("time", motion.time, {"units": "s"}), **axes})


def padded(values: Any, count: int) -> Any:
    """Append a row of nan to what acts during a step, which has one row less than there are instants."""
    missing = np.full((count - len(values), *values.shape[1:]), np.nan)
    return np.concatenate([values, missing])


def library(name: str) -> Any:
    """Import an optional package; SymphysError says how to install it."""
    try:
        return import_module(name)
    except ImportError:
        raise SymphysError(f"this needs {name}: pip install {name}") from None


# Terminals and notebooks


def line(run: Run) -> str:
    """Write a run in a line: ``<Solution of ball_throw by least_squares: solved, objective 1.2e-06>``."""
    words = run.verdict.replace("_", " ")
    return f"<Solution of {run.problem} by {run.solver}: {words}, objective {show(run.objective)}>"


def html(run: Run) -> str:
    """Write the verdict, what was found, the checks and the motion of a run as HTML that needs no other file."""
    from symphys.report.pages.answers import variable_rows
    from symphys.report.pages.markup import table

    words = run.verdict.replace("_", " ")
    head = f"<b>{markup.escape(run.title)}</b>: {words} by {markup.escape(run.solver)}, seed {run.seed}"
    lines = [f"<p>{head}; objective {show(run.objective)}, {show(run.seconds.get('solve', 0))} s</p>"]
    found = [row for each in run.variables for row in variable_rows(each.name, [run.variables])]
    if found:
        lines.append(table(("", "found", "guess"), found[:MOST_ROWS], "tnn"))
    if run.checks:
        cells = [
            (each.kind, each.name, *(with_unit(show(n), each.unit) for n in (each.error, each.tolerance)), met(each))
            for each in run.checks
        ]
        lines.append(table(("", "name", "error", "tolerance", ""), cells, "ttnnt"))
    if not run.solved and run.advice:
        lines.append(f"<p>{markup.escape(run.advice)}</p>")
    return "\n".join([*lines, player(run.folder)])


def met(check: CheckRecord) -> str:
    """Say whether a check is met."""
    return "met" if check.met else "missed"


def player(folder: Path) -> str:
    """Return a frame that plays the motion of a run folder in three dimensions; empty where there is no motion."""
    from symphys.report.pages.markup import page
    from symphys.report.pages.run import film_of, read_recorded
    from symphys.report.scene.animation import animation

    run, recording = read_recorded(folder)
    motion = recording.trajectory
    if motion is None:
        return ""
    shown = animation(motion, recording.scene, recording.guess, film=film_of(run, motion))
    whole = markup.escape(page(run.title, shown))
    style = f"width: 100%; height: {FRAME_HEIGHT}px; border: 0"
    return f'<iframe srcdoc="{whole}" style="{style}" title="The motion"></iframe>'
