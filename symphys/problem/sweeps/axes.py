"""One axis of a sweep: the key that it changes, and the values that the key takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from symphys.errors import SymphysError
from symphys.problem.reading.value_texts import shown
from symphys.problem.schema.sweep import MOST_VALUES

Spacing = Literal["linear", "log"]
SPACINGS: tuple[Spacing, ...] = ("linear", "log")
DIGITS = 6
"""Of the distance between the ends of an axis, to which its values are rounded: they are parts of folder names."""
MOST_WHOLE = 1e15
"""Whole numbers up to this are written without a point."""


class SweepError(SymphysError):
    """A sweep that cannot be made; the message says what would be valid."""


@dataclass(frozen=True)
class Levels:
    """Values of a key, one after the other.

    Attributes:
        key: dotted, as ``--set`` takes it.
        values: as in a problem file, all different, at least one.
    """

    key: str
    values: tuple[object, ...]

    def __post_init__(self) -> None:
        """SweepError where there is no value, or one twice."""
        if not self.values:
            raise SweepError("needs at least one value")
        seen: set[str] = set()
        for value in self.values:
            if sign(value) in seen:
                raise SweepError(f"has {shown(value)} twice; leave one of them out")
            seen.add(sign(value))

    def at(self, share: float) -> object:
        """The value at a share of the axis, 0 to 1: each has an equal part of it."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]


@dataclass(frozen=True)
class Interval:
    """Any number between two ends, for samples.

    Attributes:
        key: dotted, as ``--set`` takes it.
        ends: from where to where.
        spacing: ``log``: every factor is as likely as any other.
    """

    key: str
    ends: tuple[float, float]
    spacing: Spacing = "linear"

    def __post_init__(self) -> None:
        """SweepError for ends that bound nothing."""
        check_ends(*self.ends, self.spacing)

    def at(self, share: float) -> object:
        """The number at a share of the axis, 0 to 1."""
        return between(*self.ends, share, self.spacing)


Axis = Levels | Interval


def spaced(key: str, ends: tuple[float, float], count: int, spacing: Spacing = "linear") -> Levels:
    """``count`` values from one end to the other, both included."""
    check_ends(*ends, spacing)
    if not 2 <= count <= MOST_VALUES:
        raise SweepError(f"needs a count of 2 to {MOST_VALUES:,} from one end to the other, not {count}")
    inner = [between(*ends, k / (count - 1), spacing) for k in range(1, count - 1)]
    return Levels(key, (shortest(ends[0]), *inner, shortest(ends[1])))


def check_ends(low: float, high: float, spacing: Spacing) -> None:
    """SweepError for ends that bound nothing."""
    if not (math.isfinite(low) and math.isfinite(high)):
        raise SweepError(f"needs finite ends, not {low:g} and {high:g}")
    if low == high:
        raise SweepError(f"has both ends at {low:g}; they must differ")
    if spacing == "log" and min(low, high) <= 0:
        raise SweepError(f"with log spacing needs ends above 0, not {low:g} and {high:g}")


def between(low: float, high: float, share: float, spacing: Spacing) -> float:
    """The number at a share of the way, rounded to about six digits of what tells values apart there."""
    if spacing == "log":
        value = low * (high / low) ** share
        scale = value * min(abs(math.log(high / low)), 1.0)
    else:
        value = low + (high - low) * share
        scale = abs(high - low)
    rounded = round(value, DIGITS - 1 - math.floor(math.log10(scale)))
    return shortest(min(max(rounded, min(low, high)), max(low, high)))


def shortest(value: float) -> float:
    """A whole number without a point, as a person would type it: it is part of the name of a folder."""
    return int(value) if abs(value) < MOST_WHOLE and value == int(value) else value


def sign(value: object) -> str:
    """Return a key that equal values share: 2 and 2.0 do, 1 and true do not."""
    return repr(float(value)) if isinstance(value, int | float) and not isinstance(value, bool) else repr(value)


def product(axes: Sequence[Levels]) -> int:
    """The number of points of a grid."""
    return math.prod(len(axis.values) for axis in axes)
