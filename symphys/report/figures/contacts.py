"""Contact forces and gaps against time, a row for each two surfaces."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.report.scene.views import centres
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

MOST_PAIRS = 6
NORMAL, TANGENTIAL, WHOLE, GAP = style.BODIES[0], style.ORANGE, style.GREEN, style.GREY
POINT = re.compile(r"(.*):\d+", re.DOTALL)
"""Surfaces that may touch in several points have a contact for each: ``box-ground:3``."""


def pair_of(name: str) -> str:
    """The two surfaces of a contact, without the number of its point."""
    match = POINT.fullmatch(name)
    return match[1] if match else name


def by_surfaces(trajectory: Trajectory) -> Trajectory:
    """The motion with one contact for each two surfaces: the forces of all its points, and the smallest gap."""
    points: dict[str, list[int]] = {}
    for index, name in enumerate(trajectory.contact_names):
        points.setdefault(pair_of(name), []).append(index)
    force = [trajectory.contact_force[:, indices].sum(axis=1) for indices in points.values()]
    gap = [np.fmin.reduce(trajectory.contact_gap[:, indices], axis=1) for indices in points.values()]
    if len(points) == len(trajectory.contact_names):
        return trajectory
    return replace(
        trajectory,
        contact_names=tuple(points),
        contact_force=np.stack(force, axis=1),
        contact_gap=np.stack(gap, axis=1),
    )


def shown_pairs(trajectory: Trajectory) -> list[int]:
    """The pairs that get a row: the largest impulses first; pairs that never touch only if none does."""
    impulse = np.nan_to_num(np.abs(trajectory.contact_force)).sum(axis=(0, 2))
    touching = [int(pair) for pair in np.argsort(-impulse, kind="stable") if impulse[pair] > 0]
    if touching:
        return touching[:MOST_PAIRS]
    nearest = np.argsort(np.nan_to_num(trajectory.contact_gap, nan=np.inf).min(axis=0), kind="stable")
    return [int(pair) for pair in nearest[:MOST_PAIRS]]


def draw_contacts(trajectory: Trajectory, scene: Scene) -> DataFigure | None:
    """Normal and tangential force and the gap of ``shown_pairs``, point by point summed; None without pairs."""
    trajectory = by_surfaces(trajectory)
    pairs = shown_pairs(trajectory)
    if not pairs or len(trajectory.time) < 2:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.7 * len(pairs)), layout="constrained")
    grid = figure.subplots(len(pairs), 2, sharex=True, squeeze=False, width_ratios=(1.7, 1))
    normals = dict(pair_normals(trajectory, scene))
    drawn: dict[str, str] = {}
    for row, pair in enumerate(pairs):
        normal = normals.get(trajectory.contact_names[pair])
        drawn |= draw_forces(grid[row, 0], trajectory, pair, normal)
        draw_gap(grid[row, 1], trajectory, pair)
        grid[row, 0].set_ylabel(style.short(trajectory.contact_names[pair], 24), fontweight="bold", color=style.INK)
    grid[0, 0].set_title("Contact force, mean over a step [N]")
    grid[0, 1].set_title("Gap [m]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    style.legend_above(figure, [Line2D([], [], color=colour) for colour in drawn.values()], list(drawn))
    return figure


def draw_forces(axes: Axes, trajectory: Trajectory, pair: int, normal: Array | None) -> dict[str, str]:
    """Normal and tangential magnitude, or the whole where the pair's normal is not known; the colours by name."""
    middles, found = force_parts(trajectory, pair, normal)
    colours = {kind: colour for kind, colour, _ in found}
    time, parts = style.thin(middles, np.stack([force for _, _, force in found], axis=1), 1200)
    name = trajectory.contact_names[pair]
    keep(
        axes, {TIME: time} | {f"{name}.{kind} force [N]": column for kind, column in zip(colours, parts.T, strict=True)}
    )
    for column, colour in zip(parts.T, colours.values(), strict=True):
        axes.fill_between(time, column, step="mid", color=colour, alpha=0.12, linewidth=0)
        axes.plot(time, column, drawstyle="steps-mid", color=colour, linewidth=1.2)
    fit_force_scale(axes, parts)
    style.set_linear(axes, "x")
    axes.margins(x=0.01)
    axes.set_ylim(bottom=0)
    return colours


def force_parts(trajectory: Trajectory, pair: int, normal: Array | None) -> tuple[Array, list[tuple[str, str, Array]]]:
    """The middles of the steps, and (kind, colour, (N,) [N]): normal and tangential force, or the whole."""
    force = trajectory.contact_force[:, pair]
    middles = (trajectory.time[1:] + trajectory.time[:-1]) / 2
    if normal is None:
        return middles, [("whole", WHOLE, np.linalg.norm(force, axis=1))]
    along = np.sum(force * normal, axis=1, keepdims=True)
    across = np.linalg.norm(force - along * normal, axis=1)
    return middles, [("normal", NORMAL, np.abs(along[:, 0])), ("tangential", TANGENTIAL, across)]


def force_scale(force: Array) -> float:
    """0 for linear; where impacts tower over lasting contact the small force above which it is logarithmic."""
    acting = force[np.isfinite(force) & (force > 0)]
    if acting.size and acting.max() > 20 * np.median(acting):
        return float(max(np.quantile(acting, 0.1), acting.max() * 1e-3))
    return 0.0


def fit_force_scale(axes: Axes, force: Array) -> None:
    """Linear, or logarithmic above ``force_scale``."""
    acting = force[np.isfinite(force) & (force > 0)]
    if least := force_scale(force):
        style.set_symlog(axes, "y", least)
        axes.set_ylim(top=float(acting.max()) * 2)
    else:
        style.set_linear(axes, "y")
        axes.set_ylim(top=float(acting.max()) * 1.08 if acting.size else 1.0)


def draw_gap(axes: Axes, trajectory: Trajectory, pair: int) -> None:
    """The distance of the two surfaces; below zero they overlap."""
    time, gap = style.thin(trajectory.time, trajectory.contact_gap[:, [pair]])
    keep(axes, {TIME: time, f"{trajectory.contact_names[pair]}.gap [m]": gap[:, 0]})
    axes.axhline(0, color=style.FAINT, linewidth=0.9, zorder=1.5)
    axes.plot(time, gap[:, 0], color=GAP, linewidth=1.2)
    style.set_linear(axes, "x")
    style.set_linear(axes, "y")
    axes.margins(x=0.01, y=0.08)


def pair_normals(trajectory: Trajectory, scene: Scene) -> Iterator[tuple[str, Array]]:
    """The names that pairs of surfaces have, each with its unit normal (N, 3) or (3,) at the start of a step.

    Only planes, and balls against each other, have a normal that the shapes alone determine.
    """
    solids = list(labels(trajectory, scene))
    for (label, _, _), plane in itertools.product(solids, scene.planes):
        yield f"{label}-{plane.name}", plane.normal
    wanted = set(trajectory.contact_names)
    balls = [entry for entry in solids if entry[2].is_ball]
    for (first, i, a), (second, j, b) in itertools.permutations(balls, 2):
        if i != j and f"{first}-{second}" in wanted:
            apart = (centres(trajectory, i, a) - centres(trajectory, j, b))[:-1]
            yield f"{first}-{second}", apart / np.maximum(np.linalg.norm(apart, axis=1, keepdims=True), 1e-12)


def labels(trajectory: Trajectory, scene: Scene) -> Iterator[tuple[str, int, Solid]]:
    """Every solid under the name that pairs call it by: the body's, with an index where it has several."""
    for body, name in enumerate(trajectory.body_names):
        solids = scene.solids(name)
        for index, solid in enumerate(solids):
            yield (f"{name}[{index}]" if len(solids) > 1 else name), body, solid
