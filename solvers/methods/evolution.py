"""An evolution strategy: Adam along antithetic differences of values, over samples of a scenario.

Salimans et al. 2017 (arXiv 1703.03864): antithetic pairs and ranks; each pair is rolled out in a sample of its own. It
needs no derivatives, and its values include what derivatives do not: that a motion ended early.
"""

from __future__ import annotations

import math

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ScenarioSamples
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.options import require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.randomized.aggregation import evolution
from symphys.solvers.randomized.descent import (
    SURVIVING_SHARE,
    Descent,
    DescentOptions,
    DescentState,
    GradientEstimate,
    refusal,
)
from symphys.solvers.randomized.validation import NOISE_STREAM, first_sample, rate_by_validation

NOT_FINITE = "not one pair of a batch is finite: bound the variables, lower `sigma`, or add [termination]"


@dataclass(frozen=True)
class EvolutionOptions(DescentOptions):
    """Options of the evolution strategy, added to those of ``DescentOptions``; a sample is a pair of rollouts.

    Attributes:
        sigma: standard deviation of the antithetic pairs, in units of scale.
    """

    sigma: float = 0.03

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        require(0 < self.sigma < math.inf, "sigma", "above 0")


class EvolutionStrategy(Descent[EvolutionOptions]):
    """Descent along differences of values at antithetic pairs."""

    def estimate(self, state: DescentState, samples: ScenarioSamples) -> GradientEstimate | StopReason:
        """Implement ``Descent.estimate``."""
        options, evaluator = self.options, self.evaluator
        stream = np.random.default_rng([self.seed, NOISE_STREAM, state.iteration])
        found = evolution(evaluator.sample_values, state.z, options.sigma * self.scale, samples, stream)
        if not found.pairs:
            return StopReason(Status.NOT_FINITE, NOT_FINITE)
        point = first_sample(evaluator, state.z, found.first, found.merit, found.objective, options.validation)
        left_out = options.samples - found.pairs
        words = f"{found.alive:.0%} last" + f", {left_out} pairs not finite" * (left_out > 0)
        return GradientEstimate(point, found.gradient, math.nan, words, {SURVIVING_SHARE: found.alive})


EVOLUTION = make_solver(
    "evolution",
    "an evolution strategy over samples of the scenarios, drawn anew",
    EvolutionOptions,
    stage_of(EvolutionStrategy),
    refusal=refusal,
    rate=lambda options, seed: rate_by_validation(options.batch(seed)),
    scenarios=True,
)
"""An instance of ``Solver``."""
