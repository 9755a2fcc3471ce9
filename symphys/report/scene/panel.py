"""The panels of a picture of a motion: what each shows, and where it stands in the figure."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from symphys.records import dataclass
from symphys.report.figures import style
from symphys.report.figures.data import DataFigure
from symphys.report.scene.views import NAMES, View, corners, reach
from symphys.results.scene import UPRIGHT, Scene, SceneFixture, ScenePlane, SceneTerrain
from symphys.trajectory import Trajectory
from symphys.types import Array

LEFT, RIGHT, BOTTOM, TOP, GAP = 0.62, 0.15, 0.5, 0.5, 0.62
"""[in] margins of the figure and between its panels"""
MIN_PANEL_SIZE = 1.1
"""[in] smallest width or height of a panel"""


@dataclass(frozen=True)
class ViewPanel:
    """A view and the rectangle (low, high) x (right, up) [m] that it shows."""

    view: View
    low: Array
    high: Array

    @property
    def span(self) -> Array:
        """Return width and height (2,) [m]."""
        return self.high - self.low


def make_panel(view: View, trajectory: Trajectory, scene: Scene, guess: Trajectory | None) -> ViewPanel:
    """Return the rectangle that holds every body, nearby static surfaces, and the guess unless it goes far away."""
    sizes = np.array([reach(trajectory, scene, body) for body in range(len(trajectory.body_names))])[:, None]
    flat = view.flat(trajectory.position)
    low, high = style.apart((flat - sizes).min(axis=(0, 1)), (flat + sizes).max(axis=(0, 1)))
    room = float((high - low).max())
    if guess is not None:
        path = view.flat(guess.position)
        low = np.maximum(np.minimum(low, path.min(axis=(0, 1))), low - 0.25 * room)
        high = np.minimum(np.maximum(high, path.max(axis=(0, 1))), high + 0.25 * room)
    for plane in scene.planes:
        low, high = include(plane, view, low, high, 0.25 * room)
    for box in (*map(of_fixture, scene.fixtures), *map(of_terrain, scene.terrain)):
        low, high = take_in(view.flat(box), low, high, 0.25 * room)
    margin = 0.05 * room
    return ViewPanel(view, low - margin, high + margin)


def include(plane: ScenePlane, view: View, low: Array, high: Array, room: float) -> tuple[Array, Array]:
    """Widen a rectangle by at most ``room`` to take in a plane that stands along one of its edges."""
    normal = view.flat(plane.normal)
    for axis in range(2):
        if abs(normal[axis]) > 0.99:
            place = plane.offset / normal[axis]
            low[axis] = place if low[axis] - room < place < low[axis] else low[axis]
            high[axis] = place if high[axis] < place < high[axis] + room else high[axis]
    return low, high


def of_fixture(fixture: SceneFixture) -> Array:
    """Return the lowest and the highest coordinates (2, 3) [m] of a fixture."""
    solid = fixture.solid
    around = solid.centre + corners(np.array(UPRIGHT), solid)
    return np.array([around.min(axis=0) - solid.radius, around.max(axis=0) + solid.radius])


def of_terrain(ground: SceneTerrain) -> Array:
    """Return the lowest and the highest point (2, 3) [m] of terrain, in the middle of its sides."""
    middle = [(ground.x[0] + ground.x[-1]) / 2, (ground.y[0] + ground.y[-1]) / 2]
    known = ground.z[np.isfinite(ground.z)]
    return np.array([[*middle, z] for z in (known.min(initial=np.inf), known.max(initial=-np.inf))])


def take_in(box: Array, low: Array, high: Array, room: float) -> tuple[Array, Array]:
    """Widen a rectangle by at most ``room`` on each side to take in a box (2, 2) that reaches into it or near it."""
    near = (box[0] < high + room).all() and (box[1] > low - room).all()
    if not near:
        return low, high
    return np.maximum(np.minimum(low, box[0]), low - room), np.minimum(np.maximum(high, box[1]), high + room)


def arrange(panels: list[ViewPanel]) -> tuple[bool, float]:
    """Return the arrangement with the larger scale: whether the panels are stacked, and the scale [in/m]."""
    spans = np.array([panel.span for panel in panels])
    width = style.WIDTH - LEFT - RIGHT
    stacked = min(width / spans[:, 0].max(), (4.6 if len(panels) == 1 else 6.2) / spans[:, 1].sum())
    beside = min((width - (len(panels) - 1) * (LEFT + 0.2)) / spans[:, 0].sum(), 4.6 / spans[:, 1].max())
    return (True, float(stacked)) if stacked >= beside else (False, float(beside))


def widen(panel: ViewPanel, scale: float) -> ViewPanel:
    """Make room on both sides where a panel would be too thin to read."""
    lack = np.maximum(MIN_PANEL_SIZE / scale - panel.span, 0) / 2
    return ViewPanel(panel.view, panel.low - lack, panel.high + lack)


def lay_out(
    panels: list[ViewPanel], stacked: bool, scale: float
) -> tuple[DataFigure, list[tuple[float, float, float, float]]]:
    """Return the figure, and (left, bottom, width, height) of each panel in shares of it."""
    sizes = [panel.span * scale for panel in panels]
    gaps = GAP * (len(panels) - 1)
    height = (sum(s[1] for s in sizes) + gaps if stacked else max(s[1] for s in sizes)) + BOTTOM + TOP
    figure = DataFigure(figsize=(style.WIDTH, height))
    places = []
    widths = [float(size[0]) for size in sizes]
    used = max(widths) if stacked else sum(widths) + (len(sizes) - 1) * (LEFT + 0.2)
    left, top = LEFT + (style.WIDTH - LEFT - RIGHT - used) / 2, height - TOP
    for size in sizes:
        width, tall = float(size[0]), float(size[1])
        places.append((left / style.WIDTH, (top - tall) / height, width / style.WIDTH, tall / height))
        left, top = (left, top - size[1] - GAP) if stacked else (left + size[0] + LEFT + 0.2, top)
    return figure, places


def dress(axes: Axes, panel: ViewPanel, scale: float) -> None:
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
