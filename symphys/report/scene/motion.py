"""The motion seen from the side and from above: path, poses at even times, static surfaces, the guess."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon

from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.charts.tables import TIME, thin, vector
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure, keep
from symphys.report.robots.branches import is_large, keys, traced
from symphys.report.robots.joint_marks import draw_joint_positions
from symphys.report.robots.poses import draw_robots
from symphys.report.scene.ground import draw_ground
from symphys.report.scene.panel import RIGHT, ViewPanel, arrange, dress, lay_out, make_panel, widen
from symphys.report.scene.views import (
    View,
    centres,
    choose_views,
    corners,
    half_axes,
    inner_edges,
    outline,
    reach,
    solids_of,
    turn,
)
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

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
    """Draw the guess's paths of these bodies, thin and grey."""
    for body in (index for index, name in enumerate(guess.body_names) if name in names):
        path = panel.view.flat(guess.position[:, body])
        _, path = thin(guess.time, path, 300)
        axes.plot(*path.T, color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), zorder=2)


def add_legend(figure: DataFigure, trajectory: Trajectory, scene: Scene, guessed: bool) -> None:
    """Bodies or kinematic branches by colour, and the guess; nothing where the picture explains itself."""
    handles = [Line2D([], [], color=colour, label=palette.short(name, 20)) for name, colour in keys(trajectory, scene)]
    if guessed:
        handles.append(Line2D([], [], color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), label="guess"))
    if handles:
        height = figure.get_figheight()
        anchor = (1 - RIGHT / style.WIDTH, 1 - 0.08 / height)
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=anchor, ncols=len(handles), borderaxespad=0)


MAX_LABELLED_BODIES = 3
MAX_SOLIDS = 220
"""How many solids are drawn in a panel, at most about."""


def draw_bodies(axes: Axes, panel: ViewPanel, trajectory: Trajectory, scene: Scene, scale: float) -> None:
    """Path and poses of every body; the first and last one of few, which no joint holds, are named."""
    bodies = range(len(trajectory.body_names))
    total = sum(len(solids_of(trajectory, scene, body)) for body in bodies)
    shots = np.linspace(0, len(trajectory.time) - 1, int(np.clip(MAX_SOLIDS // total, 3, 10))).round().astype(int)
    for body in bodies:
        colour = palette.BODIES[body % len(palette.BODIES)]
        _, path = thin(trajectory.time, panel.view.flat(trajectory.position[:, body]), 500)
        axes.plot(*path.T, color=colour, linewidth=1.3 if total < 10 else 0.7, zorder=3)
        solids = solids_of(trajectory, scene, body)
        for shot in apart(trajectory, panel.view, body, solids, shots):
            strength = 0.08 + 0.3 * shot / max(int(shots[-1]), 1)
            for solid in solids:
                BodyDrawing(axes, panel.view, colour, strength, shot == shots[-1]).draw(trajectory, body, solid, shot)
        if len(bodies) <= MAX_LABELLED_BODIES and not scene.joints:
            name_ends(axes, panel, trajectory, reach(trajectory, scene, body), body, scale)


def apart(trajectory: Trajectory, view: View, body: int, solids: Sequence[Solid], shots: Array) -> list[int]:
    """Return the poses in which some solid lies well off its place in the one kept after them; the last is kept."""
    marks = np.stack([marked(trajectory, view, body, solid) for solid in solids], axis=1)
    least = np.array([0.35 * (solid.radius + solid.half.max()) for solid in solids])
    kept = [int(shots[-1])]
    for shot in shots[-2::-1]:
        moved = np.linalg.norm(marks[shot] - marks[kept[-1]], axis=-1).max(axis=-1)
        if (moved >= least).any():
            kept.append(int(shot))
    return kept[::-1]


def marked(trajectory: Trajectory, view: View, body: int, solid: Solid) -> Array:
    """Return the seen places (N+1, 4, 2) [m] of a solid's centre, and of the ends of its box's half axes."""
    middle = centres(trajectory, body, solid)[:, None]
    tips = middle + half_axes(trajectory.orientation[:, body], solid)
    return view.flat(np.concatenate([middle, tips], axis=1))


@dataclass(frozen=True)
class BodyDrawing:
    """The look of a body at one time: its colour, paler the earlier, with thicker lines the last."""

    axes: Axes
    view: View
    colour: str
    strength: float
    last: bool

    def draw(self, trajectory: Trajectory, body: int, solid: Solid, shot: int) -> None:
        """Draw the outline of a solid, and inside it what shows how the body is turned."""
        centre = self.view.flat(centres(trajectory, body, solid)[shot])
        orientation = trajectory.orientation[shot, body]
        ends = self.view.flat(corners(orientation, solid))
        if solid.radius == 0 and solid.is_ball:
            self.axes.plot(*centre, "o", color=self.colour, markersize=4, alpha=0.3 + self.strength, zorder=4)
            return
        around = centre + outline(ends, solid.radius)
        self.fill(Circle((centre[0], centre[1]), solid.radius) if solid.is_ball else Polygon(around))
        if solid.is_ball:
            tip = solid.radius * self.view.flat(spoke(trajectory.orientation[:, body], self.view)[shot])
            self.line(centre, np.array([np.zeros(2), tip]))
        elif len(ends) == 2:
            self.line(centre, ends)
        for edge in inner_edges(orientation, solid, self.view.front):
            self.line(centre, self.view.flat(edge))

    @property
    def width(self) -> float:
        """[pt] of lines."""
        return 1.4 if self.last else 0.8

    def fill(self, patch: Circle | Polygon) -> None:
        """Draw a pale area with a line around it."""
        edge = copy(patch)
        patch.set(facecolor=self.colour, alpha=self.strength, linewidth=0, zorder=2.5)
        edge.set(fill=False, edgecolor=self.colour, linewidth=self.width, zorder=3)
        self.axes.add_patch(patch)
        self.axes.add_patch(edge)

    def line(self, centre: Array, ends: Array) -> None:
        """Draw a line inside the outline."""
        self.axes.plot(*(centre + ends).T, color=self.colour, linewidth=self.width, zorder=3.2)


def spoke(orientation: Array, view: View) -> Array:
    """Return the body axis (N+1, 3) whose turning is seen best, in the world."""

    def seen(axis: Array) -> float:
        flat = view.flat(axis)
        return float(flat.var(axis=0).sum() + 1e-3 * np.linalg.norm(flat, axis=1).mean())

    return max((turn(orientation, direction) for direction in np.eye(3)), key=seen)


def name_ends(axes: Axes, panel: ViewPanel, trajectory: Trajectory, radius: float, body: int, scale: float) -> None:
    """Write ``start`` and ``end`` at a body's first and last place; the end below where both are close."""
    colour = palette.BODIES[body % len(palette.BODIES)]
    first, last = panel.view.flat(trajectory.position[[0, -1], body])
    apart = np.abs(last - first) * scale
    close = apart[0] < 0.55 and apart[1] < 0.3
    for text, place, above in (("start", first, True), ("end", last, not close)):
        up = above != panel.view.down
        axes.annotate(
            text,
            place + np.array([0.0, radius if up else -radius]),
            xytext=(0, 4 if above else -4),
            textcoords="offset points",
            ha="center",
            va="bottom" if above else "top",
            color=colour,
            fontweight="bold",
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            zorder=6,
        )
