"""Static surfaces in a panel: planes, fixtures and terrain."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from symphys.findings import writing
from symphys.report.charts import palette
from symphys.report.scene.panel import ViewPanel
from symphys.report.scene.views import View, corners, inner_edges, outline
from symphys.results.scene import UPRIGHT, Scene, SceneTerrain, Solid
from symphys.trajectory import Trajectory

SHADES = LinearSegmentedColormap.from_list("heights", ["#ffffff", "#d8dfe6"])
HATCH: dict[str, Any] = {"facecolor": palette.GROUND, "edgecolor": "#d5dbe1", "hatch": "////", "linewidth": 0}
BEHIND_COLOUR = "#f6f8f9"
MAX_CONTOURS = 8
"""Lines of height in a view from above, at most about."""


def draw_ground(axes: Axes, panel: ViewPanel, trajectory: Trajectory, scene: Scene) -> None:
    """Draw all static surfaces; planes and terrain hide what is below them."""
    for ground in scene.terrain:
        if panel.view.depth == 2:
            draw_heights(axes, panel, ground)
        else:
            draw_profile(axes, panel, trajectory, ground)
    for fixture in scene.fixtures:
        draw_fixture(axes, panel.view, fixture.solid)
    draw_planes(axes, panel, trajectory, scene)


def draw_fixture(axes: Axes, view: View, solid: Solid) -> None:
    """Draw the outline of a static solid, and the edges that are seen in it."""
    upright = np.array(UPRIGHT)
    around = view.flat(solid.centre) + outline(view.flat(corners(upright, solid)), solid.radius)
    axes.add_patch(Polygon(around, **HATCH, zorder=1.55))
    axes.add_patch(Polygon(around, fill=False, edgecolor=palette.GROUND_EDGE, linewidth=1.3, zorder=1.56))
    for edge in view.flat(solid.centre + inner_edges(upright, solid, view.front)):
        axes.plot(*edge.T, color=palette.GROUND_EDGE, linewidth=0.8, zorder=1.56)


def draw_profile(axes: Axes, panel: ViewPanel, trajectory: Trajectory, ground: SceneTerrain) -> None:
    """Draw a cut through terrain at the middle of the motion's depth; palely, its height behind and in front."""
    along_x = panel.view.right == 0
    along, across, z = (ground.x, ground.y, ground.z) if along_x else (ground.y, ground.x, ground.z.T)
    places = trajectory.position[..., panel.view.depth]
    cut = np.array([np.interp(np.median(places), across, column) for column in z.T])
    near = (across >= places.min()) & (across <= places.max())
    bottom = min(panel.low[1], float(np.nanmin(cut, initial=np.inf))) - float(panel.span[1])
    if near.any():
        highest = np.fmax.reduce(z[near], axis=0)
        axes.fill_between(
            along, highest, bottom, facecolor=BEHIND_COLOUR, edgecolor=palette.FAINT, linewidth=0.8, zorder=1.4
        )
    axes.fill_between(along, cut, bottom, **HATCH, zorder=1.57)
    axes.plot(along, cut, color=palette.GROUND_EDGE, linewidth=1.6, zorder=1.58)


def draw_heights(axes: Axes, panel: ViewPanel, ground: SceneTerrain) -> None:
    """Draw contour lines of terrain, and write their distance into the title."""
    low, high = np.nanmin(ground.z, initial=np.inf), np.nanmax(ground.z, initial=-np.inf)
    if not high - low > 1e-9 * max(abs(high), abs(low)):
        return
    levels = MaxNLocator(MAX_CONTOURS, steps=[1, 2, 5, 10]).tick_values(low, high)
    turned = panel.view.right == 1
    x, y, z = (ground.y, ground.x, ground.z.T) if turned else (ground.x, ground.y, ground.z)
    axes.contourf(x, y, z, levels=levels, cmap=SHADES, zorder=1.4)
    axes.contour(x, y, z, levels=levels, colors=palette.FAINT, linewidths=0.8, linestyles="solid", zorder=1.5)
    axes.set_title(f"{panel.view.title}; a line of height every {writing.show(levels[1] - levels[0], 3)} m")


def draw_planes(axes: Axes, panel: ViewPanel, trajectory: Trajectory, scene: Scene) -> None:
    """Draw the solid side of each plane seen from its edge, cut at the middle of the motion's depth."""
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
        cut = np.array([foot - along, foot + along, foot + along - size * normal, foot - along - size * normal])
        # The line lies under every solid, so that it ends where another plane's solid begins.
        axes.plot(*cut[:2].T, color=palette.GROUND_EDGE, linewidth=2.2, zorder=1.5)
        axes.add_patch(Polygon(cut, **HATCH, zorder=1.6))
