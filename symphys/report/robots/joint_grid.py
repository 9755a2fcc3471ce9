"""Which joints stand where in a figure: those of a limb in a column, or all in the file's order."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from symphys.report.figures import style
from symphys.report.robots.branches import colours, limbs
from symphys.report.robots.joint_use import Channel
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

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
    """A column for each limb where there are several of like size; else the file's order, row by row."""
    columns = by_limb(channels, trajectory, scene)
    sizes = [len(column) for column in columns]
    if len(columns) < 2 or max(sizes) > min(TALL, UNEVEN * min(sizes)):
        rows = [list(channels[start : start + WIDE]) for start in range(0, len(channels), WIDE)]
        return [[*row, *[None] * (WIDE - len(row))] for row in rows]
    bands = [columns[start : start + WIDE] for start in range(0, len(columns), WIDE)]
    wide = max(map(len, bands))
    return [[*row, *[None] * (wide - len(row))] for band in bands for row in map(list, itertools.zip_longest(*band))]


def by_limb(channels: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> list[list[Channel]]:
    """The coordinates of each limb that has some; those that hold trunks come last."""
    places = {trajectory.body_names[body]: n for n, limb in enumerate(limbs(trajectory, scene)) for body in limb.bodies}
    trunks = {trajectory.body_names[limb.bodies[0]] for limb in limbs(trajectory, scene) if limb.is_trunk}
    found: dict[int, list[Channel]] = {}
    for channel in channels:
        own = [places[name] for name in channel.joint.bodies if name in places and name not in trunks]
        found.setdefault(min(own, default=len(places)), []).append(channel)
    return [found[key] for key in sorted(found)]


def colour_of(channel: Channel, trajectory: Trajectory, scene: Scene) -> str:
    """That of the body which moves: of the first, but where that is a trunk of the second."""
    trunks = {trajectory.body_names[limb.bodies[0]] for limb in limbs(trajectory, scene) if limb.is_trunk}
    of_body = dict(zip(trajectory.body_names, colours(trajectory, scene), strict=True))
    names = [name for name in channel.joint.bodies if name in of_body]
    moving = [name for name in names if name not in trunks] or names
    return of_body[moving[0]] if moving else style.BODIES[0]
