"""The motion seen from the side and from above: path, snapshots at even times, planes, the guess."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon

from symphys.report import style
from symphys.report.records import Array, Scene, ScenePlane, Trajectory
from symphys.report.views import NAMES, View, balls_of, centres, choose_views, reach, turn

LEFT, RIGHT, BOTTOM, TOP, GAP = 0.62, 0.15, 0.5, 0.5, 0.62
"""[in] margins of the figure and between its panels"""
LEAST = 1.1
"""[in] smallest width or height of a panel"""
MOST_LABELLED = 3
CIRCLES = 220


@dataclass(frozen=True)
class Panel:
    """A view and the window (low, high) x (right, up) [m] that it shows."""

    view: View
    low: Array
    high: Array

    @property
    def span(self) -> Array:
        """(2,) [m]: width and height."""
        return self.high - self.low


def draw_motion(trajectory: Trajectory, scene: Scene, guess: Trajectory | None = None) -> Figure:
    """Side and top view of the whole motion, to scale."""
    panels = [make_panel(view, trajectory, scene, guess) for view in choose_views(trajectory, scene)]
    stacked, scale = arrange(panels)
    panels = [widen(panel, scale) for panel in panels]
    figure, places = lay_out(panels, stacked, scale)
    for panel, place in zip(panels, places, strict=True):
        axes = figure.add_axes(place)
        dress(axes, panel, scale)
        draw_planes(axes, panel, trajectory, scene)
        if guess is not None:
            draw_guess(axes, panel, guess)
        draw_bodies(axes, panel, trajectory, scene, scale)
    add_legend(figure, trajectory, guess is not None)
    return figure


def make_panel(view: View, trajectory: Trajectory, scene: Scene, guess: Trajectory | None) -> Panel:
    """The window that holds every sphere, the planes close by, and the guess unless it goes far away."""
    sizes = np.array([reach(trajectory, scene, body) for body in range(len(trajectory.body_names))])[:, None]
    flat = view.flat(trajectory.position)
    low, high = (flat - sizes).min(axis=(0, 1)), (flat + sizes).max(axis=(0, 1))
    room = max(float((high - low).max()), 1e-6)
    if guess is not None:
        path = view.flat(guess.position)
        low = np.maximum(np.minimum(low, path.min(axis=(0, 1))), low - 0.25 * room)
        high = np.minimum(np.maximum(high, path.max(axis=(0, 1))), high + 0.25 * room)
    for plane in scene.planes:
        low, high = include(plane, view, low, high, 0.25 * room)
    margin = 0.05 * room
    return Panel(view, low - margin, high + margin)


def include(plane: ScenePlane, view: View, low: Array, high: Array, room: float) -> tuple[Array, Array]:
    """Widen a window by at most ``room`` to take in a plane that stands along one of its edges."""
    normal = view.flat(plane.normal)
    for axis in range(2):
        if abs(normal[axis]) > 0.99:
            place = plane.offset / normal[axis]
            low[axis] = place if low[axis] - room < place < low[axis] else low[axis]
            high[axis] = place if high[axis] < place < high[axis] + room else high[axis]
    return low, high


def arrange(panels: list[Panel]) -> tuple[bool, float]:
    """Whether the panels stand above each other, and the scale [in/m]: the arrangement that shows more."""
    spans = np.array([panel.span for panel in panels])
    width = style.WIDTH - LEFT - RIGHT
    stacked = min(width / spans[:, 0].max(), (4.6 if len(panels) == 1 else 6.2) / spans[:, 1].sum())
    beside = min((width - (len(panels) - 1) * (LEFT + 0.2)) / spans[:, 0].sum(), 4.6 / spans[:, 1].max())
    return (True, float(stacked)) if stacked >= beside else (False, float(beside))


def widen(panel: Panel, scale: float) -> Panel:
    """Make room on both sides where a panel would be too thin to read."""
    lack = np.maximum(LEAST / scale - panel.span, 0) / 2
    return Panel(panel.view, panel.low - lack, panel.high + lack)


def lay_out(panels: list[Panel], stacked: bool, scale: float) -> tuple[Figure, list[tuple[float, float, float, float]]]:
    """The figure, and (left, bottom, width, height) of each panel in shares of it."""
    sizes = [panel.span * scale for panel in panels]
    gaps = GAP * (len(panels) - 1)
    height = (sum(s[1] for s in sizes) + gaps if stacked else max(s[1] for s in sizes)) + BOTTOM + TOP
    figure = Figure(figsize=(style.WIDTH, height))
    places = []
    widths = [float(size[0]) for size in sizes]
    used = max(widths) if stacked else sum(widths) + (len(sizes) - 1) * (LEFT + 0.2)
    left, top = LEFT + (style.WIDTH - LEFT - RIGHT - used) / 2, height - TOP
    for size in sizes:
        width, tall = float(size[0]), float(size[1])
        places.append((left / style.WIDTH, (top - tall) / height, width / style.WIDTH, tall / height))
        left, top = (left, top - size[1] - GAP) if stacked else (left + size[0] + LEFT + 0.2, top)
    return figure, places


def dress(axes: Axes, panel: Panel, scale: float) -> None:
    """Axes to scale with names and units."""
    view = panel.view
    vertical = [panel.low[1], panel.high[1]]
    axes.set(xlim=(panel.low[0], panel.high[0]), ylim=vertical[::-1] if view.down else vertical, aspect="equal")
    axes.set_xlabel(f"{NAMES[view.right]} [m]", labelpad=2)
    axes.set_ylabel(f"{NAMES[view.up]} [m]", labelpad=3)
    axes.set_title(view.title)
    width, height = panel.span * scale
    style.set_linear(axes, "x", int(np.clip(width, 2, 9)))
    style.set_linear(axes, "y", int(np.clip(1.6 * height, 2, 6)))


def draw_planes(axes: Axes, panel: Panel, trajectory: Trajectory, scene: Scene) -> None:
    """The solid side of every plane that is seen from its edge, cut at the middle of the motion's depth."""
    depth = float(np.median(trajectory.position[..., panel.view.depth]))
    middle, size = (panel.low + panel.high) / 2, float(np.linalg.norm(panel.span))
    for plane in scene.planes:
        normal = panel.view.flat(plane.normal)
        length = float(np.linalg.norm(normal))
        if length < 0.3:
            continue
        offset = (plane.offset - plane.normal[panel.view.depth] * depth) / length
        normal = normal / length
        foot = middle + (offset - normal @ middle) * normal
        along = size * np.array([-normal[1], normal[0]])
        corners = np.array([foot - along, foot + along, foot + along - size * normal, foot - along - size * normal])
        # The line lies under every solid, so that it ends where another plane's solid begins.
        axes.plot(*corners[:2].T, color=style.GROUND_EDGE, linewidth=2.2, zorder=1.5)
        axes.add_patch(
            Polygon(corners, facecolor=style.GROUND, edgecolor="#d5dbe1", hatch="////", linewidth=0, zorder=1.6)
        )


def draw_guess(axes: Axes, panel: Panel, guess: Trajectory) -> None:
    """The guess's path, thin and grey."""
    for body in range(len(guess.body_names)):
        path = panel.view.flat(guess.position[:, body])
        _, path = style.thin(guess.time, path, 300)
        axes.plot(*path.T, color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), zorder=2)


def draw_bodies(axes: Axes, panel: Panel, trajectory: Trajectory, scene: Scene, scale: float) -> None:
    """Path and snapshots of every body; the first and last one named where there is room."""
    bodies = range(len(trajectory.body_names))
    total = sum(len(balls_of(trajectory, scene, body)) for body in bodies)
    shots = np.linspace(0, len(trajectory.time) - 1, int(np.clip(CIRCLES // total, 3, 10))).round().astype(int)
    for body in bodies:
        colour = style.BODIES[body % len(style.BODIES)]
        _, path = style.thin(trajectory.time, panel.view.flat(trajectory.position[:, body]), 500)
        axes.plot(*path.T, color=colour, linewidth=1.3 if total < 10 else 0.7, zorder=3)
        draw_snapshots(axes, panel.view, trajectory, scene, body, shots)
        if len(bodies) <= MOST_LABELLED:
            name_ends(axes, panel, trajectory, reach(trajectory, scene, body), body, scale)


def draw_snapshots(axes: Axes, view: View, trajectory: Trajectory, scene: Scene, body: int, shots: Array) -> None:
    """Circles with a spoke that turns with the body, paler the earlier they are."""
    colour = style.BODIES[body % len(style.BODIES)]
    spokes = view.flat(spoke(trajectory.orientation[:, body], view))
    for ball in balls_of(trajectory, scene, body):
        path = view.flat(centres(trajectory, body, ball))
        for shot in apart(path, shots, 0.35 * ball.radius):
            strength = 0.08 + 0.3 * shot / max(int(shots[-1]), 1)
            centre, last = path[shot], shot == shots[-1]
            if ball.radius == 0:
                axes.plot(*centre, "o", color=colour, markersize=4, alpha=0.3 + strength, zorder=4)
                continue
            axes.add_patch(Circle(centre, ball.radius, facecolor=colour, alpha=strength, linewidth=0, zorder=2.5))
            width = 1.4 if last else 0.8
            axes.add_patch(Circle(centre, ball.radius, fill=False, edgecolor=colour, linewidth=width, zorder=3))
            tip = centre + ball.radius * spokes[shot]
            axes.plot(*np.array([centre, tip]).T, color=colour, linewidth=width, zorder=3.2)


def apart(path: Array, shots: Array, least: float) -> list[int]:
    """The snapshots that lie at least ``least`` from the one kept after them; the last is kept."""
    kept = [int(shots[-1])]
    for shot in shots[-2::-1]:
        if np.linalg.norm(path[shot] - path[kept[-1]]) >= least:
            kept.append(int(shot))
    return kept[::-1]


def spoke(orientation: Array, view: View) -> Array:
    """(N+1, 3): the body axis whose turning is seen best, in the world."""

    def seen(axis: Array) -> float:
        flat = view.flat(axis)
        return float(flat.var(axis=0).sum() + 1e-3 * np.linalg.norm(flat, axis=1).mean())

    return max((turn(orientation, direction) for direction in np.eye(3)), key=seen)


def name_ends(axes: Axes, panel: Panel, trajectory: Trajectory, radius: float, body: int, scale: float) -> None:
    """Write ``start`` and ``end`` at a body's first and last place; the end below where both are close."""
    colour = style.BODIES[body % len(style.BODIES)]
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


def add_legend(figure: Figure, trajectory: Trajectory, guessed: bool) -> None:
    """Bodies by colour, and the guess; nothing where the picture explains itself."""
    names = trajectory.body_names
    handles = []
    if 1 < len(names) <= len(style.BODIES):
        colours = itertools.cycle(style.BODIES)
        handles = [Line2D([], [], color=next(colours), label=style.short(name, 20)) for name in names]
    if guessed:
        handles.append(Line2D([], [], color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), label="guess"))
    if handles:
        height = figure.get_figheight()
        anchor = (1 - RIGHT / style.WIDTH, 1 - 0.08 / height)
        figure.legend(handles=handles, loc="upper right", bbox_to_anchor=anchor, ncols=len(handles), borderaxespad=0)
