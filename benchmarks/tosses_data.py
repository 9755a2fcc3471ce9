"""Recorded tosses of a cube and of two boxes on a hinge, and how far simulated ones are from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from symphys.types import Array, Ints

RATE = 148.0
"""[Hz] of the recordings."""
MEASURED = ("position", "orientation", "velocity", "angular_velocity", "angle", "rate")
"""Columns: of a frame's origin [m, w x y z, m/s, rad/s in world axes], and of the hinge [rad, rad/s]."""
NEAR = 0.02
"""[m] with a corner so near to the table a toss is no longer a flight; in a frame it may fall by as much."""


@dataclass(frozen=True)
class Tossed:
    """What is tossed.

    Attributes:
        name: of its files, ``NAME_fit.npz`` and ``NAME_check.npz``.
        width: [m] by which errors of positions are divided.
        halves: (3,) half edges of each of its boxes [m].
        measures: what of it is measured.
    """

    name: str
    width: float
    halves: Array
    measures: tuple[str, ...]


CUBE = Tossed("cube", 0.1048, np.full(3, 0.0513), ("position", "orientation"))
ELBOW = Tossed("elbow", 0.1, np.array([0.05, 0.025, 0.025]), ("position", "orientation", "angle"))
HINGE, BOX = np.array([-0.035, 0.06, 0.0]), np.array([0.035, 0.0, 0.0])
"""[m] of the elbow: the hinge in the frame of link 1, and the middle of the other box from there, in that of link 2."""


@dataclass(frozen=True)
class Tosses:
    """Tosses one after the other.

    Attributes:
        start: (K + 1,) first rows of the tosses, and the number of all rows.
        columns: (n, ...) of each of ``MEASURED`` that there is.
    """

    start: Ints
    columns: Mapping[str, Array]

    def __len__(self) -> int:
        """K."""
        return len(self.start) - 1

    def rows(self, toss: int) -> slice:
        """Those of a toss."""
        return slice(int(self.start[toss]), int(self.start[toss + 1]))

    def first(self) -> dict[str, Array]:
        """(K, ...): the first row of each toss."""
        return {name: values[self.start[:-1]] for name, values in self.columns.items()}

    def only(self, tosses: Ints) -> Tosses:
        """Some of them."""
        return self.cut(np.diff(self.start)[tosses], tosses)

    def cut(self, lengths: Ints, tosses: Ints | None = None) -> Tosses:
        """The first rows of tosses, so many of each."""
        which = np.arange(len(self)) if tosses is None else tosses
        rows = np.concatenate([self.start[k] + np.arange(n) for k, n in zip(which, lengths, strict=True)])
        start = np.concatenate([[0], np.cumsum(lengths)])
        return Tosses(start, {name: values[rows] for name, values in self.columns.items()})


def read(folder: Path, tossed: Tossed, part: str) -> Tosses:
    """The part "fit" or "check" of a folder's tosses."""
    with np.load(folder / f"{tossed.name}_{part}.npz") as found:
        columns = {name: found[name].astype(float) for name in MEASURED if name in found.files}
        return Tosses(found["start"].astype(np.int64), columns)


def joined(parts: list[Tosses]) -> Tosses:
    """All of them, one after the other."""
    columns = {name: np.concatenate([each.columns[name] for each in parts]) for name in parts[0].columns}
    return Tosses(np.concatenate([[0], np.cumsum(np.concatenate([np.diff(each.start) for each in parts]))]), columns)


def clearance(tossed: Tossed, tosses: Tosses) -> Array:
    """(n,) [m]: the height of the lowest corner, as measured."""
    turn, position = Rotation.from_quat(tosses.columns["orientation"], scalar_first=True), tosses.columns["position"]
    lowest = position[:, 2] - np.abs(turn.as_matrix()[:, 2]) @ tossed.halves
    if "angle" not in tosses.columns:
        return lowest
    other = turn * Rotation.from_rotvec(np.outer(tosses.columns["angle"], [0, 1, 0]))
    middle = position + turn.apply(HINGE) + other.apply(BOX)
    return np.minimum(lowest, middle[:, 2] - np.abs(other.as_matrix()[:, 2]) @ tossed.halves)


def flights(tossed: Tossed, tosses: Tosses, most: int = 24) -> Ints:
    """(K,): how many frames of each toss are a flight, not more than so many."""
    low = clearance(tossed, tosses) < NEAR
    found = [low[tosses.rows(k)] for k in range(len(tosses))]
    return np.array([min(int(np.argmax(each)) if each.any() else len(each), most) for each in found])


def angles_between(one: Array, other: Array) -> Array:
    """(n,) [rad] of the turns between orientations (n, 4)."""
    turn = Rotation.from_quat(one, scalar_first=True).inv() * Rotation.from_quat(other, scalar_first=True)
    return np.asarray(turn.magnitude())


def mean_errors(tossed: Tossed, tosses: Tosses, errors: list[tuple[Array, ...]]) -> Array:
    """(K, m): the published measure of each toss, from errors of its frames [m, rad, rad]: means in % and degrees."""
    factors = [100 / tossed.width, *[np.degrees(1.0)] * (len(tossed.measures) - 1)]
    return np.array([[factor * each.mean() for factor, each in zip(factors, one, strict=True)] for one in errors])
