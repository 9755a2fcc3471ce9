"""A motion of bodies connected by joints as a strip of pictures at even times: side view above, top view below.

The section shown follows bodies that travel far to the right or the left; up and down it is fixed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from symphys.records import dataclass
from symphys.report.charts.tables import TIME, vector
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure, keep
from symphys.report.robots.branches import linked
from symphys.report.robots.joint_marks import draw_joint_positions
from symphys.report.robots.poses import RobotDrawing, extents
from symphys.report.scene.ground import draw_ground
from symphys.report.scene.panel import ViewPanel, include
from symphys.report.scene.views import NAMES, View, choose_views
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array

LEFT, RIGHT, BOTTOM, TOP, GAP, BETWEEN = 0.72, 0.1, 0.42, 0.3, 0.1, 0.18
"""[in] margins, and gaps between columns and rows"""
TALLEST, LOWEST = 2.4, 0.75
"""[in] a picture is at most and at least"""
MAX_EXTENT, MAX_EXTENT_GROUNDED = 2.0, 6.0
"""The section shown is fixed where all fits into so many sizes of the bodies: free ones, and those on the world."""
POINT_SHARE = 1e-6
"""The whole view is shown, too, where the bodies are less than this share of it."""
MARGIN = 0.06
LABEL_MARGIN = 0.14
"""[in] Numbers are at least so far from the sides of a picture, so that those of neighbours do not meet."""


@dataclass(frozen=True)
class Strip:
    """Sections that are equally large: ``low`` (shots, 2) [m] are their corners, ``size`` (2,) [m]."""

    view: View
    low: Array
    size: Array


def draw_strip(trajectory: Trajectory, scene: Scene) -> DataFigure | None:
    """Draw the strip; None where no joint holds bodies that move."""
    if not linked(trajectory, scene) or len(trajectory.time) < 2:
        return None
    views = choose_views(trajectory, scene)
    every = list(range(len(trajectory.time)))
    shots = even_shots(len(every), make_strip(views[0], trajectory, scene, every).size)
    strips = [make_strip(view, trajectory, scene, shots) for view in views]
    width = (style.WIDTH - LEFT - RIGHT - GAP * (len(shots) - 1)) / len(shots)
    scale = min(width / max(strip.size[0] for strip in strips), *(TALLEST / strip.size[1] for strip in strips))
    strips = [widened(strip, width / scale, LOWEST / scale) for strip in strips]
    figure, places = lay_out(strips, width, scale)
    for row, strip in enumerate(strips):
        for column, shot in enumerate(shots):
            axes = figure.add_axes(places[row][column])
            panel = ViewPanel(strip.view, strip.low[column], strip.low[column] + strip.size)
            draw_frame(axes, panel, trajectory, scene, shot, scale)
            dress_frame(axes, panel, scale, column == 0, row == len(strips) - 1)
            axes.set_title(f"{trajectory.time[shot]:.2f} s" if row == 0 else "")
    keep_poses(figure.axes[0], trajectory, linked(trajectory, scene), shots)
    return figure


def keep_poses(axes: Axes, trajectory: Trajectory, bodies: Sequence[int], shots: Sequence[int]) -> None:
    """Position and orientation of bodies in the pictures."""
    for body in bodies:
        name = trajectory.body_names[body]
        place = vector(f"{name}.position", "m", trajectory.position[shots, body])
        turned = vector(f"{name}.orientation", "", trajectory.orientation[shots, body], "wxyz")
        keep(axes, {TIME: trajectory.time[shots]} | place | turned)


Place = tuple[float, float, float, float]
"""(left, bottom, width, height) in shares of a figure."""


def lay_out(strips: Sequence[Strip], width: float, scale: float) -> tuple[DataFigure, list[list[Place]]]:
    """Return the figure, and the places of its pictures, each ``width`` [in] wide, strip by strip."""
    heights = [float(strip.size[1]) * scale for strip in strips]
    total = TOP + BOTTOM + sum(heights) + BETWEEN * (len(strips) - 1)
    places: list[list[Place]] = []
    top = total - TOP
    for strip, height in zip(strips, heights, strict=True):
        lefts = [LEFT + column * (width + GAP) for column in range(len(strip.low))]
        shares = width / style.WIDTH, height / total
        places.append([(left / style.WIDTH, (top - height) / total, *shares) for left in lefts])
        top -= height + BETWEEN
    return DataFigure(figsize=(style.WIDTH, total)), places


def even_shots(count: int, size: Array) -> list[int]:
    """Even times, more of them the slimmer the section is."""
    number = int(np.clip(round(8 * size[1] / size[0]), 4, 8))
    return [int(shot) for shot in np.unique(np.linspace(0, count - 1, number).round())]


def make_strip(view: View, trajectory: Trajectory, scene: Scene, shots: Sequence[int]) -> Strip:
    """Return the sections of these shots, and the ground where it is near."""
    low, high = (part[list(shots)] for part in extents(trajectory, scene, view, linked(trajectory, scene)))
    size, middle = (high - low).max(axis=0), (low + high) / 2
    least, most = style.apart(low.min(axis=0), high.max(axis=0))
    union = most - least
    far = MAX_EXTENT if all(joint.second for joint in scene.joints) else MAX_EXTENT_GROUNDED
    still = np.array([union[0] <= far * size[0] or size.max() <= POINT_SHARE * union.max(), True])
    size = np.where(still, union, size)
    corner = np.where(still, least, middle - size / 2)
    room = float(size.max())
    bottom, top = corner.min(axis=0), (corner + size).max(axis=0)
    for plane in scene.planes:
        bottom, top = include(plane, view, bottom, top, 0.25 * room)
    below = np.where(still, corner.min(axis=0) - bottom, 0)
    size = size + np.where(still, top - bottom - size, 0)
    return Strip(view, corner - below - MARGIN * room, size + 2 * MARGIN * room)


def widened(strip: Strip, width: float, height: float) -> Strip:
    """Widen sections to the width of their column, and to a least height [m]."""
    lack = np.array([width - strip.size[0], max(height - strip.size[1], 0.0)])
    return Strip(strip.view, strip.low - lack / 2, strip.size + lack)


def draw_frame(axes: Axes, panel: ViewPanel, trajectory: Trajectory, scene: Scene, shot: int, scale: float) -> None:
    """Static surfaces, the bodies at one time, and their joints."""
    draw_ground(axes, panel, trajectory, scene)
    axes.set_title("")
    RobotDrawing(axes, panel.view, trajectory, scene, shot).draw()
    draw_joint_positions(axes, panel.view, trajectory, scene, shot, scale)


def dress_frame(axes: Axes, panel: ViewPanel, scale: float, first: bool, bottom: bool) -> None:
    """Axes to scale; numbers along the left and below only."""
    view = panel.view
    vertical = [panel.low[1], panel.high[1]]
    axes.set(xlim=(panel.low[0], panel.high[0]), ylim=vertical[::-1] if view.down else vertical, aspect="equal")
    width, height = panel.span * scale
    style.set_linear(axes, "x", int(np.clip(3.2 * width, 2, 6)))
    style.set_linear(axes, "y", int(np.clip(2.2 * height, 2, 5)))
    axes.set_xticks(inside(axes.get_xticks(), panel.low[0], panel.high[0], LABEL_MARGIN / scale))
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.patch.set_facecolor("#fafbfc")
    axes.tick_params(labelleft=first, labelbottom=bottom)
    axes.set_ylabel(f"{view.title}\n{NAMES[view.up]} [m]" if first else "", labelpad=3)
    axes.set_xlabel(f"{NAMES[view.right]} [m]" if bottom and first else "", labelpad=2, loc="left")


def inside(ticks: Array, low: float, high: float, edge: float) -> Array:
    """Return the ticks that are well within a section."""
    return ticks[(ticks > low + edge) & (ticks < high - edge)]
