"""Marks of joints in a figure: a dot at the position, a bar along the axis."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from symphys.report.charts import palette
from symphys.report.robots.joint_positions import axes_of, drawable, on_side, position
from symphys.report.scene.views import View
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array

BAR = 0.065
"""[in] half length of the bar along an axis"""


def draw_joint_positions(axes: Axes, view: View, trajectory: Trajectory, scene: Scene, shot: int, scale: float) -> None:
    """Draw the marks of all joints at one time, on top of all; ``scale`` [in/m]."""
    joints = drawable(trajectory, scene)
    bars = []
    for joint in joints:
        place = view.flat(position(trajectory, joint, shot))
        for side, direction in axes_of(joint):
            half = BAR / scale * view.flat(on_side(trajectory, joint, side, direction, shot, False))
            bars += [place - half, place + half]
    draw_lines(axes, np.array(bars), palette.INK, 0.8, 7)
    for shape, rotates in (("o", True), ("s", False)):
        chosen = [position(trajectory, joint, shot) for joint in joints if joint.rotates == rotates]
        if chosen:
            (mark,) = axes.plot(*view.flat(np.array(chosen)).T, shape, color="white", markersize=2.5, zorder=7.1)
            mark.set(markeredgecolor=palette.INK, markeredgewidth=0.7)


def draw_lines(axes: Axes, ends: Array, colour: Any, width: float, zorder: float) -> None:
    """Draw lines between each two of these points as one path; ``ends`` holds (2,) points, in any shape."""
    if ends.size:
        pairs = ends.reshape(-1, 2, 2)
        parts = np.concatenate([pairs, np.full((len(pairs), 1, 2), np.nan)], axis=1).reshape(-1, 2)
        axes.plot(*parts.T, color=colour, linewidth=width, zorder=zorder)
