"""Validation: the point is kept that does best in a separate set of samples.

The validation samples are drawn once, so that all points are compared in the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.records import dataclass
from symphys.shooting import Values
from symphys.solvers.core.continuation import Rate
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Log
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.randomized.aggregation import mean
from symphys.types import Array

NO_BETTER = (
    "no point did better in the validation samples than the start, which is kept: take smaller steps, another "
    "seed or another solver"
)
VALIDATION_STREAM, SAMPLE_STREAM, NOISE_STREAM = 1, 2, 3
"""Streams of random numbers."""


@dataclass(frozen=True)
class ValidationBatch:
    """Number, width and seed of the validation samples.

    Attributes:
        count: how many; 0: every point is kept.
        width: how widely they vary, relative to their tables.
        seed: of the solve.
    """

    count: int
    width: float
    seed: int


class Validation:
    """Compares points in the same samples, the problem's own among them."""

    def __init__(self, evaluator: CountingEvaluator, batch: ValidationBatch, log: Log) -> None:
        """Draw the samples."""
        self.evaluator, self.batch, self.log = evaluator, batch, log
        stream = np.random.default_rng([batch.seed, VALIDATION_STREAM])
        self.samples = evaluator.scenario.draw(stream, max(batch.count, 1), batch.width)

    def keep(self, z: Array) -> None:
        """Make the point the incumbent if it does best; raise Stop where everything is met.

        Fewer samples that are not finite go first, then a point that meets everything in the problem's own sample,
        which is what a run is judged by, then the lower merit. A point that is not finite in that sample is not kept.
        """
        incumbent = self.evaluator.incumbent
        point, lasted = self.rated(z)
        kept = not self.batch.count or (
            point.better(incumbent.best) and point.failed_samples < len(self.samples.numbers)
        )
        failed = f", {point.failed_samples} not finite" * (point.failed_samples > 0)
        self.log(f"  validation: {point.merit:.5g}{lasted}{failed}{' (kept)' * kept}")
        if kept:
            incumbent.replace(point)

    def conclude(self, reason: StopReason, start: Array) -> StopReason:
        """Return why a stage ended, or that its start (n,) is kept, unless a limit of the solve intervened."""
        best = self.evaluator.incumbent.best
        if reason.whole or best is None or not np.array_equal(best.z, start):
            return reason
        return StopReason(Status.STALLED if reason.status is Status.CONVERGED else reason.status, NO_BETTER)

    def rated(self, z: Array) -> tuple[Point, str]:
        """Return the point by its means, and for the log how many motions survive."""
        values = self.evaluator.sample_values(z[None], self.samples)
        finite = np.isfinite(values.merit)
        means = mean(values.merit[finite]), mean(values.objective[finite])
        point = first_sample(self.evaluator, z, values, *means, failed=int((~finite).sum()))
        return point, "" if values.alive is None else f", {values.alive.mean():.0%} last"


def rate_by_validation(batch: ValidationBatch) -> Rate:
    """Return a ``Rate`` by validation, or by one rollout for each point without a scenario."""

    def rate(evaluator: CountingEvaluator, Z: Sequence[Array]) -> list[Point]:
        if evaluator.problem.scenario is None:
            return evaluator.rate(Z)
        if not batch.count:
            return []
        validation = Validation(evaluator, batch, lambda line: None)
        return [validation.rated(z)[0] for z in Z]

    return rate


def first_sample(
    evaluator: CountingEvaluator, z: Array, values: Values, merit: float, objective: float, failed: int
) -> Point:
    """Return a point by means over samples, with errors and outputs of the first, the problem's own."""
    errors = values.errors[0].copy()
    return Point(
        z, merit, objective, errors, evaluator.problem.met(errors), outputs_of(values, 0), failed_samples=failed
    )


def outputs_of(values: Values, row: int) -> Array:
    """Return the outputs (o,) of a row."""
    return np.zeros(0) if values.outputs is None else values.outputs[row].copy()
