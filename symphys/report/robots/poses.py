"""Poses over time of robots, drawn whole: nearer solids hide those behind, so that legs can be told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Polygon

from symphys.records import dataclass
from symphys.report.charts.tables import thin
from symphys.report.robots.branches import colours, linked, traced
from symphys.report.robots.joint_marks import draw_joint_positions, draw_lines
from symphys.report.robots.joint_positions import bones
from symphys.report.scene.panel import ViewPanel
from symphys.report.scene.views import View, centres, corners, inner_edges, outline, reach, turn
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

MIN_POSE_DISTANCE = 0.75
"""Poses in one picture are apart by this share of the robot's length at least."""
MAX_POSES = 8


def draw_robots(axes: Axes, panel: ViewPanel, trajectory: Trajectory, scene: Scene, scale: float) -> None:
    """Paths of base bodies and feet, and whole poses that hardly cover each other, the later the stronger."""
    draw_paths(axes, panel.view, trajectory, scene)
    shots = spaced(trajectory, scene, panel.view)
    for order, shot in enumerate(shots):
        strength = 1.0 if shot == shots[-1] else 0.3 + 0.35 * shot / max(shots[-1], 1)
        RobotDrawing(axes, panel.view, trajectory, scene, shot).draw(strength, order)
    draw_joint_positions(axes, panel.view, trajectory, scene, shots[-1], scale)


def spaced(trajectory: Trajectory, scene: Scene, view: View) -> list[int]:
    """Return the poses: first, last and between at even distances, if linked bodies go far enough; else the last."""
    low, high = extents(trajectory, scene, view, linked(trajectory, scene))
    middle = (low + high) / 2 - (low[0] + high[0]) / 2
    least = np.abs(middle).max() / (MIN_POSE_DISTANCE * MAX_POSES)  # of robots without extent, all poses may be drawn
    gone = middle / np.maximum((high - low).max(axis=0), least if least > 0 else 1.0)
    along = gone[:, np.abs(gone[-1]).argmax()]
    parts = min(int(abs(along[-1]) / MIN_POSE_DISTANCE), MAX_POSES)
    return sorted({int(np.abs(along - along[-1] * part / parts).argmin()) for part in range(parts)} | {len(along) - 1})


def extents(trajectory: Trajectory, scene: Scene, view: View, bodies: Sequence[int]) -> tuple[Array, Array]:
    """Return the lowest and the highest seen coordinates (N+1, 2) [m] of these bodies at each time."""
    low, high = [], []
    for body in bodies:
        if not scene.solids(trajectory.body_names[body]):
            middle, size = view.flat(trajectory.position[:, body]), reach(trajectory, scene, body)
            low.append(middle - size)
            high.append(middle + size)
        for solid in scene.solids(trajectory.body_names[body]):
            middle = view.flat(centres(trajectory, body, solid))
            ends = view.flat(corners(trajectory.orientation[:, body], solid))
            low.append(middle + ends.min(axis=1) - solid.radius)
            high.append(middle + ends.max(axis=1) + solid.radius)
    return np.min(low, axis=0), np.max(high, axis=0)


def draw_paths(axes: Axes, view: View, trajectory: Trajectory, scene: Scene) -> None:
    """Draw the paths of base bodies and of the bodies at the ends of branches."""
    kept = traced(trajectory, scene)
    for body, colour in enumerate(colours(trajectory, scene)):
        if trajectory.body_names[body] in kept:
            _, path = thin(trajectory.time, view.flat(trajectory.position[:, body]), 500)
            axes.plot(*path.T, color=colour, linewidth=0.8, alpha=0.6, zorder=2.2)


@dataclass(frozen=True)
class RobotDrawing:
    """A drawing of all bodies of a scene at one time."""

    axes: Axes
    view: View
    trajectory: Trajectory
    scene: Scene
    shot: int

    def draw(self, strength: float = 1.0, order: int = 0) -> None:
        """Draw from the back to the front; paler with less ``strength``, over poses of a lower ``order``."""
        colour = colours(self.trajectory, self.scene)
        base = 2.5 + 0.25 * order / MAX_POSES
        lines = list(bones(self.trajectory, self.scene, self.shot))
        for each in dict.fromkeys(colour[body] for body, _ in lines):
            ends = [self.view.flat(line) for body, line in lines if colour[body] == each]
            draw_lines(self.axes, np.array(ends), tuple(mixed(each, strength)), 1.6, base)
        solids = sorted(self.solids(), key=lambda entry: entry[0])
        for rank, (_, body, solid) in enumerate(solids):
            self.draw_solid(body, solid, mixed(colour[body], strength), base + 0.02 * (1 + rank) / (1 + len(solids)))

    def solids(self) -> list[tuple[float, int, Solid]]:
        """Each with its body, and with how near it is to the viewer; a point for what is free and has no surface."""
        held = linked(self.trajectory, self.scene)
        return [
            (float(centres(self.trajectory, body, solid)[self.shot] @ self.view.front), body, solid)
            for body, name in enumerate(self.trajectory.body_names)
            for solid in self.scene.solids(name) or (() if body in held else (Solid(),))
        ]

    def draw_solid(self, body: int, solid: Solid, colour: Array, zorder: float) -> None:
        """Draw the outline of a solid, filled, and the edges that are seen in it."""
        turned = self.trajectory.orientation[self.shot, body]
        centre = self.view.flat(self.trajectory.position[self.shot, body] + turn(turned, solid.centre))
        if solid.radius == 0 and solid.is_ball:
            self.axes.plot(*centre, "o", color=tuple(colour), markersize=3, zorder=zorder)
            return
        around = centre + outline(self.view.flat(corners(turned, solid)), solid.radius)
        patch = Circle((centre[0], centre[1]), solid.radius) if solid.is_ball else Polygon(around)
        patch.set(facecolor=tuple(mixed(colour, 0.42)), edgecolor=tuple(colour), linewidth=0.8, zorder=zorder)
        self.axes.add_patch(patch)
        edges = centre + self.view.flat(inner_edges(turned, solid, self.view.front))
        draw_lines(self.axes, edges, tuple(colour), 0.6, zorder)


def mixed(colour: str | Array, strength: float) -> Array:
    """Return a colour (3,) mixed with white."""
    own = np.array(to_rgb(colour if isinstance(colour, str) else tuple(colour)))
    return 1 - strength * (1 - own)
