"""Where a fit begins, and how it is improved: least squares of deviations, then of their fourth powers.

A deviation is how far a point of the mesh's outer surface is from the surface of the solids, how far a point inside the
mesh is outside them, or how much nearer they are to a point outside than the mesh is. High powers come near to the
least largest deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symphys.importing.fitting.mesh import Mesh
from symphys.importing.fitting.solids import Placed, union_distance
from symphys.types import Array

POINTS = 320
"""Of the outer surface, that a search looks at; half as many outside, a quarter inside."""
MOST_STEPS = 20
"""Of a search, for each power."""
POWERS = (1, 2, 4)
"""Of a distance, as a share of the size, in the residuals."""
WIDTHS = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
"""Sizes of a solid."""
TURNS = {"sphere": 0, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
"""Ways to turn it that change it."""
LEAST = 1e-3
"""Of the mesh's size: the least size of a solid."""
CLUSTER_STEPS = 25
"""Of k-means."""


def improved(mesh: Mesh, start: Sequence[Placed]) -> list[Placed]:
    """The solids that fit better, from a start."""
    from scipy.optimize import least_squares

    cloud, solids = cloud_of(mesh), list(start)
    for power in POWERS:
        numbers = np.zeros(sum(3 + TURNS[solid.kind] + WIDTHS[solid.kind] for solid in solids))

        def residuals(change: Array, power: int = power, solids: list[Placed] = solids) -> Array:
            return np.asarray((10 * cloud.deviations(changed(solids, change, mesh.size)) / mesh.size) ** power)

        found = least_squares(residuals, numbers, method="trf", max_nfev=MOST_STEPS, x_scale=0.1, xtol=1e-4, ftol=1e-4)
        solids = changed(solids, found.x, mesh.size)
    return solids


@dataclass(frozen=True)
class Cloud:
    """Points on the surface, inside, and outside at known distances [m]."""

    surface: Array
    inside: Array
    outside: Array
    away: Array

    def deviations(self, solids: list[Placed]) -> Array:
        """(n,) [m]: at each point, at least 0."""
        distance = union_distance(solids, np.concatenate([self.surface, self.inside, self.outside]))
        on, within, out = np.split(distance, np.cumsum([len(self.surface), len(self.inside)]))
        return np.concatenate([np.abs(on), np.maximum(within, 0), np.maximum(self.away - out, 0)])


@lru_cache(maxsize=4)
def cloud_of(mesh: Mesh) -> Cloud:
    """A few points of a mesh, the same each time."""
    low, high = mesh.outer.min(axis=0), mesh.outer.max(axis=0)
    margin = 0.3 * (high - low).max()
    grid = low - margin + np.random.default_rng(2).random((2000, 3)) * (high - low + 2 * margin)
    outside = thinned(grid[mesh.outside(grid)], POINTS // 2)
    away = np.asarray(mesh.tree.query(outside)[0], float)
    return Cloud(thinned(mesh.outer, POINTS), thinned(mesh.filling, POINTS // 4), outside, away)


def changed(solids: Sequence[Placed], numbers: Array, size: float) -> list[Placed]:
    """Solids after shifts [by the mesh's size], turns [rad] and growths [logarithms of sizes]."""
    from scipy.spatial.transform import Rotation

    found, at = [], 0
    for solid in solids:
        turns, width = TURNS[solid.kind], WIDTHS[solid.kind]
        shift, turn, growth = np.split(numbers[at : at + 3 + turns + width], [3, 3 + turns])
        axes = solid.axes @ Rotation.from_rotvec(np.append(turn, [0] * (3 - turns))).as_matrix()
        sizes = np.maximum(solid.sizes * np.exp(np.clip(growth, -3, 3)), LEAST * size)
        found.append(Placed(solid.kind, solid.centre + size * shift, axes, sizes))
        at += 3 + turns + width
    return found


def thinned(points: Array, count: int) -> Array:
    """As many of the points, spread over them: each the farthest from those before."""
    rng = np.random.default_rng(1)
    pool = points[rng.choice(len(points), min(len(points), 8 * count), replace=False)]
    if len(pool) <= count:
        return pool
    chosen = [int(np.linalg.norm(pool - pool.mean(axis=0), axis=1).argmax())]
    away = np.linalg.norm(pool - pool[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(pool - pool[chosen[-1]], axis=1))
    return np.asarray(pool[chosen])


def frames(points: Array) -> list[Array]:
    """(3, 3) rotations along which a cloud may be laid out: the given axes and its principal ones."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return [np.eye(3), axes]


def starts(kind: str, points: Array) -> list[Placed]:
    """Solids of a kind that hold a cloud, roughly: along every axis where one is special."""
    found = []
    for frame in frames(points):
        turns = range(3) if kind in ("capsule", "cylinder") else range(1)
        for turn in turns:
            axes = np.roll(frame, -turn - 1, axis=1) if kind in ("capsule", "cylinder") else frame
            own = points @ axes
            middle, half = (own.max(axis=0) + own.min(axis=0)) / 2, np.ptp(own, axis=0) / 2
            half = np.maximum(half, 0.01 * half.max())
            across = float(np.sqrt(half[0] * half[1]))
            sizes = {
                "sphere": [half.mean()],
                "capsule": [across, max(half[2] - across, 0.1 * half[2])],
                "cylinder": [across, half[2]],
                "box": half,
                "ellipsoid": 1.1 * half,
            }[kind]
            found.append(Placed(kind, axes @ middle, axes, np.array(sizes, float)))
        if kind == "sphere":
            break
    return found


def several(kind: str, mesh: Mesh, count: int) -> list[Placed]:
    """Spheres or capsules in clusters of the mesh's inside."""
    points = thinned(mesh.filling, 1500)
    middles = thinned(points, count)
    for _ in range(CLUSTER_STEPS):
        owner = ((points[:, None] - middles[None]) ** 2).sum(axis=2).argmin(axis=1)
        middles = np.array(
            [points[owner == k].mean(axis=0) if (owner == k).any() else middles[k] for k in range(count)]
        )
    found = []
    for k in range(count):
        own = points[owner == k]
        if len(own) < 4:
            continue
        own = own - middles[k]
        axes = np.linalg.svd(own, full_matrices=False)[2][::-1].T
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        half = np.maximum(np.abs(own @ axes).max(axis=0), mesh.size / 40)
        sizes = (
            [float(half.mean())]
            if kind == "sphere"
            else [float(half[:2].mean()), float(max(half[2] - half[0], half[2] / 4))]
        )
        found.append(Placed(kind, middles[k], axes, np.array(sizes)))
    return found
