"""Pictures of imported robots: where each begins, pale, and where it is in the end; one sheet of all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.problem import Problem
from symphys.report.figures import style
from symphys.report.robots.poses import RobotDrawing, extents
from symphys.report.scene.ground import draw_ground
from symphys.report.scene.panel import ViewPanel
from symphys.report.scene.views import choose_views
from symphys.results.scene_of_problem import make_scene
from symphys.trajectory import Trajectory
from symphys.types import Array

SIZE, DPI = 2.0, 110
"""[in] of a picture, and its dots per inch."""
COLUMNS = 8


def trajectory_of(world: World, states: Array, every: float) -> Trajectory:
    """States (N + 1, nx) that lie ``every`` seconds apart as a motion to draw; what is not drawn is left out."""
    layout, count = Layout(world), len(states)
    fields = {
        field: np.stack([states[:, layout[f"{body.name}.{field}"]] for body in world.bodies], axis=1)
        for field in ("position", "orientation", "velocity", "angular_velocity")
    }
    each = np.zeros(count - 1)
    forces = np.zeros((count - 1, len(world.bodies), 3))
    return Trajectory(
        time=every * np.arange(count),
        body_names=tuple(body.name for body in world.bodies),
        **fields,
        force=forces,
        torque=forces,
        contact_names=(),
        contact_force=np.zeros((count - 1, 0, 3)),
        contact_gap=np.zeros((count, 0)),
        residual=each,
        crowded=each,
        ambiguous=each,
        paradox=each,
        joint_names=(),
        joint_value=np.zeros((count, 0, 0)),
        joint_rate=np.zeros((count, 0, 0)),
        joint_torque=np.zeros((count - 1, 0, 0)),
        joint_command=np.zeros((count - 1, 0, 0)),
        joint_separation=np.zeros((count, 0)),
    )


def picture(problem: Problem, motion: Trajectory, path: Path) -> None:
    """The side view."""
    scene = make_scene(problem, {}, motion)
    view, every = choose_views(motion, scene)[0], range(len(motion.body_names))
    low, high = (np.array(part) for part in extents(motion, scene, view, list(every)))
    low, high = low[[0, -1]].min(axis=0), high[[0, -1]].max(axis=0)
    middle, half = (low + high) / 2, 0.55 * float((high - low).max())
    with style.paper():
        figure = Figure(figsize=(SIZE, SIZE), dpi=DPI)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        draw_ground(axes, ViewPanel(view, middle - half, middle + half), motion, scene)
        RobotDrawing(axes, view, motion, scene, 0).draw(0.25)
        RobotDrawing(axes, view, motion, scene, len(motion.time) - 1).draw(1.0, 1)
        axes.set(xlim=middle[0] + np.array([-half, half]), ylim=middle[1] + np.array([-half, half]), aspect="equal")
        axes.set_title("")
        axes.set_axis_off()
        figure.savefig(path)


def contact_sheet(pictures: Sequence[tuple[str, Path]], path: Path) -> None:
    """All pictures, with their names."""
    if not pictures:
        return
    rows = -(-len(pictures) // COLUMNS)
    with style.paper():
        figure = Figure(figsize=(1.25 * COLUMNS, 1.4 * rows), dpi=DPI)
        FigureCanvasAgg(figure)
        for k, (name, file) in enumerate(pictures):
            axes = figure.add_axes((k % COLUMNS / COLUMNS, 1 - (k // COLUMNS + 1) / rows, 1 / COLUMNS, 0.9 / rows))
            axes.imshow(matplotlib.image.imread(file))
            axes.set_axis_off()
            axes.set_title(name.rpartition("/")[2], fontsize=6, pad=1)
        figure.savefig(path)
