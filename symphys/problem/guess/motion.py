"""A guessed motion: quantities over time, and how they move between the times at which they are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from symphys.maths import rotation
from symphys.problem.guess.names import ORIENTATION
from symphys.types import Array


@dataclass(frozen=True)
class GuessedMotion:
    """Where a motion is guessed to pass, by quantities over time.

    Numbers move on straight lines between the times at which they are known. Orientations turn on the shortest way,
    the geodesic, at constant angular velocity (Shoemake 1985). Before the first and after the last time all stay.

    Attributes:
        columns: times (K,) [s], ascending, and values (K, components) there, by names such as ``knee.angle``,
            ``knee.rate``, ``torso.position``; ``torso.orientation`` and those of ball joints are unit quaternions
            w x y z, and no two that follow each other are half a turn apart.
    """

    columns: Mapping[str, tuple[Array, Array]]

    def at(self, name: str, times: Array) -> Array:
        """(M, components) at times (M,) [s]."""
        known, values = self.columns[name]
        if not is_orientation(name):
            return np.stack([np.interp(times, known, column) for column in values.T], axis=1)
        place = np.interp(times, known, np.arange(len(known)))
        before = np.minimum(place.astype(int), max(len(known) - 2, 0))
        after = np.minimum(before + 1, len(known) - 1)
        found = turned_by_share()(values[before].T, values[after].T, (place - before)[None])
        return np.asarray(found).T

    def rate(self, name: str, times: Array, dt: float) -> Array:
        """(M, components) the slope over dt [s] about the times, as far as something is known there.

        Of an orientation the angular velocity (M, 3) [rad/s], in the axes that it is told in.
        """
        known = self.columns[name][0]
        before, after = (np.clip(times + side * dt / 2, known[0], known[-1]) for side in (-1, 1))
        apart, (first, last) = after - before, (self.at(name, each) for each in (before, after))
        rise = turn_between(first, last) if is_orientation(name) else last - first
        return np.where(apart[:, None] > 0, rise / np.where(apart > 0, apart, 1.0)[:, None], 0.0)


def is_orientation(name: str) -> bool:
    """Whether a quantity is a unit quaternion."""
    return name.rpartition(".")[2] == ORIENTATION


def turn_between(first: Array, last: Array) -> Array:
    """(M, 3) rotation vectors [rad] that turn orientations (M, 4) into others."""
    return np.asarray(rotation_between()(first.T, last.T)).T


@cache
def rotation_between() -> ca.Function:
    """(p, q) -> the rotation vector that turns p into q."""
    p, q = ca.SX.sym("p", 4), ca.SX.sym("q", 4)
    return ca.Function("between", [p, q], [rotation.between(p, q)])


@cache
def turned_by_share() -> ca.Function:
    """(p, q, share) -> the orientation on the way from p to q."""
    p, q, share = ca.SX.sym("p", 4), ca.SX.sym("q", 4), ca.SX.sym("share")
    return ca.Function("turned", [p, q, share], [rotation.turn(p, share * rotation.between(p, q))])
