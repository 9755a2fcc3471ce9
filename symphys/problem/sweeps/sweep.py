"""A sweep: some keys of a problem over their values, each combination or sample a problem of its own."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from symphys.problem.schema.sweep import MOST_SAMPLES
from symphys.problem.sweeps.axes import Axis, Interval, Levels, SweepError, product
from symphys.problem.sweeps.samples import GRID, Samples


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
        if self.samples.kind == "grid" and len(self) > MOST_SAMPLES:
            sizes = " x ".join(str(len(axis.values)) for axis in self.grid())
            raise SweepError(f"a grid of {sizes} points is too large; at most {MOST_SAMPLES:,} are allowed")

    def points(self) -> Iterator[dict[str, object]]:
        """Every point: values by key. Of a grid, the last key changes fastest.

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
