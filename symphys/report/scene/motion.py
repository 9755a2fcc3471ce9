"""The motion seen from the side and from above: path, poses at even times, static surfaces, the guess."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep, thin, vector
from symphys.report.robots.branches import is_large, keys, traced
from symphys.report.robots.joint_positions import draw_joint_positions
from symphys.report.robots.poses import draw_robots
from symphys.report.scene.ground import draw_ground
from symphys.report.scene.panel import RIGHT, ViewPanel, arrange, dress, lay_out, make_panel, widen
from symphys.report.scene.poses import draw_bodies
from symphys.report.scene.views import choose_views
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

MOST_POSES = 300
"""Poses of a body in the figure's table, at most about; trajectory.npz has all."""


def draw_motion(trajectory: Trajectory, scene: Scene, guess: Trajectory | None = None) -> DataFigure:
    """Side and top view of the whole motion, to scale."""
    panels = [make_panel(view, trajectory, scene, guess) for view in choose_views(trajectory, scene)]
    stacked, scale = arrange(panels)
    panels = [widen(panel, scale) for panel in panels]
    figure, places = lay_out(panels, stacked, scale)
    for panel, place in zip(panels, places, strict=True):
        axes = figure.add_axes(place)
        dress(axes, panel, scale)
        draw_ground(axes, panel, trajectory, scene)
        if guess is not None:
            draw_guess(axes, panel, guess, traced(guess, scene))
        if is_large(trajectory, scene):
            draw_robots(axes, panel, trajectory, scene, scale)
        else:
            draw_bodies(axes, panel, trajectory, scene, scale)
            draw_joint_positions(axes, panel.view, trajectory, scene, len(trajectory.time) - 1, scale)
    keep_paths(figure.axes[0], trajectory, traced(trajectory, scene), "")
    if guess is not None:
        keep_paths(figure.axes[0], guess, traced(guess, scene), " at the guess")
    add_legend(figure, trajectory, scene, guess is not None)
    return figure


def keep_paths(axes: Axes, trajectory: Trajectory, names: Sequence[str], whose: str) -> None:
    """Position and orientation of these bodies, thinned: those whose paths are drawn."""
    for body, name in enumerate(trajectory.body_names):
        if name in names:
            place, turned = trajectory.position[:, body], trajectory.orientation[:, body]
            times, poses = thin(trajectory.time, np.concatenate([place, turned], axis=1), MOST_POSES)
            columns = vector(f"{name}.position", "m", poses[:, :3]) | vector(
                f"{name}.orientation", "", poses[:, 3:], "wxyz"
            )
            keep(axes, {TIME: times} | {f"{column}{whose}": values for column, values in columns.items()})


def draw_guess(axes: Axes, panel: ViewPanel, guess: Trajectory, names: Sequence[str]) -> None:
    """The guess's paths of these bodies, thin and grey."""
    for body in (index for index, name in enumerate(guess.body_names) if name in names):
        path = panel.view.flat(guess.position[:, body])
        _, path = thin(guess.time, path, 300)
        axes.plot(*path.T, color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), zorder=2)


def add_legend(figure: DataFigure, trajectory: Trajectory, scene: Scene, guessed: bool) -> None:
    """Bodies or kinematic branches by colour, and the guess; nothing where the picture explains itself."""
    handles = [Line2D([], [], color=colour, label=style.short(name, 20)) for name, colour in keys(trajectory, scene)]
    if guessed:
        handles.append(Line2D([], [], color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), label="guess"))
    if handles:
        height = figure.get_figheight()
        anchor = (1 - RIGHT / style.WIDTH, 1 - 0.08 / height)
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=anchor, ncols=len(handles), borderaxespad=0)
