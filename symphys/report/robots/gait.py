"""A gait diagram: a row for each foot, with a bar while it carries load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from symphys.findings.writing import percent
from symphys.report.figures import style
from symphys.report.figures.contacts import labels, pair_of
from symphys.report.figures.data import DataFigure, keep
from symphys.report.robots.branches import colours, linked
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array, Bools


def spans(holds: Bools) -> list[tuple[int, int]]:
    """(start, stop) of every run of True in a mask (N,): it holds in the steps from start to stop - 1."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


LOADED = 0.02
"""A body stands where it carries more than this share of the weight of all that joints hold."""


@dataclass(frozen=True)
class Stance:
    """When a body stands: ``stands`` (N,), whether it does in each step."""

    body: int
    stands: Bools

    @property
    def duty(self) -> float:
        """The share of the time."""
        return float(self.stands.mean())


def weight(trajectory: Trajectory, scene: Scene) -> float:
    """[N] of all bodies that joints hold; nan where a mass or gravity is not known."""
    names = {trajectory.body_names[body] for body in linked(trajectory, scene)}
    return scene.weight_per_mass * sum(body.mass for body in scene.bodies if body.name in names)


def stances(trajectory: Trajectory, scene: Scene) -> list[Stance]:
    """The bodies that ever stand; none where nothing is known to weigh anything."""
    least = LOADED * weight(trajectory, scene)
    if not least > 0:
        return []
    ground = [static.name for kind in (scene.planes, scene.fixtures, scene.terrain) for static in kind]
    held = set(linked(trajectory, scene))
    standing = [(label, body) for label, body, _ in labels(trajectory, scene) if body in held]
    owners = {f"{label}-{name}": body for label, body in standing for name in ground}
    loads: dict[int, Array] = {}
    for index, name in enumerate(trajectory.contact_names):
        body = owners.get(pair_of(name))
        if body is not None:
            loads[body] = loads.get(body, 0) + trajectory.contact_force[:, index]
    found = [Stance(body, np.linalg.norm(load, axis=1) > least) for body, load in sorted(loads.items())]
    return [stance for stance in found if stance.stands.any()]


def has_gait(found: list[Stance]) -> bool:
    """Whether some body comes down or leaves the ground."""
    return any(not stance.stands.all() for stance in found)


MOST_ROWS = 24
ROW = 0.3
"""[in]"""
BAR = 0.64
"""Height of a bar in rows."""


def draw_gait(trajectory: Trajectory, scene: Scene) -> DataFigure | None:
    """The diagram; None where no body comes down or leaves the ground."""
    found = stances(trajectory, scene)
    if not has_gait(found):
        return None
    rows = shown_stances(found)
    figure = DataFigure(figsize=(style.WIDTH, 0.75 + ROW * len(rows)), layout="constrained")
    axes = figure.subplots()
    colour = colours(trajectory, scene)
    for row, stance in enumerate(rows):
        draw_row(axes, row, trajectory.time, stance, colour[stance.body])
        keep_row(axes, trajectory.time, stance, trajectory.body_names[stance.body])
    axes.set_yticks(range(len(rows)), [style.short(trajectory.body_names[stance.body], 24) for stance in rows])
    axes.set(xlim=(trajectory.time[0], trajectory.time[-1]), ylim=(len(rows) - 0.5, -0.5), xlabel="time [s]")
    axes.set_title("On the ground")
    axes.set_title("duty factor", loc="right", fontweight="normal", color=style.SOFT)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    style.set_linear(axes, "x", 10)
    return figure


def shown_stances(found: list[Stance]) -> list[Stance]:
    """The bodies that get a row: those that come down most often, in the file's order."""
    return sorted(sorted(found, key=changes, reverse=True)[:MOST_ROWS], key=lambda stance: stance.body)


def draw_row(axes: Axes, row: int, time: Array, stance: Stance, colour: str) -> None:
    """The bars of one body, and its duty factor beside them."""
    axes.axhspan(row - BAR / 2, row + BAR / 2, color=style.GROUND, linewidth=0, zorder=1)
    bars = [(time[start], time[stop] - time[start]) for start, stop in spans(stance.stands)]
    axes.broken_barh(bars, (row - BAR / 2, BAR), facecolor=colour, linewidth=0, zorder=3)
    axes.text(1.007, row, percent(stance.duty), va="center", color=style.SOFT, transform=axes.get_yaxis_transform())


def keep_row(axes: Axes, time: Array, stance: Stance, name: str) -> None:
    """From when until when a body stands."""
    ends = np.array(spans(stance.stands))
    keep(axes, {f"{name}.stands from [s]": time[ends[:, 0]], f"{name}.stands until [s]": time[ends[:, 1]]})


def changes(stance: Stance) -> int:
    """How often a body comes down."""
    return len(spans(stance.stands))
