"""Gimbal lock: poses in which joints with massless frames between two bodies have a coordinate without inertia.

A chain of joints is singular where its screws are linearly dependent: the rates of its frames are then free, and no
inertia answers. Three hinges through one point are where their axes lie in one plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SINGULAR = 1e-5
"""Least singular value of unit screws that counts as 0."""
TRIALS, REFINED = 60, 3
"""Random poses that are tried, and from how many of them a search for the least singular value begins."""
REACH = 1.0
"""[m] How far a slide without limits is moved."""


@dataclass(frozen=True)
class Screw:
    """One coordinate of a chain at the pose in which all are 0.

    Attributes:
        axis: (3,) unit vector.
        point: (3,) on the axis of a hinge [m]; None of a slide.
        low, high: bounds of the coordinate [rad], [m].
        carried: whether a rotor's inertia, an armature, answers the coordinate itself.
    """

    axis: Array
    point: Array | None
    low: float = -np.inf
    high: float = np.inf
    carried: bool = False


def locks(chain: Sequence[Screw]) -> bool:
    """Whether a chain, from one body with mass to the other, has a pose within its bounds in which it is singular."""
    from scipy.optimize import minimize  # a start without such chains loads no scipy

    if len(chain) > 6 + sum(each.carried for each in chain):
        return True
    inner, rng = list(chain[1:-1]), np.random.default_rng(0)
    widest = [np.pi if each.point is not None else REACH for each in inner]
    low = np.array([max(each.low, -wide) for each, wide in zip(inner, widest, strict=True)])
    high = np.array([min(each.high, wide) for each, wide in zip(inner, widest, strict=True)])

    def least(q: Array) -> float:
        return _least(chain, np.concatenate([[0.0], np.clip(q, low, high), [0.0]])[: len(chain)])

    if not inner:
        return least(np.empty(0)) < SINGULAR
    starts = np.vstack([low, high, rng.uniform(low, high, (TRIALS, len(inner)))])
    best = sorted(starts, key=least)[:REFINED]
    options = {"xatol": 1e-7, "fatol": 1e-7, "maxfev": 60 * len(inner)}
    return any(least(minimize(least, at, method="Nelder-Mead", options=options).x) < SINGULAR for at in best)


def _least(chain: Sequence[Screw], q: Array) -> float:
    """The least singular value of the chain's screws, with a row for each rotor."""
    from scipy.spatial.transform import Rotation

    points = [each.point for each in chain if each.point is not None]
    size = max((float(np.linalg.norm(a - points[0])) for a in points), default=0.0) or 1.0
    centre = points[0] if points else np.zeros(3)
    turned, moved, columns = Rotation.identity(), np.zeros(3), []
    for each, value in zip(chain, q, strict=True):
        axis = turned.apply(each.axis)
        if each.point is None:
            columns.append(np.concatenate([np.zeros(3), axis]))
            moved = moved + value * axis
            continue
        point = turned.apply(each.point - centre) + moved
        columns.append(np.concatenate([axis, np.cross(point, axis) / size]))
        step = Rotation.from_rotvec(value * axis)
        turned, moved = step * turned, point + step.apply(moved - point)
    rotors = np.diag([float(each.carried) for each in chain])
    return float(np.linalg.svd(np.vstack([np.array(columns).T, rotors]), compute_uv=False)[-1])
