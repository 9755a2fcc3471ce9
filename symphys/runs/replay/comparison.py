"""Whether two motions are the same, to the bit, and by how much each quantity differs where they are not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.trajectory import Trajectory
from symphys.types import Array

COUNTED = {"residual": "N s", "crowded": "", "ambiguous": "", "paradox": ""}
"""Fields of a motion that no body, joint or contact has, and their units."""


@dataclass(frozen=True)
class QuantityDifference:
    """A quantity that is not the same to the bit.

    Attributes:
        name: ``ball.position``, ``output: speed [m/s]``, ``objective``.
        unit: of the difference; empty where it has none, or where the name has it.
        size: the largest difference of a component; inf where only one is a number, 0 where only signs of zero differ.
        time: [s] at which it is; None for what is no motion.
        recorded, again: the two numbers there.
    """

    name: str
    unit: str
    size: float
    time: float | None
    recorded: float
    again: float

    def __str__(self) -> str:
        """In a line."""
        unit = f" {self.unit}" if self.unit else ""
        when = "" if self.time is None else f" at {self.time:g} s"
        return f"{self.name}: {self.size:.3g}{unit}{when} ({self.recorded!r} was recorded, {self.again!r} again)"


def compare_motions(recorded: Trajectory, again: Trajectory) -> Iterator[QuantityDifference]:
    """The quantities of two motions of the same things at the same times that differ."""
    for name, unit in [*again.units.items(), *COUNTED.items()]:
        pair = [getattr(each, name) if name in COUNTED else each[name] for each in (recorded, again)]
        yield from compare_arrays(name, unit, again.time, *pair)


def compare_arrays(
    name: str, unit: str, time: Array, recorded: NDArray[np.generic], again: NDArray[np.generic]
) -> Iterator[QuantityDifference]:
    """The largest difference of two arrays, whose rows are at ``time``; nothing if they are the same to the bit.

    Of arrays that differ in shape nothing can be said but that.
    """
    first, second = (np.ascontiguousarray(each, float) for each in (recorded, again))
    if first.shape != second.shape:
        yield QuantityDifference(name, unit, np.inf, None, np.nan, np.nan)
        return
    differs = first.view(np.int64) != second.view(np.int64)
    if not differs.any():
        return
    gaps = np.where(differs, distances(first, second), -1.0)
    place = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    yield QuantityDifference(
        name, unit, float(gaps[place]), float(time[place[0]]), float(first[place]), float(second[place])
    )


def compare_numbers(recorded: Mapping[str, float], again: Mapping[str, float]) -> Iterator[QuantityDifference]:
    """The numbers of two tables that differ, by name; nan stands for one that a table does not have."""
    for name in dict.fromkeys([*recorded, *again]):
        pair = [np.array([table.get(name, np.nan)], float) for table in (recorded, again)]
        if pair[0].tobytes() != pair[1].tobytes() and not all(np.isnan(each).all() for each in pair):
            size = float(distances(*pair)[0])
            yield QuantityDifference(name, "", size, None, float(pair[0][0]), float(pair[1][0]))


def distances(first: Array, second: Array) -> Array:
    """The sizes of the differences: 0 where both are nan, inf where one is."""
    with np.errstate(invalid="ignore"):
        gaps = np.where(first == second, 0.0, np.abs(first - second))
    gaps = np.where(np.isnan(first) & np.isnan(second), 0.0, gaps)
    return np.where(np.isnan(gaps), np.inf, gaps)
