"""An evolution strategy: Adam along differences of values to either side of a point, in situations that differ.

Salimans et al. 2017 (arXiv 1703.03864): antithetic pairs and ranks; each pair is rolled out in a situation of its own.
It needs no derivatives, and sees what they do not: that a motion was over before its time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from symphys.shooting import Drawn, ShootingProblem
from symphys.solvers.core.continuation import Request
from symphys.solvers.core.driver import run
from symphys.solvers.core.evaluator import Stop
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.options import require
from symphys.solvers.core.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.randomized.aggregation import evolution
from symphys.solvers.randomized.descent import LASTING, Descent, DescentOptions, Found, State, stage_of
from symphys.solvers.randomized.validation import NOISE, comparing, first

NOT_FINITE = "not one pair of a batch is finite: bound the variables, lower `sigma`, or add [termination]"


@dataclass(frozen=True)
class EvolutionOptions(DescentOptions):
    """Options of the evolution strategy, beside those of ``DescentOptions``; each sample is a pair of rollouts.

    Attributes:
        sigma: how far pairs lie to either side, in units of scale.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    sigma: float = 0.03

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        super().__post_init__()
        require(0 < self.sigma < math.inf, "sigma", "above 0")


def solve(
    problem: ShootingProblem,
    start: Array,
    options: EvolutionOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Descend. See ``interface.Solve``."""
    stage = stage_of(ByValues, options, seed, log)
    rate = comparing(options.batch(seed))
    return run(Request("evolution", problem, start, monitor, checkpoint, log, rate=rate), stage)


class ByValues(Descent[EvolutionOptions]):
    """Along what pairs of values say."""

    def way(self, state: State, drawn: Drawn) -> Found:
        """See ``Descent``."""
        options, meter = self.options, self.meter
        stream = np.random.default_rng([self.seed, NOISE, state.iteration])
        step = options.sigma * self.scale
        found = evolution(self.situations, state.z, step, drawn, meter.smoothing, stream)
        meter.counts.rollouts += 2 * options.samples
        if not found.pairs:
            raise Stop(Status.NOT_FINITE, NOT_FINITE)
        point = first(meter, state.z, found.first, found.merit, found.objective, options.validation)
        left_out = options.samples - found.pairs
        words = f"{found.alive:.0%} last" + f", {left_out} pairs not finite" * (left_out > 0)
        return Found(point, found.gradient, math.nan, words, {LASTING: found.alive})


EVOLUTION = Solver(
    "evolution", "an evolution strategy in situations that are drawn anew", EvolutionOptions, solve, situations=True
)
"""See ``Solver``."""
