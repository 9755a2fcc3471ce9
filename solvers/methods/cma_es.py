"""CMA-ES by pycma (Hansen 2016, arXiv 1604.00772), through its ask-and-tell interface, in x = z / scale.

A generation is evaluated as one batch; if a candidate of it meets every target, the solve stops at the end of that
generation, and all of its rollouts count. There are no restarts. Candidates whose simulation is not finite rank last.
pycma's own options pass through ``options``; it prints nothing, and reads and writes no files. One default is not
pycma's: ``tolflatfitness`` is 50. Generations whose merits are all the same are no convergence but a plateau (see
``vanishing_gradient``), which the search leaves as its candidates spread; pycma gives up on the second one.

Where the problem has a scenario, each candidate of a generation is rated by its mean over the same few samples, which
the next generation draws anew. The start and the means of the search are validated, since what is best in a few
samples was lucky.

A solve goes on by replay: the strategy asks again from the same random stream and is told the recorded merits, so that
mean, step size, covariance and paths are the same to the last bit under any options, at the cost of no rollout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from symphys.solvers.core.checkpoint import damaged
from symphys.solvers.core.convergence import converged, not_finite
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import best_of
from symphys.solvers.core.vanishing_gradient import PLATEAU_ADVICE
from symphys.solvers.methods.cma_strategy import PLATEAU_CRITERION, CmaState, PycmaStrategy, load
from symphys.solvers.randomized.candidates import Candidates, NominalCandidates, SampledCandidates
from symphys.solvers.randomized.validation import ValidationBatch, rate_by_validation
from symphys.types import Array

BUDGET_CRITERIA = {"maxiter", "timeout"}
CONVERGENCE_CRITERIA = {"tolfun", "tolfunhist", "tolfunrel", "tolx", "ftarget"}
BUDGET = "the evaluations are used up: raise `evaluations`, or `sigma` if the step size in the trace was growing"
STALLED = "the search came to rest without converging ({}): try another seed, a larger `population` or another `sigma`"
NOT_FINITE = "not one simulation of a generation is finite: lower `sigma` or bound the variables"


@dataclass(frozen=True)
class CmaOptions(SolverOptions):
    """Options of CMA-ES.

    Attributes:
        sigma: first standard deviation, in units of scale.
        population: candidates in a generation; 0 is pycma's 4 + 3 ln n.
        evaluations: rollouts in each stage of smoothing; the generation that reaches it is the last.
        options: pycma's own, such as {tolfun = 1e-8, CMA_diagonal = 50}; cma.CMAOptions() lists them. With more than
            2,000 variables the covariance is diagonal.
        samples: of a scenario: in how many each candidate is rolled out.
        width: how widely these vary, relative to their tables.
        validation: samples that decide which mean of the search, or the start, is kept; 0: the last is.
        validation_width: how widely these vary.
        every: generations between two validations.
    """

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
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        require(0 < self.sigma < math.inf, "sigma", "above 0")
        require(self.population == 0 or self.population > 2, "population", "0 or at least 3")
        at_least(0, evaluations=self.evaluations, validation=self.validation)
        at_least(0, width=self.width, validation_width=self.validation_width)
        at_least(1, samples=self.samples, every=self.every)

    def batch(self, seed: int) -> ValidationBatch:
        """Return the validation batch, used with a scenario."""
        return ValidationBatch(self.validation, self.validation_width, seed)


class CmaEs(Method[CmaState]):
    """The method, see ``interface.Method``; every stage of smoothing restarts the same random stream.

    pycma's strategy cannot be copied. So a state is what it can be replayed from, and the strategy that made the last
    state is kept beside it: a step from that state costs no replay.
    """

    def __init__(self, context: StageContext, options: CmaOptions) -> None:
        """Set up one stage."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.seed, self.options = context.start, context.seed, options
        self.held = not np.any(self.evaluator.lower < self.evaluator.upper)
        self.candidates: Candidates = NominalCandidates(self.evaluator)
        if self.evaluator.problem.scenario is not None:
            self.candidates = SampledCandidates(
                self.evaluator, options.samples, options.width, options.batch(self.seed), options.every, context.log
            )
        self._latest: PycmaStrategy | None = None

    def init(self) -> Iteration[CmaState] | StopReason:
        """Keep the start as the first candidate; it is the only one where bounds hold every variable."""
        if self.held:
            point = self.evaluator.value(self.start)
            return Iteration(self._held_state(), point) if point.finite else not_finite(point)
        strategy = self._latest = self._fresh(self.start)
        (point,) = self.candidates.rate([self.start], 0)
        if not point.finite:
            return not_finite(point)
        self.candidates.keep(self.start, 0, due=True)
        return Iteration(strategy.state(), point, step=strategy.sigma)

    def step(self, state: CmaState) -> Iteration[CmaState] | StopReason:
        """Draw a generation, evaluate it, and update the strategy with the merits."""
        strategy, generation = self._strategy(state), len(state.merits)
        self._latest = None
        points = self.candidates.rate([self.evaluator.clip(z) for z in strategy.ask()], generation)
        best = best_of(points)
        if best is None:
            return self.candidates.conclude(StopReason(Status.NOT_FINITE, NOT_FINITE), state.start)
        strategy.tell(tuple(point.merit if point.finite else math.inf for point in points))
        self._latest = strategy
        self.candidates.keep(strategy.centre, generation + 1)
        return Iteration(strategy.state(), best, step=strategy.sigma)

    def terminate(self, state: CmaState) -> StopReason | None:
        """Stop if the budget is used up or one of pycma's criteria holds."""
        if self.held:
            return converged(self.evaluator)
        reason = self._reason(self._strategy(state))
        return None if reason is None else self.conclude(state, reason)

    def conclude(self, state: CmaState, reason: StopReason) -> StopReason:
        """Implement ``Method.conclude``: the last mean may be kept."""
        self.candidates.keep(self._strategy(state).centre, len(state.merits), due=True)
        return self.candidates.conclude(reason, state.start)

    def resume(self, saved: dict[str, Any]) -> CmaState:
        """Implement ``Method.resume``."""
        if self.held:
            return self._held_state()
        try:
            merits = tuple(tuple(float(merit) for merit in each) for each in saved["merits"])
            start, mean = (np.array(saved[name], float) for name in ("start", "mean"))
            return CmaState(start, merits, mean, float(saved["sigma"]))
        except (KeyError, TypeError, ValueError) as error:
            raise damaged(error) from error

    def _held_state(self) -> CmaState:
        return CmaState(self.start, (), np.zeros(0), self.options.sigma)

    def _reason(self, strategy: PycmaStrategy) -> StopReason | None:
        if sum(map(len, strategy.merits)) * self.candidates.rollouts >= self.options.evaluations:
            return StopReason(Status.BUDGET, BUDGET)
        reasons = strategy.stopped()
        if not reasons:
            return None
        if reasons & BUDGET_CRITERIA:
            return StopReason(Status.BUDGET, BUDGET)
        if PLATEAU_CRITERION in reasons:
            return StopReason(Status.STALLED, PLATEAU_ADVICE)
        if reasons & CONVERGENCE_CRITERIA:
            return self.candidates.converged()
        return StopReason(Status.STALLED, STALLED.format(", ".join(reasons)))

    def _strategy(self, state: CmaState) -> PycmaStrategy:
        """Return pycma's strategy in a state."""
        if self._latest is None or self._latest.merits is not state.merits:
            self._latest = self._fresh(state.start)
            self._latest.replay(state)
        return self._latest

    def _fresh(self, start: Array) -> PycmaStrategy:
        options, stream = self.options, np.random.default_rng([self.seed, 1])
        return PycmaStrategy(self.evaluator, start, options.sigma, options.population, options.options, stream)


def prepare() -> None:
    """Import pycma."""
    load()


CMA = make_solver(
    "cma",
    "CMA-ES by pycma, without derivatives",
    CmaOptions,
    stage_of(CmaEs),
    rate=lambda options, seed: rate_by_validation(options.batch(seed)),
    prepare=prepare,
    scenarios=None,
)
