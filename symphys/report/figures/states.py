"""Position, velocity, angular velocity and controls against time, a row for each body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep, vector
from symphys.report.scene.views import NAMES
from symphys.trajectory import Trajectory
from symphys.types import Array

MOST_BODIES = 5
Quantity = tuple[str, str, Array, Array]
"""Name, unit, times, and values (times, B, 3)."""


def shown_bodies(trajectory: Trajectory) -> list[int]:
    """The bodies that get a row: those that move most, in the file's order."""
    travel = np.abs(np.diff(trajectory.position, axis=0)).sum(axis=(0, 2))
    most = sorted(np.argsort(-travel, kind="stable")[:MOST_BODIES])
    return [int(body) for body in most]


def controlled_bodies(trajectory: Trajectory) -> list[int]:
    """Bodies on which a force or torque acts at any time."""
    acting = np.abs(np.concatenate([trajectory.force, trajectory.torque], axis=2)).sum(axis=(0, 2))
    return [int(body) for body in np.flatnonzero(acting > 0)]


def draw_states(trajectory: Trajectory) -> DataFigure:
    """Position, velocity and angular velocity of ``shown_bodies``."""
    return draw_grid(trajectory, shown_bodies(trajectory), state_quantities(trajectory))


def state_quantities(trajectory: Trajectory) -> list[Quantity]:
    """Position, velocity and angular velocity."""
    return [
        ("position", "m", trajectory.time, trajectory.position),
        ("velocity", "m/s", trajectory.time, trajectory.velocity),
        ("angular_velocity", "rad/s", trajectory.time, trajectory.angular_velocity),
    ]


def draw_controls(trajectory: Trajectory) -> DataFigure | None:
    """Forces and torques that act on bodies; None where none does."""
    bodies = controlled_bodies(trajectory)[:MOST_BODIES]
    if not bodies:
        return None
    return draw_grid(trajectory, bodies, control_quantities(trajectory))


def control_quantities(trajectory: Trajectory) -> list[Quantity]:
    """Forces and torques on bodies, as far as any acts."""
    starts = trajectory.time[:-1]
    quantities = [("force", "N", starts, trajectory.force), ("torque", "N m", starts, trajectory.torque)]
    return [quantity for quantity in quantities if np.any(quantity[3] != 0)]


def draw_grid(trajectory: Trajectory, bodies: Sequence[int], quantities: Sequence[Quantity]) -> DataFigure:
    """Small multiples: a row for each body, a column for each quantity, its x, y, z."""
    rows, columns = len(bodies), len(quantities)
    figure = DataFigure(figsize=(style.WIDTH, 0.75 + 1.75 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for row, body in enumerate(bodies):
        for column, (name, unit, time, values) in enumerate(quantities):
            axes = grid[row, column]
            times, shown = style.thin(time, values[:, body])
            keep(axes, {TIME: times, **vector(f"{trajectory.body_names[body]}.{name}", unit, shown)})
            draw_components(axes, times, shown)
            axes.set_title(f"{name.replace('_', ' ').capitalize()} [{unit}]" if row == 0 else "")
            axes.set_xlabel("time [s]" if row == rows - 1 else "")
        if len(trajectory.body_names) > 1:
            grid[row, 0].set_ylabel(style.short(trajectory.body_names[body], 22), fontweight="bold", color=style.INK)
    lines = [Line2D([], [], color=c, linewidth=w) for c, w in zip(style.AXES, style.AXIS_WIDTHS, strict=True)]
    style.legend_above(figure, lines, list(NAMES))
    return figure


def draw_components(axes: Axes, time: Array, values: Array) -> None:
    """x, y and z of one quantity."""
    for component, (colour, width) in enumerate(zip(style.AXES, style.AXIS_WIDTHS, strict=True)):
        axes.plot(time, values[:, component], color=colour, linewidth=width)
    style.set_linear(axes, "x")
    style.set_linear(axes, "y")
    axes.margins(x=0.01, y=0.08)
    flat = values[np.isfinite(values)]
    if flat.size and np.ptp(flat) < 1e-9 * max(1.0, float(np.abs(flat).max())):
        half = max(1.0, 0.1 * abs(float(flat[0])))
        axes.set_ylim(flat[0] - half, flat[0] + half)
