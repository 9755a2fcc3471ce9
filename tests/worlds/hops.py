"""What a hop is, by the columns of a motion: flights without contact, clearance, motion of the centre of mass."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from symphys.trajectory import Trajectory
from symphys.types import Array

LEGS = ("fl", "fr", "hl", "hr")
GAIT = {"trolley": 0.1, "torso": 5.0, "leg": 0.3, "foot": 0.1}
HOPPER = {"torso": 5.0, "leg": 0.3, "foot": 0.4}
PLANAR_HOPPER = {"torso": 1.0, "leg": 0.2, "foot": 0.1}
"""Masses [kg] of the hopper that has a gait, of that of three hops, and of the planar one."""
PERIODIC = (
    *("up.position", "hip.angle", "thruster.position"),
    *("along.rate", "up.rate", "hip.rate", "thruster.rate"),
)
"""What a gait repeats."""


def flights(motion: Trajectory) -> list[tuple[int, int]]:
    """The numbers of the states between which there is no contact for 0.15 s at least, of flights that have ended."""
    touches = np.flatnonzero(motion["foot-ground.force"][:, 2] > 0)
    return [(int(a), int(b)) for a, b in pairwise(touches) if motion.time[b] - motion.time[a] >= 0.15]


def of_centre(motion: Trajectory, masses: Mapping[str, float], field: str) -> Array:
    """(K,): the vertical position or velocity of the centre of mass."""
    moments = sum(mass * motion[f"{name}.{field}"][:, 2] for name, mass in masses.items())
    return np.asarray(moments / sum(masses.values()))


def clearance(motion: Trajectory) -> Array:
    """(K,) of the lower of the two spheres of a planar hopper's foot above the ground [m]."""
    angle = sum(motion[f"{name}.angle"].ravel() for name in ("pitch", "knee", "ankle"))
    ends = [motion["foot.position"][:, 2] + along * np.sin(angle) for along in (0.1, -0.1)]
    return np.asarray(np.min(ends, axis=0) - 0.03)
