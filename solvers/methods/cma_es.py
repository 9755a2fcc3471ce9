"""CMA-ES by pycma (Hansen 2016, arXiv 1604.00772), through its ask-and-tell interface, in x = z / scale.

A generation is evaluated as one batch; if a candidate of it meets every target, the solve stops at the end of that
generation, and all of its rollouts count. There are no restarts. Candidates whose simulation is not finite rank last.
pycma's own options pass through ``options``; it prints nothing, and reads and writes no files. One default is not
pycma's: ``tolflatfitness`` is 50. Generations whose merits are all the same are no convergence but a plateau (see
``core.convergence``), which the search leaves as its candidates spread; pycma gives up on the second one.

Where the problem has a scenario, each candidate of a generation is rated by its mean over the same few samples, which
the next generation draws anew. The start and the means of the search are validated, since what is best in a few
samples was lucky.

A solve goes on by replay: the strategy draws again from the same random stream and takes the recorded merits, so that
mean, step size, covariance and paths are the same to the last bit under any options, at the cost of no rollout.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import ScenarioSamples
from symphys.solvers.core.checkpoint import damaged
from symphys.solvers.core.convergence import PLATEAU_ADVICE, converged, not_finite
from symphys.solvers.core.driver import make_solver, stage_of
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Log, Method, Solver, StageContext
from symphys.solvers.core.options import SolverOptions, at_least, nearest, refuse, require
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point, best_of
from symphys.solvers.core.subspace import SearchSpace, search_space
from symphys.solvers.randomized.validation import (
    SAMPLE_STREAM,
    Validation,
    ValidationBatch,
    outputs_of,
    rate_by_validation,
)
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


RESERVED = {
    "bounds": "the bounds of the problem's variables are used",
    "fixed_variables": "a variable is held by equal bounds",
    "seed": "the seed of the solve is used",
    "randn": "the seed of the solve is used",
    "popsize": "use population",
    "maxfevals": "use evaluations",
    "signals_filename": "no files are read",
    "verbose": "pycma is kept silent, see the trace",
}
"""Options of pycma that are not passed on, each with the reason."""
TEXT_OPTIONS = {"BoundaryHandler": ("BoundTransform", "BoundPenalty")}
"""The options that take a name of pycma's, and which. It evaluates any other text as Python: so none can be allowed."""
SILENT_OPTIONS = {"verbose": -9, "verb_log": 0, "verb_disp": 0, "signals_filename": "", "seed": math.nan}
PLATEAU_CRITERION = "tolflatfitness"
"""The criterion that ends a search on a plateau: more generations in a row without a difference than this option."""
DEFAULT_OPTIONS = {PLATEAU_CRITERION: 50}
"""Defaults that differ from pycma's own."""
MAX_FULL_COVARIANCE = 2000
"""Largest number of variables with a full covariance; beyond it is diagonal (Ros, Hansen 2008)."""
PLATEAU_CRITERIA = {"tolfun", "tolfunhist", "tolfunrel", "flat fitness"}
"""Criteria of pycma that take a plateau for convergence."""
REPLAY_DIFFERS = "this checkpoint leads elsewhere with the present versions of pycma and numpy: start afresh without it"


@dataclass(frozen=True)
class CmaState:
    """The state between two generations, from which pycma's strategy is replayed.

    Attributes:
        start: (n,) z where the strategy began.
        merits: (population,) of every generation so far, in the order in which its candidates were asked for.
        mean, sigma: where that led, to compare; mean (free,) as pycma stores it.
    """

    start: Array
    merits: tuple[tuple[float, ...], ...]
    mean: Array
    sigma: float


class PycmaStrategy:
    """pycma's CMAEvolutionStrategy in a space, in x / scale, without coordinates whose bounds are equal."""

    def __init__(
        self,
        space: SearchSpace,
        sigma: float,
        population: int,
        options: Mapping[str, Any],
        stream: np.random.Generator,
    ) -> None:
        """Begin at the start of ``space`` with the standard deviation ``sigma``; SymphysError for invalid options."""
        cma = load()
        check(options, cma.CMAOptions.defaults())
        self.stream, self.space = stream, space
        self.free = space.lower < space.upper
        bounds = [sides(bound / space.scale, self.free) for bound in (space.lower, space.upper)]
        named = {name: getattr(cma, options[name]) for name in TEXT_OPTIONS if name in options}
        diagonal = {"CMA_diagonal": True} if self.free.sum() > MAX_FULL_COVARIANCE else {}
        own = {
            **DEFAULT_OPTIONS,
            **diagonal,
            **options,
            **named,
            **SILENT_OPTIONS,
            "bounds": bounds,
            "randn": self.draw,
        }
        if population:
            own["popsize"] = population
        with pycma():
            kind = single(cma) if self.free.sum() == 1 else cma.CMAEvolutionStrategy
            self.es = kind((space.origin / space.scale)[self.free], sigma, own)
        self.merits: tuple[tuple[float, ...], ...] = ()
        self._reasons: set[str] | None = None

    def draw(self, *shape: int) -> Array:
        """Draw standard normals."""
        return self.stream.standard_normal(shape)

    def ask(self) -> list[Array]:
        """Return a generation of z (n,)."""
        self.stopped()  # pycma counts the generations of a plateau there
        with pycma():
            self.asked = self.es.ask()
        return [self.full(x) for x in self.asked]

    def tell(self, merits: tuple[float, ...]) -> None:
        """Update the strategy with the merits of the generation; inf ranks last."""
        with pycma():
            self.es.tell(self.asked, list(merits))
        self.es.sm.randn = self.draw  # a sampler that pycma makes on its way would draw from numpy's global stream
        self.merits, self._reasons = (*self.merits, merits), None

    def stopped(self) -> set[str]:
        """Return which of pycma's own criteria hold; evaluated once a generation."""
        if self._reasons is None:
            with pycma():
                reasons = set(self.es.stop())
            plateau = bool(self.merits) and min(self.merits[-1]) == max(self.merits[-1])
            self._reasons = reasons - PLATEAU_CRITERIA if plateau else reasons
        return self._reasons

    def state(self) -> CmaState:
        """Return the data that a replay needs."""
        return CmaState(self.space.start, self.merits, self.es.mean.copy(), self.sigma)

    def at(self, state: CmaState) -> bool:
        """Whether the strategy is in a state."""
        return self.merits is state.merits or (
            self.merits == state.merits and np.array_equal(self.es.mean, state.mean) and self.sigma == state.sigma
        )

    def replay(self, state: CmaState) -> None:
        """Replay the generations of a state; SymphysError if the result differs."""
        for merits in state.merits:
            self.ask()
            self.tell(merits)
        same = self.es.mean.shape == state.mean.shape and np.allclose(self.es.mean, state.mean, rtol=1e-6)
        if not same or not math.isclose(self.sigma, state.sigma, rel_tol=1e-6):
            raise SymphysError(REPLAY_DIFFERS)
        self.merits = state.merits

    @property
    def sigma(self) -> float:
        """The present step size."""
        return float(self.es.sigma)

    @property
    def centre(self) -> Array:
        """Return z (n,) of the mean."""
        return self.full(self.es.result.xfavorite)

    def full(self, x: Array) -> Array:
        """Return z (n,) of a candidate (free,)."""
        full = self.space.origin.copy()
        full[self.free] = np.asarray(x) * self.space.scale[self.free]
        return self.space.z(full)


UNUSED = "matplotlib", "scipy.stats"
"""What pycma imports for plots and surrogate models; both take longer to import than most problems to solve."""


def load() -> Any:
    """Import and return pycma, without ``UNUSED``."""
    kept_out = [name for name in UNUSED if name not in sys.modules]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pycma warns that it cannot plot
        sys.modules.update(dict.fromkeys(kept_out))  # type: ignore[arg-type]  # None: not to be imported
        try:
            import cma
        finally:
            for name in kept_out:
                del sys.modules[name]
    return cma


def single(cma: Any) -> Any:
    """Return pycma's strategy class for one variable.

    Where a standard deviation leaves its limits, as in narrow bounds, pycma (4.5) changes the scaling of that variable,
    which it refuses to do where there is one only: it takes a scaling of length 1 for one that has no length yet.
    """

    def limited(strategy: Any, *arguments: Any, **named: Any) -> Any:
        strategy.sigma_vec.set_i = partial(rescale, strategy.sigma_vec)
        return cma.CMAEvolutionStrategy._stds_into_limits(strategy, *arguments, **named)

    return type("Single", (cma.CMAEvolutionStrategy,), {"_stds_into_limits": limited})


def rescale(scaling: Any, index: int, value: float) -> None:
    """Do what pycma's ``DiagonalDecoding.set_i`` does."""
    scaling.is_identity = False
    scaling.scaling[index] = value


def check(options: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
    """Raise SymphysError for the first option that pycma does not have, or that cannot be passed on."""
    for name, value in options.items():
        if name in RESERVED or name.startswith("verb_"):
            raise refuse("cma", name, f"cannot be set: {RESERVED.get(name, RESERVED['verbose'])}")
        if name not in defaults:
            raise refuse("cma", name, f"pycma has no such option; {nearest(name, defaults)}")
        if not plain(value) and value not in TEXT_OPTIONS.get(name, ()):
            valid = " or ".join(TEXT_OPTIONS.get(name, ("numbers", "true", "false", "lists of these")))
            raise refuse("cma", name, f"valid are {valid}, not {value!r}")


def plain(value: Any) -> bool:
    """Whether a value is a number, a truth value or a list of these, which pycma does not evaluate."""
    if isinstance(value, list | tuple):
        return all(plain(each) for each in value)
    return isinstance(value, bool | int | float)


def sides(bound: Array, free: NDArray[np.bool_]) -> list[float | None]:
    """Return one side of the bounds in pycma's form: None where there is none."""
    return [float(value) if math.isfinite(value) else None for value in bound[free]]


@contextmanager
def pycma() -> Iterator[None]:
    """Suppress the warnings of pycma and numpy about infinite merits; turn its errors into RuntimeError."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            yield
        except (ValueError, TypeError, AssertionError, AttributeError, IndexError) as error:
            raise RuntimeError(f"pycma: {error}") from error


BUDGET_CRITERIA = {"maxiter", "timeout"}
CONVERGENCE_CRITERIA = {"tolfun", "tolfunhist", "tolfunrel", "tolx", "ftarget"}
BUDGET = "the evaluations are used up: raise `evaluations`, or `sigma` if the step size in the trace was growing"
STALLED = "the search came to rest without converging ({}): try another seed, a larger `population` or another `sigma`"
NOT_FINITE = "not one simulation of a generation is finite: lower `sigma` or bound the variables"


@dataclass(frozen=True)
class CmaOptions(SolverOptions):
    """Options of CMA-ES.

    Attributes:
        sigma: initial standard deviation, in units of scale; with ``knots``, of a quarter of the distance of bounds.
        knots: 0: search all variables; else search deviations from the start, as splines of this many knots for each
            control.
        population: candidates in each generation; 0: pycma's 4 + 3 ln n.
        evaluations: rollouts in each smoothing stage.
        options: pycma's own options, such as {tolfun = 1e-8, CMA_diagonal = 50}; cma.CMAOptions() lists them.
        samples: with scenarios, samples for each candidate.
        width: spread of the samples, relative to the [[scenario]] tables.
        validation: samples that select the best mean of the search; 0: keep the last.
        validation_width: spread of the validation samples.
        every: generations between validations.
    """

    sigma: float = 1.0
    knots: int = 0
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
        at_least(0, evaluations=self.evaluations, validation=self.validation, knots=self.knots)
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

    def __init__(self, context: StageContext, options: CmaOptions, latest: PycmaStrategy | None = None) -> None:
        """Set up one stage; ``latest``: a strategy that may be in the state to which it is resumed."""
        self.evaluator: CountingEvaluator = context.evaluator
        self.start, self.seed, self.options = context.start, context.seed, options
        self.held = not np.any(self.evaluator.lower < self.evaluator.upper)
        self.candidates: Candidates = NominalCandidates(self.evaluator)
        if self.evaluator.problem.scenario is not None:
            self.candidates = SampledCandidates(
                self.evaluator, options.samples, options.width, options.batch(self.seed), options.every, context.log
            )
        self.strategy = latest

    def init(self) -> Iteration[CmaState] | StopReason:
        """Keep the start as the first candidate; it is the only one where bounds hold every variable."""
        if self.held:
            point = self.evaluator.value(self.start)
            return Iteration(self._held_state(), point) if point.finite else not_finite(point)
        strategy = self.strategy = self._fresh(self.start)
        (point,) = self.candidates.rate([self.start], 0)
        if not point.finite:
            return not_finite(point)
        self.candidates.keep(self.start, 0, due=True)
        return Iteration(strategy.state(), point, step=strategy.sigma)

    def step(self, state: CmaState) -> Iteration[CmaState] | StopReason:
        """Draw a generation, evaluate it, and update the strategy with the merits."""
        strategy, generation = self._in(state), len(state.merits)
        self.strategy = None
        points = self.candidates.rate([self.evaluator.clip(z) for z in strategy.ask()], generation)
        best = best_of(points)
        if best is None:
            return self.candidates.conclude(StopReason(Status.NOT_FINITE, NOT_FINITE), state.start)
        strategy.tell(tuple(point.merit if point.finite else math.inf for point in points))
        self.strategy = strategy
        self.candidates.keep(strategy.centre, generation + 1)
        return Iteration(strategy.state(), best, step=strategy.sigma)

    def terminate(self, state: CmaState) -> StopReason | None:
        """Stop if the budget is used up or one of pycma's criteria holds."""
        if self.held:
            return converged(self.evaluator)
        reason = self._reason(self._in(state))
        return None if reason is None else self.conclude(state, reason)

    def conclude(self, state: CmaState, reason: StopReason) -> StopReason:
        """Implement ``Method.conclude``: the last mean may be kept."""
        self.candidates.keep(self._in(state).centre, len(state.merits), due=True)
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

    def _in(self, state: CmaState) -> PycmaStrategy:
        """Return pycma's strategy in a state."""
        if self.strategy is None or not self.strategy.at(state):
            self.strategy = self._fresh(state.start)
            self.strategy.replay(state)
        return self.strategy

    def _fresh(self, start: Array) -> PycmaStrategy:
        options, stream = self.options, np.random.default_rng([self.seed, 1])
        space = search_space(self.evaluator.problem, start, options.knots)
        return PycmaStrategy(space, options.sigma, options.population, options.options, stream)


def cma(keep: bool = False) -> Solver[CmaOptions]:
    """Return the solver; ``keep``: the last solve's strategy, so that one that goes on from there need not replay."""
    last: list[CmaEs] = []

    def method(context: StageContext, options: CmaOptions) -> CmaEs:
        found = CmaEs(context, options, last.pop().strategy if last else None)
        if keep:
            last.append(found)
        return found

    return make_solver(
        "cma",
        "CMA-ES by pycma, without derivatives",
        CmaOptions,
        stage_of(method),
        rate=lambda options, seed: rate_by_validation(options.batch(seed)),
        prepare=load,
        scenarios=None,
    )


CMA = cma()
