"""Where joints are in a motion, and their marks in a panel: a dot at the position, a bar along the axis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from symphys.report.figures import style
from symphys.report.robots.branches import linked
from symphys.report.scene.views import View, centres, turn
from symphys.results.scene import Scene
from symphys.results.scene_joints import SceneJoint
from symphys.trajectory import Trajectory
from symphys.types import Array

BAR = 0.065
"""[in] half length of the bar along an axis"""


def on_side(trajectory: Trajectory, joint: SceneJoint, side: int, vector: Array, shot: int, is_point: bool) -> Array:
    """Return a point or direction (3,) that one side of a joint carries, in the world."""
    name = joint.bodies[side] if side < len(joint.bodies) else ""
    if not name:
        return vector
    body = trajectory.body_names.index(name)
    turned = turn(trajectory.orientation[shot, body], vector)
    return trajectory.position[shot, body] + turned if is_point else turned


def drawable(trajectory: Trajectory, scene: Scene) -> list[SceneJoint]:
    """The joints whose bodies are in the motion."""
    return [joint for joint in scene.joints if set(joint.bodies) <= set(trajectory.body_names)]


def position(trajectory: Trajectory, joint: SceneJoint, shot: int) -> Array:
    """Return the position (3,) [m] of the first side, in the world."""
    return on_side(trajectory, joint, 0, joint.frames[0].point, shot, True)


def axes_of(joint: SceneJoint) -> list[tuple[int, Array]]:
    """The axes that are drawn: the side that carries each, and its direction (3,) in that side's frame."""
    return [(side, turn(joint.frames[side].orientation, np.eye(3)[k])) for side, k in joint.axes]


def bones(trajectory: Trajectory, scene: Scene, shot: int) -> Iterator[tuple[int, Array]]:
    """Yield a body and a line (2, 3) [m] from its centre to each of its joints, and to each solid beside it."""
    for joint in drawable(trajectory, scene):
        for side, name in enumerate(joint.bodies):
            body = trajectory.body_names.index(name)
            end = on_side(trajectory, joint, side, joint.frames[side].point, shot, True)
            yield body, np.array([trajectory.position[shot, body], end])
    for body in linked(trajectory, scene):
        for solid in scene.solids(trajectory.body_names[body]):
            if np.linalg.norm(solid.centre) > solid.girth:
                yield body, np.array([trajectory.position[shot, body], centres(trajectory, body, solid)[shot]])


def draw_joint_positions(axes: Axes, view: View, trajectory: Trajectory, scene: Scene, shot: int, scale: float) -> None:
    """The marks of all joints at one time, on top of all; ``scale`` [in/m]."""
    joints = drawable(trajectory, scene)
    bars = []
    for joint in joints:
        place = view.flat(position(trajectory, joint, shot))
        for side, direction in axes_of(joint):
            half = BAR / scale * view.flat(on_side(trajectory, joint, side, direction, shot, False))
            bars += [place - half, place + half]
    draw_lines(axes, np.array(bars), style.INK, 0.8, 7)
    for shape, rotates in (("o", True), ("s", False)):
        chosen = [position(trajectory, joint, shot) for joint in joints if joint.rotates == rotates]
        if chosen:
            (mark,) = axes.plot(*view.flat(np.array(chosen)).T, shape, color="white", markersize=2.5, zorder=7.1)
            mark.set(markeredgecolor=style.INK, markeredgewidth=0.7)


def draw_lines(axes: Axes, ends: Array, colour: Any, width: float, zorder: float) -> None:
    """Draw lines between each two of these points as one path; ``ends`` holds (2,) points, in any shape."""
    if ends.size:
        pairs = ends.reshape(-1, 2, 2)
        parts = np.concatenate([pairs, np.full((len(pairs), 1, 2), np.nan)], axis=1).reshape(-1, 2)
        axes.plot(*parts.T, color=colour, linewidth=width, zorder=zorder)
