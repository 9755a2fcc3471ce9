"""First-order descent in situations that are drawn anew in each iteration: what long motions through contact need.

Each iteration evaluates gradients in a batch of situations, the problem's own first, then takes a step of Adam along
the mean of the gradients, each shortened by itself before (``clip``): a few situations in which small changes explode
would drown all others. ``adjoint_discount`` lets adjoints fade on their way back, at the price of a bias. A batch of
its own, drawn once, decides which point is kept, since the path crosses regions that look good in a few situations
only.

Motions that are over before their time add nothing to a gradient after that, so ``fallen`` lets what they say of the
time before count more; that they were over is seen by the validation batch, through the cost of [termination].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from symphys.shooting import Drawn, ShootingProblem, Values
from symphys.solvers.core.continuation import Request
from symphys.solvers.core.driver import run
from symphys.solvers.core.evaluator import Stop
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.randomized.aggregation import Average, average, evolution, together
from symphys.solvers.randomized.descent import LASTING, Descent, DescentOptions, Found, State, stage_of
from symphys.solvers.randomized.validation import NOISE, comparing, first

NOT_FINITE = "not one situation of a batch is finite: bound the variables, lower `rate`, or add [termination]"


@dataclass(frozen=True)
class StochasticOptions(DescentOptions):
    """Options of descent in drawn situations, beside those of ``DescentOptions``.

    Attributes:
        clip: largest norm of each situation's scaled gradient; inf: none.
        adjoint_discount: [1/s] how fast adjoints fade on their way back; 0: not at all.
        fallen: weight of a motion that was over before its time.
        horizons: [s] shorter motions that gradients begin with, one after the other.
        growth: share of the iterations that these take together.
        evolution: share of the direction that comes from values alone.
        sigma: its spread, in units of scale.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    clip: float = 1.0
    adjoint_discount: float = field(default=2.0, metadata={"formerly": "forget"})
    fallen: float = 5.0
    horizons: tuple[float, ...] = ()
    growth: float = 0.5
    evolution: float = 0.0
    sigma: float = 0.03

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        super().__post_init__()
        at_least(0, adjoint_discount=self.adjoint_discount)
        require(self.clip > 0, "clip", "above 0")
        require(self.fallen > 0, "fallen", "above 0")
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        require(all(horizon > 0 for horizon in self.horizons), "horizons", "above 0")
        for name, share in {"evolution": self.evolution, "growth": self.growth}.items():
            require(0 <= share <= 1, name, "in [0, 1]")

    def horizon(self, iteration: int) -> float:
        """[s] over which the motions of an iteration are computed."""
        reached = int(len(self.horizons) * iteration / max(self.growth * self.iterations, 1))
        return self.horizons[reached] if reached < len(self.horizons) else math.inf


def solve(
    problem: ShootingProblem,
    start: Array,
    options: StochasticOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Descend. See ``interface.Solve``."""
    stage = stage_of(Pathwise, options, seed, log)
    rate = comparing(options.batch(seed))
    return run(Request("stochastic", problem, start, monitor, checkpoint, log, rate=rate), stage)


class Pathwise(Descent[StochasticOptions]):
    """Along the mean of shortened gradients."""

    def way(self, state: State, drawn: Drawn) -> Found:
        """See ``Descent``."""
        values = self.gradients(state, drawn)
        found = average(values, self.scale, self.options.clip, self.options.fallen)
        if found.left_out == len(values.merit):
            raise Stop(Status.NOT_FINITE, NOT_FINITE)
        point = first(self.meter, state.z, values, found.merit, found.objective, self.options.validation)
        words = (
            f"{found.alive:.0%} last, gradients {found.typical:.2g} (at most {found.longest:.2g}), agreement "
            f"{found.agreement:.2f}" + f", {found.left_out} not finite" * (found.left_out > 0)
        )
        told = {LASTING: found.alive, "agreement of its gradients": found.agreement}
        return Found(point, self.mixed(state, drawn, found), found.typical, words, told)

    def gradients(self, state: State, drawn: Drawn) -> Values:
        """In each situation of the batch."""
        options, meter = self.options, self.meter
        meter.counts.gradients += options.samples
        horizon = options.horizon(state.iteration)
        return self.situations.gradient(state.z[None], drawn, meter.smoothing, options.adjoint_discount, horizon)

    def mixed(self, state: State, drawn: Drawn, found: Average) -> Array:
        """The gradient that the step is made of."""
        options, meter = self.options, self.meter
        if not options.evolution:
            return found.gradient
        stream = np.random.default_rng([self.seed, NOISE, state.iteration])
        step = options.sigma * self.scale
        evolved = evolution(self.situations, state.z, step, drawn, meter.smoothing, stream)
        meter.counts.rollouts += 2 * options.samples
        return together(found.gradient, evolved.gradient, options.evolution)


STOCHASTIC = Solver(
    "stochastic", "first-order descent in situations that are drawn anew", StochasticOptions, solve, situations=True
)
"""See ``Solver``."""
