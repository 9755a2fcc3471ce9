"""Evaluation of the candidates of a search: one rollout each, or the mean over samples of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from symphys.shooting import ScenarioSamples
from symphys.solvers.core.convergence import converged
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Log
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.randomized.validation import SAMPLE_STREAM, Validation, ValidationBatch, outputs_of
from symphys.types import Array


class Candidates(Protocol):
    """Evaluates candidates, and decides which points are kept.

    Attributes:
        rollouts: for each candidate.
    """

    rollouts: int

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """Evaluate a generation."""
        ...

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """Decide whether the mean of a search is kept; ``due``: in whatever generation."""
        ...

    def converged(self) -> StopReason:
        """Return why a converged search ends."""
        ...

    def conclude(self, reason: StopReason, start: Array) -> StopReason:
        """Return why a search from ``start`` (n,) ended, or that its start is kept."""
        ...


class NominalCandidates:
    """Evaluation in the problem's own sample, where the best candidate is kept."""

    rollouts = 1

    def __init__(self, evaluator: CountingEvaluator) -> None:
        """Evaluate by this evaluator."""
        self.evaluator = evaluator

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """Implement ``Candidates.rate``."""
        return self.evaluator.values(Z)

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """Implement ``Candidates.keep``."""

    def converged(self) -> StopReason:
        """Implement ``Candidates.converged``."""
        return converged(self.evaluator)

    def conclude(self, reason: StopReason, start: Array) -> StopReason:
        """Implement ``Candidates.conclude``."""
        return reason


class SampledCandidates:
    """Evaluation in samples that each generation redraws; means of the search are validated."""

    def __init__(
        self,
        evaluator: CountingEvaluator,
        samples: int,
        width: float,
        batch: ValidationBatch,
        every: int,
        log: Log,
    ) -> None:
        """Use ``samples`` for each candidate; validate after ``every`` generations."""
        self.evaluator, self.rollouts, self.width, self.every = evaluator, samples, width, every
        self.validation = Validation(evaluator, batch, log)

    def rate(self, Z: Sequence[Array], generation: int) -> list[Point]:
        """Implement ``Candidates.rate``: means; a candidate with a motion that is not finite is not finite."""
        scenario, batch, each = self.evaluator.scenario, self.validation.batch, self.rollouts
        stream = np.random.default_rng([batch.seed, SAMPLE_STREAM, generation])
        drawn = scenario.draw(stream, each, self.width, generation % len(scenario.grids))
        many = ScenarioSamples(drawn.grid, np.tile(drawn.numbers, (len(Z), 1)))
        values = self.evaluator.sample_values(np.repeat(np.array(Z), each, axis=0), many)
        met = self.evaluator.problem.met
        merits, objectives = (part.reshape(-1, each).mean(axis=1) for part in (values.merit, values.objective))
        return [
            Point(
                z,
                merit,
                objective,
                errors.copy(),
                met(errors),
                outputs_of(values, k * each),
                failed_samples=batch.count,
            )
            for k, (z, merit, objective, errors) in enumerate(
                zip(Z, merits.tolist(), objectives.tolist(), values.errors[::each], strict=True)
            )
        ]

    def keep(self, z: Array, generation: int, due: bool = False) -> None:
        """Implement ``Candidates.keep``."""
        if due or generation % self.every == 0:
            self.validation.keep(self.evaluator.clip(z))

    def converged(self) -> StopReason:
        """Implement ``Candidates.converged``."""
        return StopReason(Status.CONVERGED)

    def conclude(self, reason: StopReason, start: Array) -> StopReason:
        """Implement ``Candidates.conclude``."""
        return self.validation.conclude(reason, start)
