"""Position, velocity, angular velocity and controls against time, a row for each body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.scene.views import NAMES
from symphys.trajectory import Array, Trajectory

MOST_BODIES = 5


def shown_bodies(trajectory: Trajectory) -> list[int]:
    """The bodies that get a row: those that move most, in the file's order."""
    travel = np.abs(np.diff(trajectory.position, axis=0)).sum(axis=(0, 2))
    most = sorted(np.argsort(-travel, kind="stable")[:MOST_BODIES])
    return [int(body) for body in most]


def controlled_bodies(trajectory: Trajectory) -> list[int]:
    """Bodies on which a force or torque acts at any time."""
    acting = np.abs(np.concatenate([trajectory.force, trajectory.torque], axis=2)).sum(axis=(0, 2))
    return [int(body) for body in np.flatnonzero(acting > 0)]


def draw_states(trajectory: Trajectory) -> Figure:
    """Position, velocity and angular velocity of ``shown_bodies``."""
    quantities = (
        ("Position [m]", trajectory.time, trajectory.position),
        ("Velocity [m/s]", trajectory.time, trajectory.velocity),
        ("Angular velocity [rad/s]", trajectory.time, trajectory.angular_velocity),
    )
    return draw_grid(trajectory, shown_bodies(trajectory), quantities)


def draw_controls(trajectory: Trajectory) -> Figure | None:
    """Forces and torques that act on bodies; None where none does."""
    bodies = controlled_bodies(trajectory)[:MOST_BODIES]
    if not bodies:
        return None
    starts = trajectory.time[:-1]
    quantities = [("Force [N]", starts, trajectory.force), ("Torque [N m]", starts, trajectory.torque)]
    acting = [quantity for quantity in quantities if np.any(quantity[2] != 0)]
    return draw_grid(trajectory, bodies, acting)


def draw_grid(trajectory: Trajectory, bodies: Sequence[int], quantities: Sequence[tuple[str, Array, Array]]) -> Figure:
    """Small multiples: a row for each body, a column for each quantity, its three components as lines."""
    rows, columns = len(bodies), len(quantities)
    figure = Figure(figsize=(style.WIDTH, 0.75 + 1.75 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for row, body in enumerate(bodies):
        for column, (title, time, values) in enumerate(quantities):
            axes = grid[row, column]
            draw_components(axes, time, values[:, body])
            axes.set_title(title if row == 0 else "")
            axes.set_xlabel("time [s]" if row == rows - 1 else "")
        if len(trajectory.body_names) > 1:
            grid[row, 0].set_ylabel(style.short(trajectory.body_names[body], 22), fontweight="bold", color=style.INK)
    lines = [Line2D([], [], color=c, linewidth=w) for c, w in zip(style.AXES, style.AXIS_WIDTHS, strict=True)]
    style.legend_above(figure, lines, list(NAMES))
    return figure


def draw_components(axes: Axes, time: Array, values: Array) -> None:
    """x, y and z of one quantity."""
    time, values = style.thin(time, values)
    for component, (colour, width) in enumerate(zip(style.AXES, style.AXIS_WIDTHS, strict=True)):
        axes.plot(time, values[:, component], color=colour, linewidth=width)
    style.set_linear(axes, "x")
    style.set_linear(axes, "y")
    axes.margins(x=0.01, y=0.08)
    flat = values[np.isfinite(values)]
    if flat.size and np.ptp(flat) < 1e-9 * max(1.0, float(np.abs(flat).max())):
        axes.set_ylim(flat[0] - 1, flat[0] + 1)
