"""The motion seen from the side and from above: path, snapshots at even times, what stands around, the guess."""

from __future__ import annotations

import itertools

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from symphys.report import style
from symphys.report.ground import draw_ground
from symphys.report.panel import RIGHT, Panel, arrange, dress, lay_out, make_panel, widen
from symphys.report.records import Trajectory
from symphys.report.scenery import Scene
from symphys.report.snapshots import draw_bodies
from symphys.report.views import choose_views


def draw_motion(trajectory: Trajectory, scene: Scene, guess: Trajectory | None = None) -> Figure:
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
            draw_guess(axes, panel, guess)
        draw_bodies(axes, panel, trajectory, scene, scale)
    add_legend(figure, trajectory, guess is not None)
    return figure


def draw_guess(axes: Axes, panel: Panel, guess: Trajectory) -> None:
    """The guess's path, thin and grey."""
    for body in range(len(guess.body_names)):
        path = panel.view.flat(guess.position[:, body])
        _, path = style.thin(guess.time, path, 300)
        axes.plot(*path.T, color="#98a4af", linewidth=0.9, linestyle=(0, (4, 2.5)), zorder=2)


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
