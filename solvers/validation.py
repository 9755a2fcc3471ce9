"""Which point is kept where situations differ: that which does best in a batch of its own, drawn once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.shooting import Situations, Values
from symphys.solvers.averages import mean
from symphys.solvers.interface import Log
from symphys.solvers.meter import Meter, Point, Stop
from symphys.solvers.outcome import Array, Status

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

    def keep(self, z: Array, spoilt: int) -> int:
        """Keep the point if it does best; Stop(MET) where that is enough.

        Fewer situations that are not finite go first, then a point that meets everything in the problem's own, which
        is what a run is judged by, then the lower merit. ``spoilt`` is the number of the first at the point that was
        kept so far; returns that of the point that is kept now.
        """
        meter, count = self.meter, len(self.drawn.numbers)
        values = self.situations.value(z[None], self.drawn, meter.smoothing)
        meter.counts.rollouts += count
        known = np.isfinite(values.merit)
        merit, bad = mean(values.merit[known]), int((~known).sum())
        point = first(meter, z, values, merit, mean(values.objective[known]))
        best = meter.best is None or (bad, not point.met, merit) < (spoilt, not meter.best.met, meter.best.merit)
        kept = not self.batch.count or (best and bad < count)
        if self.log:
            lasted = "" if values.alive is None else f", {values.alive.mean():.0%} last"
            spoils = f", {bad} not finite" * (bad > 0)
            self.log(f"  validation: {merit:.5g}{lasted}{spoils}{' (kept)' * kept}")
        if not kept:
            return spoilt
        meter.best = point
        if point.met and meter.problem.stop_when_met:
            raise Stop(Status.MET)
        return bad


def first(meter: Meter, z: Array, values: Values, merit: float, objective: float) -> Point:
    """A point by means over situations, with the errors and outputs of the problem's own, which is the first."""
    errors, outputs = values.errors[0].copy(), told(values, 0)
    return Point(z, merit, objective, errors, meter.problem.met(errors), outputs)


def told(values: Values, row: int) -> Array:
    """(o,) what a row tells."""
    return np.zeros(0) if values.outputs is None else values.outputs[row].copy()
