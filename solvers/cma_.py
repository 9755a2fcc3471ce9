"""CMA-ES by pycma (Hansen 2016, arXiv 1604.00772), asked and told, in x = z / scale.

A generation is evaluated as one batch; if a candidate of it meets every target, the solve stops at the end of that
generation, and all of its rollouts count. There are no restarts. Candidates whose simulation is not finite rank last.
pycma's own options pass through ``options``; it prints nothing, and reads and writes no files. One default is not
pycma's: ``tolflatfitness`` is 50. Generations whose merits are all the same are no convergence but a plateau (see
``plateau``), which the search leaves as its candidates spread; pycma gives up on the second one.

A solve goes on by replay: the strategy is asked again from the same random stream and told the recorded merits, so
that mean, step size, covariance and paths are the same to the last bit under any options, at the cost of no rollout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from symphys.shooting import ShootingProblem
from symphys.solvers.checkpoint import damaged
from symphys.solvers.cma_strategy import PLATEAU, Strategy, Trail, load
from symphys.solvers.interface import Log, Solver
from symphys.solvers.meter import Meter, Point, Verdict
from symphys.solvers.options import at_least, require
from symphys.solvers.outcome import Array, Monitor, Outcome, Status
from symphys.solvers.plateau import FLAT
from symphys.solvers.session import begin, converged, run
from symphys.solvers.staged import Request

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
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    sigma: float = 1.0
    population: int = 0
    evaluations: int = 10_000
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """ValueError that names the option and says what would be valid."""
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        require(self.population == 0 or self.population > 2, "population", "0 or at least 3")
        at_least(0, evaluations=self.evaluations)


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
        if trail:
            strategy.follow(trail)
        else:
            meter.commit(begin(meter.value(z)), strategy.trail(), step=strategy.sigma)
        return search(meter, options, strategy)

    return run(Request("cma", problem, start, monitor, checkpoint, log), stage)


def search(meter: Meter, options: CmaOptions, strategy: Strategy) -> Verdict:
    """One generation after the other."""
    verdict = None
    while verdict is None:
        verdict = ended(meter, options, strategy) or generation(meter, strategy)
    return verdict


def ended(meter: Meter, options: CmaOptions, strategy: Strategy) -> Verdict | None:
    """Whether the budget is used up or one of pycma's criteria holds."""
    if sum(map(len, strategy.merits)) >= options.evaluations:
        return Verdict(Status.BUDGET, BUDGET)
    reasons = strategy.stopped()
    if not reasons:
        return None
    if reasons & BUDGETS:
        return Verdict(Status.BUDGET, BUDGET)
    if PLATEAU in reasons:
        return Verdict(Status.STALLED, FLAT)
    return converged(meter) if reasons & CONVERGED else Verdict(Status.STALLED, STALLED.format(", ".join(reasons)))


def generation(meter: Meter, strategy: Strategy) -> Verdict | None:
    """Ask, evaluate, tell."""
    points = meter.values(meter.clip(z) for z in strategy.ask())
    best = lowest(points)
    if best is None:
        return Verdict(Status.NOT_FINITE, NOT_FINITE)
    strategy.tell(tuple(point.merit if point.finite else math.inf for point in points))
    meter.commit(best, strategy.trail(), step=strategy.sigma)
    return None


def lowest(points: list[Point]) -> Point | None:
    """The best of a generation; None if none is finite."""
    best = None
    for point in points:
        best = point if point.better(best) else best
    return best


def read_trail(saved: dict[str, Any]) -> Trail:
    """From the plain values of a checkpoint."""
    try:
        merits = tuple(tuple(float(merit) for merit in each) for each in saved["merits"])
        return Trail(np.array(saved["start"], float), merits, np.array(saved["mean"], float), float(saved["sigma"]))
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error


def prepare() -> None:
    """Import pycma."""
    load()


CMA = Solver("cma", "CMA-ES by pycma, without derivatives", CmaOptions, solve, prepare)
