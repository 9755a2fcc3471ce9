"""Charts of joints: coordinates with their limits and commands, torques of motors with their bounds."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from symphys.findings.writing import percent
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.tables import TIME, Table
from symphys.report.robots.branches import branches, colours
from symphys.report.robots.gait import spans
from symphys.report.robots.joint_use import Channel, channels
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array

SATURATED, COMMAND = palette.VERMILION, palette.INK
NEAR_LIMIT = 16
"""Limits farther away than so many times the range of a coordinate are not drawn."""
LEAST_TURN, LEAST_SLIDE = 0.1, 0.02
"""[rad], [m]: the smallest range of an axis."""
MAX_COORDINATES = 24
"""Coordinates in a figure, at most."""
MAX_WIDE_ROWS = 4
"""So many have a row each, with coordinate and torque side by side."""
MAX_COLUMNS, MAX_COLUMN_LENGTH = 4, 6
"""Columns side by side, and joints in a column, at most."""
MAX_COLUMN_RATIO = 2
"""The longest column has at most so many times the joints of the shortest."""

Grid = list[list[Channel | None]]
"""Rows; None is an empty place."""


def joint_charts(trajectory: Trajectory, scene: Scene) -> list[Chart]:
    """Chart coordinates and torques; of few joints both in one chart."""
    every = shown(channels(trajectory, scene))
    if not every or len(trajectory.time) < 2:
        return []
    time, colour = trajectory.time, {id(each): colour_of(each, trajectory, scene) for each in every}
    driven = [channel for channel in every if channel.driven]
    values = [table for channel in every for table in value_tables(channel, time)]
    torques = [table for channel in driven for table in torque_tables(channel, time)]
    if len(every) <= MAX_WIDE_ROWS:
        both = [
            (
                value_panel(each, time, colour[id(each)], f": {each.quantity}"),
                torque_panel(each, time, colour[id(each)], f": {each.effort}") if each.driven else None,
            )
            for each in every
        ]
        panels = tuple(panel for row in both for panel in row[: 1 + bool(driven)])
        keys = value_keys(every) + torque_keys(driven)
        alt = "Coordinates of joints over time"
        return [Chart("joints", alt, panels, 1 + bool(driven), keys, (*values, *torques))]
    found = []
    for name, alt, some, draw, keys, tables in (
        ("joints", "Coordinates of joints over time", every, value_panel, value_keys(every), values),
        ("motors", "Torques of motors over time", driven, torque_panel, torque_keys(driven), torques),
    ):
        if some:
            grid = make_grid(some, trajectory, scene)
            places = tuple(None if each is None else draw(each, time, colour[id(each)]) for row in grid for each in row)
            found.append(Chart(name, alt, places, len(grid[0]), keys, tuple(tables), height=1.25))
    return found


def value_panel(channel: Channel, time: Array, colour: str, what: str = "") -> Panel:
    """Chart a coordinate with the command of a servo, and shade what is beyond its limits."""
    lower, upper = channel.joint.lower, channel.joint.upper
    shown_values = channel.value if channel.target is None else np.concatenate([channel.value, channel.target])
    low, high = axis_range(shown_values, [lower, upper], LEAST_TURN if channel.turns else LEAST_SLIDE)
    drawn = [Line(channel.quantity, colour, time, channel.value)]
    if channel.target is not None:
        drawn.append(Line("command", COMMAND, time, held(channel.target), 1.0, "dashed steps"))
    edges = tuple(edge for edge in (lower, upper) if low <= edge <= high)
    beyond = ((-np.inf, lower),) * (lower in edges) + ((upper, np.inf),) * (upper in edges)
    title = f"{channel.name}{what} [{channel.unit}]"
    return Panel(title, tuple(drawn), TIME, edges=edges, beyond=beyond, least=(low, high))


def value_tables(channel: Channel, time: Array) -> list[Table]:
    """Return the numbers of ``value_panel``."""
    table = {TIME: time, f"{channel.name}.{channel.quantity} [{channel.unit}]": channel.value}
    command = {} if channel.target is None else {f"{channel.name}.command [{channel.unit}]": held(channel.target)}
    edges = value_panel(channel, time, "").edges
    return [table | command, *([{f"limits of {channel.name} [{channel.unit}]": edges}] if edges else [])]


def torque_panel(channel: Channel, time: Array, colour: str, what: str = "") -> Panel:
    """Chart the torque or force of a motor with its bounds, and mark where it is saturated."""
    bounds = (-channel.bound, channel.bound) if np.isfinite(channel.bound) else (0.0,)
    drawn = [Line(channel.effort, colour, time, held(channel.torque), 1.2, "steps")]
    if channel.share > 0:
        sides = [(sign, ends) for sign in (-1, 1) for ends in spans(channel.saturated & (sign * channel.torque > 0))]
        times = np.concatenate([time[[start, stop, stop]] for _, (start, stop) in sides])
        bound = np.concatenate([[sign * channel.bound, sign * channel.bound, np.nan] for sign, _ in sides])
        drawn.append(Line("saturated", SATURATED, times, bound, 2.4, "area"))
    note = f"saturated {percent(channel.share)}" if channel.share > 0 else ""
    return Panel(f"{channel.name}{what} [{channel.torque_unit}]", tuple(drawn), TIME, edges=bounds, note=note)


def torque_tables(channel: Channel, time: Array) -> list[Table]:
    """Return the numbers of ``torque_panel``."""
    name = f"{channel.name}.{channel.effort} [{channel.torque_unit}]"
    saturated = {f"{channel.name}.saturated": channel.saturated.astype(int)}
    most = [{f"most of {name}": [channel.bound]}] if channel.bound > 0 else []
    return [{TIME: time[:-1], name: channel.torque} | saturated, *most]


def held(values: Array) -> Array:
    """Return values of N steps at N + 1 times: the last one holds to the end."""
    return np.append(values, values[-1:])


def axis_range(values: Array, edges: Sequence[float], least: float) -> tuple[float, float]:
    """Return what an axis shows: all values, ``least`` at least, and the edges unless they make that too small."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    lack = max(least - (high - low), 0.0) / 2
    low, high = low - lack, high + lack
    far = NEAR_LIMIT * (high - low)
    for edge in [edge for edge in edges if low - far <= edge <= high + far]:
        low, high = min(low, edge), max(high, edge)
    margin = 0.1 * (high - low)
    return low - margin, high + margin


def value_keys(every: Sequence[Channel]) -> tuple[Key, ...]:
    """Return the keys of charts of coordinates, as far as they are used."""
    command = any(channel.target is not None for channel in every)
    limits = any(np.isfinite([channel.joint.lower, channel.joint.upper]).any() for channel in every)
    keys = (Key("command of the servo", COMMAND, "dashed"),) * command
    return keys + (Key("beyond a limit", palette.BEYOND, "shade"),) * limits


def torque_keys(driven: Sequence[Channel]) -> tuple[Key, ...]:
    """Return the keys of charts of torques, as far as they are used."""
    keys = (Key("most that a motor can give", palette.GROUND_EDGE, "dotted"),) * any(each.bound > 0 for each in driven)
    full = any(channel.share > 0 for channel in driven)
    return keys + (Key("saturated: it gives the most, and for how long", SATURATED),) * full


def shown(channels: Sequence[Channel]) -> list[Channel]:
    """Choose all coordinates, or of many those that move most, in the file's order."""
    if len(channels) <= MAX_COORDINATES:
        return list(channels)
    most = np.argsort([-np.ptp(channel.value) for channel in channels], kind="stable")[:MAX_COORDINATES]
    return [channels[index] for index in sorted(most)]


def make_grid(channels: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> Grid:
    """Place a column for each branch where there are several of like size; else row by row in the file's order."""
    columns = by_branch(channels, trajectory, scene)
    sizes = [len(column) for column in columns]
    if len(columns) < 2 or max(sizes) > min(MAX_COLUMN_LENGTH, MAX_COLUMN_RATIO * min(sizes)):
        rows = [list(channels[start : start + MAX_COLUMNS]) for start in range(0, len(channels), MAX_COLUMNS)]
        return [[*row, *[None] * (MAX_COLUMNS - len(row))] for row in rows]
    bands = [columns[start : start + MAX_COLUMNS] for start in range(0, len(columns), MAX_COLUMNS)]
    wide = max(map(len, bands))
    return [[*row, *[None] * (wide - len(row))] for band in bands for row in map(list, itertools.zip_longest(*band))]


def by_branch(channels: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> list[list[Channel]]:
    """Group the coordinates by branch; those that hold base bodies come last."""
    names, every = trajectory.body_names, branches(trajectory, scene)
    places = {names[body]: n for n, branch in enumerate(every) for body in branch.bodies}
    bases = {names[branch.bodies[0]] for branch in every if branch.is_base}
    found: dict[int, list[Channel]] = {}
    for channel in channels:
        own = [places[name] for name in channel.joint.bodies if name in places and name not in bases]
        found.setdefault(min(own, default=len(places)), []).append(channel)
    return [found[key] for key in sorted(found)]


def colour_of(channel: Channel, trajectory: Trajectory, scene: Scene) -> str:
    """Return the colour of the body which moves: of the first, but where that is a base body of the second."""
    bases = {trajectory.body_names[branch.bodies[0]] for branch in branches(trajectory, scene) if branch.is_base}
    of_body = dict(zip(trajectory.body_names, colours(trajectory, scene), strict=True))
    names = [name for name in channel.joint.bodies if name in of_body]
    moving = [name for name in names if name not in bases] or names
    return of_body[moving[0]] if moving else palette.BODIES[0]
