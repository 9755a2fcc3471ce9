"""How points are chosen on the axes of a sweep: all of a grid, or samples that fill the space evenly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from symphys.problem.schema.sweep import MOST_SAMPLES
from symphys.problem.sweeps.axes import SweepError

Kind = Literal["grid", "latin hypercube", "sobol"]
KINDS: tuple[Kind, ...] = ("grid", "latin hypercube", "sobol")


@dataclass(frozen=True)
class Samples:
    """How many points of which kind.

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
        if not 1 <= self.count <= MOST_SAMPLES:
            raise SweepError(f"{self.kind} samples need a count of 1 to {MOST_SAMPLES:,}")
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
