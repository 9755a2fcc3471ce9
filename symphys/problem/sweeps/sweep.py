"""A sweep: axes, each a key of a problem with its values, and the points on them, each a problem of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Literal

from symphys.errors import SymphysError
from symphys.problem.reading.messages import shown
from symphys.problem.schema.sweep import MAX_SAMPLES, MAX_VALUES
from symphys.records import dataclass

Spacing = Literal["linear", "log"]
SPACINGS: tuple[Spacing, ...] = ("linear", "log")
DIGITS = 6
"""Of the distance between the ends of an axis, to which its values are rounded: they are parts of folder names."""
MAX_WHOLE = 1e15
"""Whole numbers up to this are written without a point."""
Kind = Literal["grid", "latin hypercube", "sobol"]
KINDS: tuple[Kind, ...] = ("grid", "latin hypercube", "sobol")


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
    if not 2 <= count <= MAX_VALUES:
        raise SweepError(f"needs a count of 2 to {MAX_VALUES:,} from one end to the other, not {count}")
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
    return int(value) if abs(value) < MAX_WHOLE and value == int(value) else value


def sign(value: object) -> str:
    """Return a key that equal values share: 2 and 2.0 do, 1 and true do not."""
    return repr(float(value)) if isinstance(value, int | float) and not isinstance(value, bool) else repr(value)


def product(axes: Sequence[Levels]) -> int:
    """The number of points of a grid."""
    return math.prod(len(axis.values) for axis in axes)


@dataclass(frozen=True)
class Samples:
    """The kind and number of points.

    Attributes:
        kind: "grid", "latin hypercube" or "sobol".
        count: of samples; 0 for a grid, which has as many as its axes make.
        seed: of the random numbers of samples.
    """

    kind: Kind = "grid"
    count: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        """SweepError for a number of points that the kind cannot have."""
        if self.kind == "grid":
            if self.count:
                raise SweepError("a grid has as many points as its axes make; a count belongs to samples")
            return
        if not 1 <= self.count <= MAX_SAMPLES:
            raise SweepError(f"{self.kind} samples need a count of 1 to {MAX_SAMPLES:,}")
        if self.kind == "sobol" and self.count & (self.count - 1):
            below = 1 << (self.count.bit_length() - 1)
            raise SweepError(f"a count of Sobol points is a power of two, such as {below} or {2 * below}")

    def shares(self, axes: int) -> Iterator[tuple[float, ...]]:
        """Points of the unit cube with so many axes; the same ones every time."""
        from scipy.stats import qmc  # only here: the import takes a second

        if self.kind == "sobol":
            points = qmc.Sobol(axes, scramble=True, seed=self.seed).random_base2(self.count.bit_length() - 1)
        else:
            points = qmc.LatinHypercube(axes, seed=self.seed).random(self.count)
        return (tuple(map(float, point)) for point in points)


GRID = Samples()


@dataclass(frozen=True)
class Sweep:
    """Points, each a value for every key.

    Attributes:
        axes: what varies, at least one axis.
        samples: which points of all that the axes span.
    """

    axes: tuple[Axis, ...]
    samples: Samples = GRID

    def __len__(self) -> int:
        """The number of points."""
        return self.samples.count or product(self.grid())

    def words(self) -> str:
        """Describe the sweep in a line: ``30 points, a grid of ball.mass, ground.friction``."""
        keys = ", ".join(axis.key for axis in self.axes)
        if self.samples.count:
            return f"{self.samples.count} points, {self.samples.kind} samples of {keys}"
        complete = all(isinstance(axis, Levels) for axis in self.axes)
        return f"{len(self)} points, a grid of {keys}" if complete else f"samples of {keys}, of which there is no count"

    def grid(self) -> list[Levels]:
        """The axes of a grid; SweepError where one has no values of its own."""
        for axis in self.axes:
            if isinstance(axis, Interval):
                low, high = axis.ends
                text = f"needs a count in a grid: --sweep {axis.key}={low:g}:{high:g}:10, or count = 10 in a file"
                raise SweepError(f"{axis.key} {text}; or take samples: --samples lhs:64")
        return [axis for axis in self.axes if isinstance(axis, Levels)]

    def check(self) -> None:
        """SweepError where there is no point, or more than can be."""
        if not self.axes:
            raise SweepError("there is nothing to sample; add an axis: --sweep ball.mass=0.2:2")
        if self.samples.kind == "grid" and len(self) > MAX_SAMPLES:
            sizes = " x ".join(str(len(axis.values)) for axis in self.grid())
            raise SweepError(f"a grid of {sizes} points is too large; at most {MAX_SAMPLES:,} are allowed")

    def points(self) -> Iterator[dict[str, object]]:
        """Yield every point: values by key. Of a grid, the last key changes fastest.

        SweepError where two samples are the same: they would be one run.
        """
        self.check()
        if self.samples.kind == "grid":
            for values in itertools.product(*(axis.values for axis in self.grid())):
                yield {axis.key: value for axis, value in zip(self.axes, values, strict=True)}
            return
        seen: set[str] = set()
        for shares in self.samples.shares(len(self.axes)):
            point = {axis.key: axis.at(share) for axis, share in zip(self.axes, shares, strict=True)}
            if repr(point) in seen:
                raise SweepError(self.too_many())
            seen.add(repr(point))
            yield point

    def too_many(self) -> str:
        """Return the message for two equal samples."""
        text = f"{self.samples.count} samples are more than these axes can tell apart"
        if any(isinstance(axis, Interval) for axis in self.axes):
            return f"{text}; take fewer"
        return f"{text}: they have {product(self.grid())} points; take the grid, or KEY=FROM:TO without a count"
