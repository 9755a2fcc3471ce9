"""Where joints are in a motion, and their marks in a panel: a dot at the pivot, a bar along the axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from symphys.report import style
from symphys.report.records import Array, Trajectory
from symphys.report.scene_joints import SceneJoint
from symphys.report.scenery import Scene
from symphys.report.views import View, turn

AXES = {"hinge": ((0, 0),), "slider": ((1, 0),), "universal": ((1, 1), (0, 0))}
"""Which axes of a joint are drawn: (side, axis of that side's socket)."""
SQUARE = ("slider", "fixed")
"""Kinds whose mark is a square."""
BAR = 0.065
"""[in] half length of the bar along an axis"""


def on_side(trajectory: Trajectory, joint: SceneJoint, side: int, vector: Array, shot: int, is_point: bool) -> Array:
    """(3,): a point or direction that one side of a joint carries, in the world."""
    name = joint.bodies[side] if side < len(joint.bodies) else ""
    if not name:
        return vector
    body = trajectory.body_names.index(name)
    turned = turn(trajectory.orientation[shot, body], vector)
    return trajectory.position[shot, body] + turned if is_point else turned


def drawable(trajectory: Trajectory, scene: Scene) -> list[SceneJoint]:
    """The joints whose bodies the motion knows."""
    return [joint for joint in scene.joints if set(joint.bodies) <= set(trajectory.body_names)]


def pivot(trajectory: Trajectory, joint: SceneJoint, shot: int) -> Array:
    """(3,) [m]: the point of the first side."""
    return on_side(trajectory, joint, 0, joint.sockets[0].point, shot, True)


def axes_of(joint: SceneJoint) -> list[tuple[int, Array]]:
    """The axes that are drawn: the side that carries each, and its direction (3,) in that side's frame."""
    return [(side, turn(joint.sockets[side].orientation, np.eye(3)[k])) for side, k in AXES.get(joint.kind, ())]


def bones(trajectory: Trajectory, scene: Scene, shot: int) -> Iterator[tuple[int, Array]]:
    """Lines (2, 3) [m] from the centres of bodies to their joints, each with its body."""
    for joint in drawable(trajectory, scene):
        for side, name in enumerate(joint.bodies):
            body = trajectory.body_names.index(name)
            end = on_side(trajectory, joint, side, joint.sockets[side].point, shot, True)
            yield body, np.array([trajectory.position[shot, body], end])


def draw_pivots(axes: Axes, view: View, trajectory: Trajectory, scene: Scene, shot: int, scale: float) -> None:
    """The marks of all joints at one time, on top of all; ``scale`` [in/m]."""
    for joint in drawable(trajectory, scene):
        place = view.flat(pivot(trajectory, joint, shot))
        for side, direction in axes_of(joint):
            half = BAR / scale * view.flat(on_side(trajectory, joint, side, direction, shot, False))
            axes.plot(*np.array([place - half, place + half]).T, color=style.INK, linewidth=0.8, zorder=7)
        shape = "s" if joint.kind in SQUARE else "o"
        axes.plot(
            *place, shape, markersize=2.5, color="white", markeredgecolor=style.INK, markeredgewidth=0.7, zorder=7.1
        )
