"""Distances between convex shapes by brute force, for comparison: nothing here knows how the engine finds them.

A shape is a core (a point, a segment, a parallelepiped) with a ball about each of its points: all points
``centre + axes @ x``, |x| <= ``halves``, grown by ``radius``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial import ConvexHull, QhullError

from symphys.types import Array


@dataclass(frozen=True)
class Solid:
    """A convex shape in the world: centre (3,), axes (3, 3) in columns, half sizes (3,), radius."""

    centre: Array
    axes: Array
    halves: Array
    radius: float

    def corners(self) -> Array:
        """(n, 3): of the core, each once."""
        signs = [(-1, 1) if half > 0 else (0,) for half in self.halves]
        return np.array([self.centre + self.axes @ (self.halves * s) for s in product(*signs)])


def distance(a: Solid, b: Solid) -> float:
    """[m] between the surfaces; of shapes that overlap the least shift that parts them, negative."""
    apart = core_distance(a, b)
    return (apart if apart > 1e-9 else -core_depth(a, b)) - a.radius - b.radius


def core_distance(a: Solid, b: Solid) -> float:
    """Between the nearest points of two cores, by bounded least squares."""
    halves = np.concatenate([a.halves, b.halves])
    columns = np.hstack([a.axes, -b.axes])[:, halves > 0]
    gap = b.centre - a.centre
    if columns.shape[1] == 0:
        return float(np.linalg.norm(gap))
    limits = halves[halves > 0]
    found = lsq_linear(columns, gap, (-limits, limits), method="bvls", tol=1e-15)
    return float(np.linalg.norm(columns @ found.x - gap))


def core_depth(a: Solid, b: Solid) -> float:
    """How deep the origin lies in the Minkowski difference of two cores; 0 where that is flat."""
    differences = (a.corners()[:, None] - b.corners()[None]).reshape(-1, 3)
    if len(differences) < 4:
        return 0.0
    try:
        hull = ConvexHull(differences)
    except QhullError:
        return 0.0
    return max(float(-hull.equations[:, 3].max()), 0.0)
