"""CMA-ES by pycma (Hansen 2016, arXiv 1604.00772), asked and told, in x = z / scale.

A generation is evaluated as one batch; if a candidate of it meets every target, the solve stops at the end of that
generation, and all of its rollouts count. There are no restarts. Candidates whose simulation is not finite rank last.
pycma's own options pass through ``options``; it prints nothing, and reads and writes no files. One default is not
pycma's: ``tolflatfitness`` is 50. Generations whose merits are all the same are no convergence but a plateau (see
``plateau``), which the search leaves as its candidates spread; pycma gives up on the second one.

Where situations differ, each candidate of a generation is rated by its mean over the same few of them, which the next
generation draws anew, and the start and the means of the search are validated, since what is best in a few
situations was lucky.

A solve goes on by replay: the strategy is asked again from the same random stream and told the recorded merits, so
that mean, step size, covariance and paths are the same to the last bit under any options, at the cost of no rollout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from symphys.shooting import ShootingProblem
from symphys.solvers.core.checkpoint import damaged
from symphys.solvers.core.continuation import Request
from symphys.solvers.core.driver import begin, converged, run
from symphys.solvers.core.evaluator import Meter, Verdict
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.options import at_least, require
from symphys.solvers.core.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.core.point import Point, best_of
from symphys.solvers.core.vanishing_gradient import FLAT
from symphys.solvers.methods.cma_strategy import PLATEAU, Strategy, Trail, load
from symphys.solvers.randomized.candidates import Alone, Drawing, Trials
from symphys.solvers.randomized.validation import Batch, comparing

BUDGETS = {"maxiter", "timeout"}
CONVERGED = {"tolfun", "tolfunhist", "tolfunrel", "tolx", "ftarget"}
BUDGET = "the evaluations are used up: raise `evaluations`, or `sigma` if the step size in the trace was growing"
STALLED = "the search came to rest without converging ({}): try another seed, a larger `population` or another `sigma`"
NOT_FINITE = "not one simulation of a generation is finite: lower `sigma` or bound the variables"


@dataclass(frozen=True)
class CmaOptions:
    """Options of CMA-ES.

    Attributes:
        sigma: first standard deviation, in units of scale.
        population: candidates in a generation; 0 is pycma's 4 + 3 ln n.
        evaluations: rollouts in each stage of smoothing; the generation that reaches it is the last.
        options: pycma's own, such as {tolfun = 1e-8, CMA_diagonal = 50}; cma.CMAOptions() lists them. With more than
            2,000 variables the covariance is diagonal.
        samples: where situations differ: in how many each candidate is rolled out.
        width: how widely these vary, relative to their tables.
        validation: situations that decide which mean of the search, or the start, is kept; 0: the last is.
        validation_width: how widely these vary.
        every: generations between two validations.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    sigma: float = 1.0
    population: int = 0
    evaluations: int = 10_000
    options: dict[str, Any] = field(default_factory=dict)
    samples: int = 8
    width: float = 1.5
    validation: int = 64
    validation_width: float = 1.3
    every: int = 5

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        require(self.population == 0 or self.population > 2, "population", "0 or at least 3")
        at_least(0, evaluations=self.evaluations, validation=self.validation)
        at_least(0, width=self.width, validation_width=self.validation_width)
        at_least(1, samples=self.samples, every=self.every)

    def batch(self, seed: int) -> Batch:
        """For validation, where situations differ."""
        return Batch(self.validation, self.validation_width, seed)


def solve(
    problem: ShootingProblem,
    start: Array,
    options: CmaOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
) -> Outcome:
    """Search; every stage of smoothing draws from the same stream anew. See ``interface.Solve``."""

    def stage(meter: Meter, z: Array, saved: dict[str, object] | None) -> Verdict:
        if not np.any(meter.lower < meter.upper):
            meter.commit(begin(meter.value(z)), {"free": 0})
            return converged(meter)
        trail = read_trail(saved) if saved else None
        stream = np.random.default_rng([seed, 1])
        strategy = Strategy(
            meter, trail.start if trail else z, options.sigma, options.population, options.options, stream
        )
        search = Search(meter, options, strategy, trials(meter, options, seed, log))
        strategy.follow(trail) if trail else search.begin(z)
        return search.run()

    rate = comparing(options.batch(seed)) if problem.situations else None
    return run(Request("cma", problem, start, monitor, checkpoint, log, rate=rate), stage)


def trials(meter: Meter, options: CmaOptions, seed: int, log: Log | None) -> Trials:
    """How candidates are rated."""
    situations = meter.problem.situations
    if situations is None:
        return Alone(meter)
    return Drawing(meter, situations, options.samples, options.width, options.batch(seed), options.every, log)


class Search:
    """One generation after the other."""

    def __init__(self, meter: Meter, options: CmaOptions, strategy: Strategy, trials: Trials) -> None:
        """Nothing is asked for yet."""
        self.meter, self.options, self.strategy, self.trials = meter, options, strategy, trials

    def begin(self, z: Array) -> None:
        """Evaluate where it begins, which is the first point that may be kept."""
        point = self.trials.start(z)
        self.trials.keep(z, self.generations, due=True)
        self.commit(point)

    def run(self) -> Verdict:
        """Until something ends it."""
        verdict = None
        while verdict is None:
            verdict = self.ended() or self.generation()
        if verdict.status is not Status.NOT_FINITE:
            self.trials.keep(self.strategy.centre, self.generations, due=True)
        return self.trials.told(verdict, self.strategy.start)

    @property
    def generations(self) -> int:
        """How many are over."""
        return len(self.strategy.merits)

    def ended(self) -> Verdict | None:
        """Whether the budget is used up or one of pycma's criteria holds."""
        if sum(map(len, self.strategy.merits)) * self.trials.rollouts >= self.options.evaluations:
            return Verdict(Status.BUDGET, BUDGET)
        reasons = self.strategy.stopped()
        if not reasons:
            return None
        if reasons & BUDGETS:
            return Verdict(Status.BUDGET, BUDGET)
        if PLATEAU in reasons:
            return Verdict(Status.STALLED, FLAT)
        if reasons & CONVERGED:
            return self.trials.converged()
        return Verdict(Status.STALLED, STALLED.format(", ".join(reasons)))

    def generation(self) -> Verdict | None:
        """Ask, evaluate, tell."""
        points = self.trials.rate([self.meter.clip(z) for z in self.strategy.ask()], self.generations)
        best = best_of(points)
        if best is None:
            return Verdict(Status.NOT_FINITE, NOT_FINITE)
        self.strategy.tell(tuple(point.merit if point.finite else math.inf for point in points))
        self.trials.keep(self.strategy.centre, self.generations)
        self.commit(best)
        return None

    def commit(self, point: Point) -> None:
        """End an iteration."""
        self.meter.commit(point, self.strategy.trail(), step=self.strategy.sigma)


def read_trail(saved: dict[str, Any]) -> Trail:
    """From the plain values of a checkpoint."""
    try:
        merits = tuple(tuple(float(merit) for merit in each) for each in saved["merits"])
        start, mean = (np.array(saved[name], float) for name in ("start", "mean"))
        return Trail(start, merits, mean, float(saved["sigma"]))
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error


def prepare() -> None:
    """Import pycma."""
    load()


CMA = Solver("cma", "CMA-ES by pycma, without derivatives", CmaOptions, solve, prepare, situations=None)
