"""Each method alone obeys: init evaluates the start, step lowers the merit of a quadratic, terminate says converged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from worlds.toys import quadratic, through_json
from worlds.windy import BEST, windy

from symphys.shooting import ShootingProblem
from symphys.solvers import Counts, Status
from symphys.solvers.core.checkpoint import plain
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.interface import Iteration, Method, StageContext
from symphys.solvers.core.outcome import StopReason
from symphys.solvers.core.point import Incumbent, Point, Stop
from symphys.solvers.methods.cma_es import CmaEs, CmaOptions
from symphys.solvers.methods.evolution import EvolutionOptions, EvolutionStrategy
from symphys.solvers.methods.gradient import GradientDescent, GradientOptions
from symphys.solvers.methods.least_squares import LeastSquaresOptions, LevenbergMarquardt
from symphys.solvers.methods.stochastic import StochasticDescent, StochasticOptions

BATCHES = {"iterations": 60, "samples": 32, "rate": 0.2, "validation": 16, "patience": 0.0, "every": 1}
SHORT = {"evaluations": 600, "samples": 8, "population": 8}
Make = Callable[[StageContext], Method[Any]]

SMOOTH: dict[str, Make] = {
    "gradient": lambda context: GradientDescent(context, GradientOptions()),
    "momentum": lambda context: GradientDescent(context, GradientOptions(method="momentum", rates=(0.02,))),
    "adam": lambda context: GradientDescent(context, GradientOptions(method="adam")),
    "least_squares": lambda context: LevenbergMarquardt(context, LeastSquaresOptions()),
    "cma": lambda context: CmaEs(context, CmaOptions(sigma=0.5)),
}
"""On a quadratic without scenario."""
SAMPLED: dict[str, Make] = {
    "stochastic": lambda context: StochasticDescent(context, StochasticOptions(**BATCHES)),
    "evolution": lambda context: EvolutionStrategy(context, EvolutionOptions(**BATCHES, sigma=0.1)),
    "cma": lambda context: CmaEs(context, CmaOptions(**SHORT)),
}
"""On a quadratic that samples of a scenario move."""
EVERY = [(name, make, quadratic) for name, make in SMOOTH.items()]
EVERY += [(f"{name}-sampled", make, windy) for name, make in SAMPLED.items()]
every_method = pytest.mark.parametrize(
    ("make", "problem"), [each[1:] for each in EVERY], ids=[each[0] for each in EVERY]
)
without_scenario = pytest.mark.parametrize("make", list(SMOOTH.values()), ids=list(SMOOTH))
sampled = pytest.mark.parametrize("make", list(SAMPLED.values()), ids=list(SAMPLED))


def context_of(problem: ShootingProblem, start: Any = None) -> StageContext:
    """A stage at smoothing 0 that does not stop where all is met."""
    evaluator = CountingEvaluator(problem, 0.0, Incumbent(stop_when_met=False))
    z = problem.start(0) if start is None else np.array(start, float)
    return StageContext(evaluator, z, seed=0, log=lambda line: None)


def test_a_stage_stops_where_what_it_meets_is_confirmed() -> None:
    """Each point is asked about once."""
    asked = []

    def confirms(z: Any) -> bool:
        asked.append(float(z[0]))
        return len(asked) == 2

    incumbent = Incumbent(stop_when_met=True, confirms=confirms)
    points = [Point(np.array([k]), merit, merit, np.zeros(1), met=True) for k, merit in ((1.0, 3.0), (2.0, 2.0))]
    incumbent.offer(points[:1])
    incumbent.offer(points[:1])
    with pytest.raises(Stop):
        incumbent.offer(points[1:])
    assert asked == [1.0, 2.0]


def first(method: Method[Any]) -> Iteration[Any]:
    """The first iteration."""
    iteration = method.init()
    assert isinstance(iteration, Iteration)
    return iteration


def following(method: Method[Any], state: Any) -> Iteration[Any]:
    """The next iteration."""
    iteration = method.step(state)
    assert isinstance(iteration, Iteration)
    return iteration


def last(method: Method[Any], most: int = 400) -> tuple[StopReason, Any]:
    """Why a method ends, and its state there: the loop of the driver."""
    state = first(method).state
    for _ in range(most):
        reason = method.terminate(state)
        if reason is not None:
            return reason, state
        state = following(method, state).state
    raise AssertionError("the method does not terminate")


def best(context: StageContext) -> Any:
    """The incumbent, which must be there."""
    assert context.evaluator.incumbent.best is not None
    return context.evaluator.incumbent.best


@without_scenario
def test_init_evaluates_the_start_once(make: Make) -> None:
    context = context_of(quadratic())
    point = first(make(context)).point
    counts = context.evaluator.counter.counts
    assert point is not None and np.array_equal(point.z, context.start)
    assert counts.rollouts + counts.gradients + counts.jacobians == 1


@without_scenario
def test_steps_lower_the_merit(make: Make) -> None:
    """Some at once; the slowest, in ten steps."""
    context = context_of(quadratic())
    method = make(context)
    state, merit = first(method).state, best(context).merit
    for _ in range(10):
        if method.terminate(state) is None:
            state = following(method, state).state
    assert best(context).merit < 0.9 * merit


@without_scenario
def test_at_the_minimum_it_says_converged(make: Make) -> None:
    context = context_of(quadratic())
    reason, _ = last(make(context))
    assert reason == StopReason(Status.CONVERGED)
    assert best(context).z == pytest.approx([1, 2, 3], abs=1e-3)


@sampled
def test_over_samples_it_ends_with_its_budget_near_the_best_mean(make: Make) -> None:
    context = context_of(windy(), [2.0, 2.0])
    reason, _ = last(make(context))
    assert reason.status is Status.BUDGET
    assert best(context).z == pytest.approx(BEST, abs=0.2)


@every_method
def test_a_step_depends_on_its_state_alone(make: Make, problem: Callable[[], ShootingProblem]) -> None:
    """The same state makes the same step, whatever was done in between, and from the values of a checkpoint too."""
    method = make(context_of(problem()))
    early = following(method, first(method).state).state
    later = following(method, following(method, early).state)
    saved = through_json(plain(early))
    for other in (method, make(context_of(problem()))):
        again = following(other, following(other, other.resume(saved)).state)
        assert repr(plain(again.state)) == repr(plain(later.state))


@every_method
def test_asking_twice_whether_to_end_changes_nothing(make: Make, problem: Callable[[], ShootingProblem]) -> None:
    method, twice = make(context_of(problem())), make(context_of(problem()))
    states = [first(method).state, first(twice).state]
    for _ in range(3):
        assert method.terminate(states[0]) is None
        assert twice.terminate(states[1]) is None and twice.terminate(states[1]) is None
        states = [following(each, state).state for each, state in zip((method, twice), states, strict=True)]
    assert repr(plain(states[0])) == repr(plain(states[1]))


@every_method
def test_a_budget_of_nothing_ends_at_the_start(make: Make, problem: Callable[[], ShootingProblem]) -> None:
    method: Any = make(context_of(problem()))
    key = "evaluations" if isinstance(method, CmaEs) else "iterations"
    method.options = replace(method.options, **{key: 0})
    reason = method.terminate(first(method).state)
    assert reason is not None and reason.status is Status.BUDGET


def test_all_evaluators_of_a_solve_count_together() -> None:
    """An evaluator at another smoothing has an incumbent of its own, and the same counter."""
    evaluator = context_of(quadratic()).evaluator
    other = evaluator.at(0.5, Incumbent(stop_when_met=False))
    evaluator.gradient(np.zeros(3))
    other.values([np.zeros(3), np.ones(3)])
    other.rate([np.full(3, 2.0)])
    assert evaluator.counter.counts == other.counter.counts == Counts(rollouts=3, gradients=1)
    assert evaluator.incumbent.best is not None and np.array_equal(evaluator.incumbent.best.z, np.zeros(3))
    assert other.incumbent.best is not None and np.array_equal(other.incumbent.best.z, np.ones(3))
