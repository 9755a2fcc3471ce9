"""Which point is kept where situations differ: that which does best in a batch of its own, drawn once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symphys.shooting import Situations, Values
from symphys.solvers.core.comparison import Rate
from symphys.solvers.core.evaluator import Meter, Stop, Verdict
from symphys.solvers.core.interface import Log
from symphys.solvers.core.outcome import Array, Status
from symphys.solvers.core.point import Point
from symphys.solvers.randomized.aggregation import mean

NO_BETTER = (
    "no point did better in the situations for validation than the start, which is kept: take smaller steps, another "
    "seed or another solver"
)
VALIDATION, SITUATIONS, NOISE = 1, 2, 3
"""Streams of random numbers."""


@dataclass(frozen=True)
class Batch:
    """How situations for validation are drawn.

    Attributes:
        count: how many; 0: every point is kept.
        width: how widely they vary, relative to their tables.
        seed: of the solve.
    """

    count: int
    width: float
    seed: int


class Validation:
    """Compares points in the same situations, the problem's own among them."""

    def __init__(self, meter: Meter, situations: Situations, batch: Batch, log: Log | None) -> None:
        """Draw them."""
        self.meter, self.situations, self.batch, self.log = meter, situations, batch, log
        stream = np.random.default_rng([batch.seed, VALIDATION])
        self.drawn = situations.draw(stream, max(batch.count, 1), batch.width)

    def keep(self, z: Array) -> None:
        """Keep the point if it does best; Stop(MET) where that is enough.

        Fewer situations that are not finite go first, then a point that meets everything in the problem's own, which
        is what a run is judged by, then the lower merit. A point that is not finite in the problem's own is not kept.
        """
        meter, batch = self.meter, self.batch
        point, lasted = self.rated(z)
        kept = not batch.count or (point.better(meter.best) and point.spoilt < len(self.drawn.numbers))
        if self.log:
            spoils = f", {point.spoilt} not finite" * (point.spoilt > 0)
            self.log(f"  validation: {point.merit:.5g}{lasted}{spoils}{' (kept)' * kept}")
        if not kept:
            return
        meter.best = point
        if point.met and meter.problem.stop_when_met:
            raise Stop(Status.MET)

    def told(self, verdict: Verdict, start: Array) -> Verdict:
        """The verdict on a stage, or what to say where its start (n,) is kept."""
        best = self.meter.best
        if best is None or not np.array_equal(best.z, start):
            return verdict
        return Verdict(Status.STALLED if verdict.status is Status.CONVERGED else verdict.status, NO_BETTER)

    def rated(self, z: Array) -> tuple[Point, str]:
        """The point by its means, and words on how many motions last."""
        values = self.situations.value(z[None], self.drawn, self.meter.smoothing)
        self.meter.counts.rollouts += len(self.drawn.numbers)
        known = np.isfinite(values.merit)
        means = mean(values.merit[known]), mean(values.objective[known])
        point = first(self.meter, z, values, *means, spoilt=int((~known).sum()))
        return point, "" if values.alive is None else f", {values.alive.mean():.0%} last"


def comparing(batch: Batch) -> Rate:
    """Rates points as a validation does, where there are situations to validate in."""

    def rate(meter: Meter, Z: Sequence[Array]) -> list[Point]:
        if meter.problem.situations is None or not batch.count:
            return []
        validation = Validation(meter, meter.problem.situations, batch, None)
        return [validation.rated(z)[0] for z in Z]

    return rate


def first(meter: Meter, z: Array, values: Values, merit: float, objective: float, spoilt: int) -> Point:
    """A point by means over situations, with the errors and outputs of the problem's own, which is the first."""
    errors, outputs = values.errors[0].copy(), told(values, 0)
    return Point(z, merit, objective, errors, meter.problem.met(errors), outputs, spoilt=spoilt)


def told(values: Values, row: int) -> Array:
    """(o,) what a row tells."""
    return np.zeros(0) if values.outputs is None else values.outputs[row].copy()
