"""Charts of contacts: forces and gaps against time, a row for each two surfaces."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.tables import TIME, Table
from symphys.report.scene.views import centres
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

MOST_PAIRS = 6
CONTACT_POINT = re.compile(r"(.*):\d+", re.DOTALL)
"""Surfaces that may touch in several points have a contact for each: ``box-ground:3``."""


def contacts_chart(trajectory: Trajectory, scene: Scene) -> Chart | None:
    """Chart force and gap of ``shown_pairs``, the forces of all their points added up; None without pairs."""
    trajectory = by_surfaces(trajectory)
    pairs = shown_pairs(trajectory)
    if not pairs or len(trajectory.time) < 2:
        return None
    normals = dict(pair_normals(trajectory, scene))
    panels, keys, tables = list[Panel](), dict[str, str](), list[Table]()
    for pair in pairs:
        name, gap = trajectory.contact_names[pair], trajectory.contact_gap[:, pair]
        middles, parts = force_parts(trajectory, pair, normals.get(name))
        keys |= {kind: colour for kind, colour, _ in parts}
        tables.append({TIME: middles} | {f"{name}.{kind} force [N]": force for kind, _, force in parts})
        tables.append({TIME: trajectory.time, f"{name}.gap [m]": gap})
        drawn = tuple(Line(kind, colour, middles, force, 1.2, "middles area") for kind, colour, force in parts)
        scale = force_scale(np.stack([force for _, _, force in parts]))
        panels.append(Panel(f"{name}: force, mean over a step [N]", drawn, TIME, scale, least=(0.0,)))
        panels.append(Panel(f"{name}: gap [m]", (Line("gap", palette.GREY, trajectory.time, gap),), TIME, edges=(0.0,)))
    return Chart(
        "contacts",
        "Contact forces and gaps over time",
        tuple(panels),
        2,
        tuple(itertools.starmap(Key, keys.items())),
        tuple(tables),
        widths=(1.7, 1.0),
        points=1200,
    )


def pair_of(name: str) -> str:
    """Return the two surfaces of a contact, without the number of its point."""
    match = CONTACT_POINT.fullmatch(name)
    return match[1] if match else name


def by_surfaces(trajectory: Trajectory) -> Trajectory:
    """Merge the contacts of each two surfaces into one: the sum of the forces, and the smallest gap."""
    points: dict[str, list[int]] = {}
    for index, name in enumerate(trajectory.contact_names):
        points.setdefault(pair_of(name), []).append(index)
    if len(points) == len(trajectory.contact_names):
        return trajectory
    force = [trajectory.contact_force[:, indices].sum(axis=1) for indices in points.values()]
    gap = [np.fmin.reduce(trajectory.contact_gap[:, indices], axis=1) for indices in points.values()]
    merged: dict[str, Any] = {"contact_force": np.stack(force, axis=1), "contact_gap": np.stack(gap, axis=1)}
    return replace(trajectory, contact_names=tuple(points), **merged)


def shown_pairs(trajectory: Trajectory) -> list[int]:
    """Choose the pairs that get a row: the largest impulses first; pairs that never touch only if none does."""
    impulse = np.nan_to_num(np.abs(trajectory.contact_force)).sum(axis=(0, 2))
    touching = [int(pair) for pair in np.argsort(-impulse, kind="stable") if impulse[pair] > 0]
    if touching:
        return touching[:MOST_PAIRS]
    nearest = np.argsort(np.nan_to_num(trajectory.contact_gap, nan=np.inf).min(axis=0), kind="stable")
    return [int(pair) for pair in nearest[:MOST_PAIRS]]


def force_parts(trajectory: Trajectory, pair: int, normal: Array | None) -> tuple[Array, list[tuple[str, str, Array]]]:
    """Return the middles of the steps, and (kind, colour, (N,) [N]): normal and tangential force, or the whole."""
    force = trajectory.contact_force[:, pair]
    middles = (trajectory.time[1:] + trajectory.time[:-1]) / 2
    if normal is None:
        return middles, [("whole", palette.GREEN, np.linalg.norm(force, axis=1))]
    along = np.sum(force * normal, axis=1, keepdims=True)
    across = np.linalg.norm(force - along * normal, axis=1)
    return middles, [("normal", palette.BODIES[0], np.abs(along[:, 0])), ("tangential", palette.ORANGE, across)]


def force_scale(force: Array) -> float:
    """Return 0 for a linear axis; where impacts tower over lasting contact the force above which it is logarithmic."""
    acting = force[np.isfinite(force) & (force > 0)]
    if acting.size and acting.max() > 20 * np.median(acting):
        return float(max(np.quantile(acting, 0.1), acting.max() * 1e-3))
    return 0.0


def pair_normals(trajectory: Trajectory, scene: Scene) -> Iterator[tuple[str, Array]]:
    """Yield the name of each pair of surfaces with its unit normal (N, 3) or (3,) at the start of a step, world.

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
    """Yield every solid under the name that pairs call it by: the body's, with an index where it has several."""
    for body, name in enumerate(trajectory.body_names):
        solids = scene.solids(name)
        for index, solid in enumerate(solids):
            yield (f"{name}[{index}]" if len(solids) > 1 else name), body, solid
