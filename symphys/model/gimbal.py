"""Gimbal lock: poses in which joints with massless frames between two bodies have a coordinate without inertia.

A chain of joints is singular where its screws are linearly dependent: the rates of its frames are then free, and no
inertia answers. Three hinges through one point are where their axes lie in one plane. Frames that hold three joints or
more make a tree of chains, from one body with mass to each other: singular where one set of rates moves none of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.records import dataclass
from symphys.types import Array

SINGULAR = 1e-5
"""Least singular value of unit screws that counts as 0."""
TRIALS, REFINED = 60, 3
"""Random poses that are tried, and from how many of them a search for the least singular value begins."""
REACH = 1.0
"""[m] How far a slide without limits is moved."""


@dataclass(frozen=True)
class Screw:
    """A coordinate of a chain at the pose in which all are 0.

    Attributes:
        axis: (3,) unit vector.
        point: (3,) on the axis [m]; None of a slide.
        low, high: bounds of the coordinate [rad], [m].
        carried: whether a rotor's inertia, an armature, answers the coordinate itself.
        lead: displacement along an axis with a point, by the angle [m/rad].
    """

    axis: Array
    point: Array | None
    low: float = -np.inf
    high: float = np.inf
    carried: bool = False
    lead: float = 0.0


def locks(screws: Sequence[Screw], paths: Sequence[Sequence[int]] | None = None) -> bool:
    """Whether a tree of screws has a pose within their bounds in which it is singular.

    Args:
        screws: all of them, from one body with mass on.
        paths: indices of the screws from that body to each other body with mass; without, one path of all.
    """
    paths = [list(range(len(screws)))] if paths is None else paths
    if len(screws) > 6 * len(paths) + sum(each.carried for each in screws):
        return True
    # What comes last moves nothing else, and what all paths begin with moves all alike.
    idle = {k for k in range(len(screws)) if all(k == path[-1] for path in paths if k in path)}
    idle |= {k for k in range(len(screws)) if all(path[:1] == [k] for path in paths)}
    inner, rng = [k for k in range(len(screws)) if k not in idle], np.random.default_rng(0)
    widest = [np.pi if screws[k].point is not None else REACH for k in inner]
    low = np.array([max(screws[k].low, -wide) for k, wide in zip(inner, widest, strict=True)])
    high = np.array([min(screws[k].high, wide) for k, wide in zip(inner, widest, strict=True)])

    def least(values: Array) -> float:
        q = np.zeros(len(screws))
        q[inner] = np.clip(values, low, high)
        return _least(screws, paths, q)

    turning = any(screws[k].point is not None for path in paths for k in path[:-1])
    if not (inner and turning):  # slides turn nothing that comes after them: all poses are alike
        return least(np.zeros(len(inner))) < SINGULAR
    from scipy.optimize import minimize  # a start without such chains loads no scipy

    starts = np.vstack([low, high, rng.uniform(low, high, (TRIALS, len(inner)))])
    best = sorted(starts, key=least)[:REFINED]
    options = {"xatol": 1e-7, "fatol": 1e-7, "maxfev": 60 * len(inner)}
    return any(least(minimize(least, at, method="Nelder-Mead", options=options).x) < SINGULAR for at in best)


def _least(screws: Sequence[Screw], paths: Sequence[Sequence[int]], q: Array) -> float:
    """The least singular value of the velocities of all ends by the rates, with a row for each rotor."""
    points = [each.point for each in screws if each.point is not None]
    size = max((float(np.linalg.norm(a - points[0])) for a in points), default=0.0) or 1.0
    centre = points[0] if points else np.zeros(3)
    rows = [np.diag([float(each.carried) for each in screws])]
    rows += [_velocities(screws, path, q, centre, size) for path in paths]
    return float(np.linalg.svd(np.vstack(rows), compute_uv=False)[-1])


def _velocities(screws: Sequence[Screw], path: Sequence[int], q: Array, centre: Array, size: float) -> Array:
    """(6, screws) Turning, and speed over ``size``, of the body at the end of a path by the rate of each screw."""
    turned, moved, columns = np.eye(3), np.zeros(3), np.zeros((6, len(screws)))
    for k in path:
        axis = turned @ screws[k].axis
        if (given := screws[k].point) is None:
            columns[3:, k] = axis
            moved = moved + q[k] * axis
            continue
        point = turned @ (given - centre) + moved
        lead = screws[k].lead
        columns[:3, k], columns[3:, k] = axis, (np.cross(point, axis) + lead * axis) / size
        across = np.cross(np.eye(3), axis)  # across @ v is axis x v
        step = np.eye(3) + np.sin(q[k]) * across + (1 - np.cos(q[k])) * across @ across
        turned, moved = step @ turned, point + step @ (moved - point) + q[k] * lead * axis
    return columns
