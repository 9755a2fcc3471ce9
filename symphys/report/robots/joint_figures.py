"""Angles of joints with their limits and targets, torques of motors with their bounds: small multiples."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from symphys.findings.writing import percent
from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.report.robots.branches import branches, colours
from symphys.report.robots.gait import spans
from symphys.report.robots.joint_use import Channel, channels
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array

BEYOND = "#e9edf0"
FULL = style.VERMILION
TARGET = style.INK
DASHES, DOTS = (0, (3, 1.6)), (0, (1, 1.5))
NEAR = 16
"""Limits are shown unless they are farther away than so many times what is drawn."""
LEAST_TURN, LEAST_SLIDE, LEAST_TORQUE = 0.1, 0.02, 1e-3
"""[rad], [m], [N m] or [N]: what an axis shows at least."""
Draw = Callable[[Axes, Array, Channel, str], None]


def draw_joints(trajectory: Trajectory, scene: Scene) -> tuple[DataFigure | None, DataFigure | None]:
    """The angles, and the torques; of few joints one figure with both."""
    every = shown(channels(trajectory, scene))
    if not every or len(trajectory.time) < 2:
        return None, None
    if len(every) <= FEW:
        return draw_rows(every, trajectory, scene), None
    angles = draw_grid(make_grid(every, trajectory, scene), draw_value, trajectory, scene)
    add_keys(angles, value_keys(every))
    driven = [channel for channel in every if channel.driven]
    if not driven:
        return angles, None
    torques = draw_grid(make_grid(driven, trajectory, scene), draw_torque, trajectory, scene)
    add_keys(torques, torque_keys(driven))
    return angles, torques


def draw_rows(every: list[Channel], trajectory: Trajectory, scene: Scene) -> DataFigure:
    """A row for each coordinate, its torque beside it if any has a motor."""
    driven = [channel for channel in every if channel.driven]
    columns = 2 if driven else 1
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.7 * len(every)), layout="constrained")
    grid = figure.subplots(len(every), columns, sharex=True, squeeze=False)
    for row, channel in enumerate(every):
        colour = colour_of(channel, trajectory, scene)
        draw_value(grid[row, 0], trajectory.time, channel, colour)
        if columns == 2 and channel.driven:
            draw_torque(grid[row, 1], trajectory.time, channel, colour)
        elif columns == 2:
            grid[row, 1].set_axis_off()
        grid[row, 0].set_title(style.short(f"{channel.name}: {channel.quantity} [{channel.unit}]"))
        if channel.driven:
            grid[row, 1].set_title(style.short(f"{channel.name}: {channel.effort} [{channel.torque_unit}]"))
        for axes in grid[row]:
            axes.tick_params(labelbottom=row == len(every) - 1 or not every[row + 1].driven)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    add_keys(figure, [*value_keys(every), *torque_keys(driven)])
    return figure


def draw_grid(grid: Grid, draw: Draw, trajectory: Trajectory, scene: Scene) -> DataFigure:
    """A small picture for each coordinate."""
    rows, columns = len(grid), len(grid[0])
    figure = DataFigure(figsize=(style.WIDTH, 0.7 + 1.25 * rows), layout="constrained")
    places = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for row, channels_of_row in enumerate(grid):
        for column, channel in enumerate(channels_of_row):
            axes = places[row, column]
            if channel is None:
                axes.set_axis_off()
                continue
            draw(axes, trajectory.time, channel, colour_of(channel, trajectory, scene))
            lowest = row == rows - 1 or grid[row + 1][column] is None
            axes.tick_params(labelbottom=lowest)
            axes.set_xlabel("time [s]" if lowest else "")
    return figure


def draw_value(axes: Axes, time: Array, channel: Channel, colour: str) -> None:
    """The coordinate, what is beyond its limits, and a servo's target, dashed."""
    shown_values = channel.value if channel.target is None else np.concatenate([channel.value, channel.target])
    low, high = axis_range(shown_values, [channel.joint.lower, channel.joint.upper], least_range(channel))
    for edge, beyond in ((channel.joint.lower, low), (channel.joint.upper, high)):
        if low <= edge <= high:
            axes.axhspan(min(edge, beyond), max(edge, beyond), color=BEYOND, linewidth=0, zorder=0.5)
            axes.axhline(edge, color=style.GROUND_EDGE, linewidth=0.8, zorder=1.5)
    axes.plot(time, channel.value, color=colour, linewidth=1.5, zorder=3)
    if channel.target is not None:
        target = np.append(channel.target, channel.target[-1])
        axes.plot(time, target, color=TARGET, linestyle=DASHES, linewidth=1.0, drawstyle="steps-post", zorder=3.5)
    keep_value(
        axes, time, channel, [edge for edge in (channel.joint.lower, channel.joint.upper) if low <= edge <= high]
    )
    dress(axes, f"{channel.name} [{channel.unit}]", low, high)


def keep_value(axes: Axes, time: Array, channel: Channel, limits: list[float]) -> None:
    """The numbers of ``draw_value``, thinned, and the limits that it shows."""
    target = [] if channel.target is None else [np.append(channel.target, channel.target[-1])]
    times, (value, *command) = thinned(time, [channel.value, *target])
    columns = {f"{channel.name}.{channel.quantity} [{channel.unit}]": value}
    keep(axes, {TIME: times} | columns | {f"{channel.name}.command [{channel.unit}]": each for each in command})
    if limits:
        keep(axes, {f"limits of {channel.name} [{channel.unit}]": limits})


def thinned(time: Array, columns: list[Array]) -> tuple[Array, Array]:
    """Times, and (k, times) columns."""
    times, values = style.thin(time, np.stack(columns, axis=1))
    return times, values.T


def draw_torque(axes: Axes, time: Array, channel: Channel, colour: str) -> None:
    """What the motor gives, its bounds, and where it is at them."""
    bounds = [-channel.bound, channel.bound] if np.isfinite(channel.bound) else [0.0]
    low, high = axis_range(np.append(channel.torque, bounds), [], LEAST_TORQUE)
    for edge in bounds:
        axes.axhline(edge, color=style.GROUND_EDGE, linewidth=0.9, linestyle=DOTS, zorder=1.5)
    steps = np.append(channel.torque, channel.torque[-1:])
    axes.plot(time, steps, color=colour, drawstyle="steps-post", linewidth=1.2, zorder=3)
    for sign in (-1, 1):
        for start, stop in spans(channel.saturated & (sign * channel.torque > 0)):
            ends = [time[start], time[stop]]
            axes.plot(ends, [sign * channel.bound] * 2, color=FULL, linewidth=2.4, zorder=3.2, solid_capstyle="butt")
            axes.fill_between(ends, 0, sign * channel.bound, color=FULL, alpha=0.16, linewidth=0, zorder=2)
    times, (torque, saturated) = thinned(time[:-1], [channel.torque, channel.saturated.astype(float)])
    name = f"{channel.name}.{channel.effort} [{channel.torque_unit}]"
    keep(axes, {TIME: times, name: torque, f"{channel.name}.saturated": saturated.astype(int)})
    if channel.bound > 0:
        keep(axes, {f"most of {name}": [channel.bound]})
    dress(axes, f"{channel.name} [{channel.torque_unit}]", low, high)
    if channel.share > 0:
        axes.set_title(percent(channel.share), loc="right", color=FULL)


def least_range(channel: Channel) -> float:
    """[rad] or [m]: what the axis of a coordinate shows at least."""
    return LEAST_TURN if channel.turns else LEAST_SLIDE


def axis_range(values: Array, edges: list[float], least: float) -> tuple[float, float]:
    """What an axis shows: all values, ``least`` at least, and the edges unless they make that too small."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    lack = max(least - (high - low), 0.0) / 2
    low, high = low - lack, high + lack
    far = NEAR * (high - low)
    for edge in [edge for edge in edges if low - far <= edge <= high + far]:
        low, high = min(low, edge), max(high, edge)
    margin = 0.1 * (high - low)
    return low - margin, high + margin


def dress(axes: Axes, title: str, low: float, high: float) -> None:
    """Name, unit and scale."""
    axes.set_title(style.short(title, 26))
    style.set_linear(axes, "x", 4)
    style.set_linear(axes, "y", 4)
    axes.margins(x=0.01)
    axes.set_ylim(low, high)


Key = tuple[Artist, str]
"""What is drawn, and what it means."""


def value_keys(every: list[Channel]) -> list[Key]:
    """Of pictures of coordinates, those that there are."""
    keys: list[Key] = [(Line2D([], [], color=style.BODIES[0]), "angle or position")]
    if any(channel.target is not None for channel in every):
        keys.append((Line2D([], [], color=TARGET, linewidth=1.0, linestyle=DASHES), "command of the servo"))
    if any(np.isfinite([channel.joint.lower, channel.joint.upper]).any() for channel in every):
        keys.append((Patch(facecolor=BEYOND, edgecolor=style.GROUND_EDGE, linewidth=0.8), "beyond a limit"))
    return keys


def torque_keys(driven: list[Channel]) -> list[Key]:
    """Of pictures of torques, those that there are."""
    keys: list[Key] = []
    if any(channel.bound > 0 for channel in driven):
        keys.append((Line2D([], [], color=style.GROUND_EDGE, linestyle=DOTS), "most that a motor can give"))
    if any(channel.share > 0 for channel in driven):
        keys.append((Line2D([], [], color=FULL, linewidth=2.4), "saturated: it gives the most, and for how long"))
    return keys


def add_keys(figure: DataFigure, keys: list[Key]) -> None:
    """A row above all."""
    if keys:
        style.legend_above(figure, [artist for artist, _ in keys], [label for _, label in keys])


MOST = 24
"""Coordinates in a figure at most."""
FEW = 4
"""So many have a row each, with angle and torque side by side."""
WIDE, TALL = 4, 6
"""Columns side by side, and joints in a column, at most."""
UNEVEN = 2
"""The longest column has at most so many times the joints of the shortest."""

Grid = list[list[Channel | None]]
"""Rows; None is an empty place."""


def shown(channels: Sequence[Channel]) -> list[Channel]:
    """All, or of many those that move most, in the file's order."""
    if len(channels) <= MOST:
        return list(channels)
    most = np.argsort([-np.ptp(channel.value) for channel in channels], kind="stable")[:MOST]
    return [channels[index] for index in sorted(most)]


def make_grid(channels: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> Grid:
    """A column for each branch where there are several of like size; else the file's order, row by row."""
    columns = by_branch(channels, trajectory, scene)
    sizes = [len(column) for column in columns]
    if len(columns) < 2 or max(sizes) > min(TALL, UNEVEN * min(sizes)):
        rows = [list(channels[start : start + WIDE]) for start in range(0, len(channels), WIDE)]
        return [[*row, *[None] * (WIDE - len(row))] for row in rows]
    bands = [columns[start : start + WIDE] for start in range(0, len(columns), WIDE)]
    wide = max(map(len, bands))
    return [[*row, *[None] * (wide - len(row))] for band in bands for row in map(list, itertools.zip_longest(*band))]


def by_branch(channels: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> list[list[Channel]]:
    """The coordinates of each branch that has some; those that hold base bodies come last."""
    places = {
        trajectory.body_names[body]: n for n, branch in enumerate(branches(trajectory, scene)) for body in branch.bodies
    }
    bases = {trajectory.body_names[branch.bodies[0]] for branch in branches(trajectory, scene) if branch.is_base}
    found: dict[int, list[Channel]] = {}
    for channel in channels:
        own = [places[name] for name in channel.joint.bodies if name in places and name not in bases]
        found.setdefault(min(own, default=len(places)), []).append(channel)
    return [found[key] for key in sorted(found)]


def colour_of(channel: Channel, trajectory: Trajectory, scene: Scene) -> str:
    """That of the body which moves: of the first, but where that is a base body of the second."""
    bases = {trajectory.body_names[branch.bodies[0]] for branch in branches(trajectory, scene) if branch.is_base}
    of_body = dict(zip(trajectory.body_names, colours(trajectory, scene), strict=True))
    names = [name for name in channel.joint.bodies if name in of_body]
    moving = [name for name in names if name not in bases] or names
    return of_body[moving[0]] if moving else style.BODIES[0]
