"""First-order descent over samples of a scenario, redrawn in each iteration: for long motions through contact.

Each iteration evaluates gradients in a batch of samples, the problem's own first, then takes a step of Adam along the
mean of the gradients, each shortened by itself before (``clip``): a few samples in which small changes explode would
drown all others. ``adjoint_discount`` lets adjoints decay on their way back, at the price of a bias. A batch of its
own, drawn once, decides which point is kept, since the path crosses regions that look good in a few samples only.

Motions that end early add nothing to a gradient after that, so ``fallen`` raises the weight of their gradient of the
time before. Validation rates that they end early, through the cost of [termination].
"""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ScenarioSamples
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.randomized.aggregation import GradientAverage, average, evolution, mixed
from symphys.solvers.randomized.descent import (
    SURVIVING_SHARE,
    Descent,
    DescentOptions,
    DescentState,
    GradientEstimate,
    refusal,
)
from symphys.solvers.randomized.validation import NOISE_STREAM, first_sample, rate_by_validation
from symphys.types import Array

NOT_FINITE = "not one sample of a batch is finite: bound the variables, lower `rate`, or add [termination]"


@dataclass(frozen=True)
class StochasticOptions(DescentOptions):
    """Options of descent over samples, added to those of ``DescentOptions``.

    Attributes:
        clip: largest norm of each sample's scaled gradient; inf: none.
        adjoint_discount: [1/s] decay rate of the adjoint, backwards in time.
        fallen: weight of the gradient of a motion that ended early.
        horizons: [s] shorter motions with which training begins, in this order.
        growth: share of the iterations that the ``horizons`` take together.
        evolution: share of the direction from an evolution strategy.
        sigma: standard deviation of that strategy, in units of scale.
    """

    clip: float = 1.0
    adjoint_discount: float = field(default=2.0, metadata={"was": "forget"})
    fallen: float = 5.0
    horizons: tuple[float, ...] = ()
    growth: float = 0.5
    evolution: float = 0.0
    sigma: float = 0.03

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(0, adjoint_discount=self.adjoint_discount)
        require(self.clip > 0, "clip", "above 0")
        require(self.fallen > 0, "fallen", "above 0")
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        require(all(horizon > 0 for horizon in self.horizons), "horizons", "above 0")
        for name, share in {"evolution": self.evolution, "growth": self.growth}.items():
            require(0 <= share <= 1, name, "in [0, 1]")

    def horizon(self, iteration: int) -> float:
        """Return the simulated duration [s] of an iteration."""
        reached = int(len(self.horizons) * iteration / max(self.growth * self.iterations, 1))
        return self.horizons[reached] if reached < len(self.horizons) else math.inf


class StochasticDescent(Descent[StochasticOptions]):
    """Descent along the mean of clipped gradients."""

    def estimate(self, state: DescentState, samples: ScenarioSamples) -> GradientEstimate | StopReason:
        """Implement ``Descent.estimate``."""
        options = self.options
        horizon = options.horizon(state.iteration)
        values = self.evaluator.sample_gradients(state.z, samples, options.adjoint_discount, horizon)
        found = average(values, self.scale, options.clip, options.fallen)
        if found.left_out == len(values.merit):
            return StopReason(Status.NOT_FINITE, NOT_FINITE)
        point = first_sample(self.evaluator, state.z, values, found.merit, found.objective, options.validation)
        words = (
            f"{found.alive:.0%} last, gradients {found.typical:.2g} (at most {found.longest:.2g}), agreement "
            f"{found.agreement:.2f}" + f", {found.left_out} not finite" * (found.left_out > 0)
        )
        outputs = {SURVIVING_SHARE: found.alive, "agreement of its gradients": found.agreement}
        return GradientEstimate(point, self._mixed(state, samples, found), found.typical, words, outputs)

    def _mixed(self, state: DescentState, samples: ScenarioSamples, found: GradientAverage) -> Array:
        """Return the gradient of the step, mixed with that of the evolution strategy."""
        options = self.options
        if not options.evolution:
            return found.gradient
        stream = np.random.default_rng([self.seed, NOISE_STREAM, state.iteration])
        by_values = evolution(self.evaluator.sample_values, state.z, options.sigma * self.scale, samples, stream)
        return mixed(found.gradient, by_values.gradient, options.evolution)


STOCHASTIC = make_solver(
    "stochastic",
    "first-order descent over samples of the scenarios, drawn anew",
    StochasticOptions,
    stage_of(StochasticDescent),
    refusal=refusal,
    rate=lambda options, seed: rate_by_validation(options.batch(seed)),
    scenarios=True,
)
"""An instance of ``Solver``."""
