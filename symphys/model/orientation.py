"""Orientations as they are given: a quaternion of any length, or turns about the axes of the world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot

import numpy as np

from symphys.maths import rotation
from symphys.model.shapes.shape import UPRIGHT
from symphys.types import Array

ANGLES = ("roll_deg", "pitch_deg", "yaw_deg")
"""Turns about the x, y and z axis of the world, one after the other [degrees]."""
Orientation = Sequence[float] | Mapping[str, float]
"""(4,) w x y z, or some of ``ANGLES``."""


def unit_quaternion(given: Orientation) -> Array:
    """(4,): the unit quaternion w x y z; ValueError says what is wrong."""
    if isinstance(given, Mapping):
        unknown = [key for key in given if key not in ANGLES]
        if unknown:
            raise ValueError(f"has no {', '.join(unknown)}; valid: {', '.join(ANGLES)}")
        return roll_pitch_yaw(*(given.get(key, 0.0) for key in ANGLES))
    length = hypot(*given)  # squares of large numbers overflow
    if not 1e-6 < length < 1e6:
        raise ValueError("a quaternion must not be zero; [1, 0, 0, 0] is no rotation")
    return np.array(given, float) / length


def roll_pitch_yaw(*degrees: float) -> Array:
    """(4,): upright, turned about x, then y, then z of the world by these angles [degrees]."""
    quaternion = np.array(UPRIGHT)
    for axis, angle in enumerate(degrees):
        quaternion = turned(quaternion, axis, angle)
    return quaternion


def turned(quaternion: Array, axis: int, degrees: float) -> Array:
    """(4,): the orientation after a turn about a world axis."""
    half = np.deg2rad(degrees % 360) / 2
    turn = np.zeros(4)
    turn[0], turn[1 + axis] = np.cos(half), np.sin(half)
    return np.asarray(rotation.multiply(turn, quaternion), float).ravel()
