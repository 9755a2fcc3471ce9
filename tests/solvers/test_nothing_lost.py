"""No solver gives less than it had: its result is the best point that was evaluated, the guess among them.

The functions are made to lead astray: cliffs and kinks that make IPOPT's watchdog step, noise, a valley of NaN on the
way to the minimum, a constraint that what is best without it violates, smoothed merits that say the opposite of exact
ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.shipped import seeds
from tools.repeats import few
from worlds.toys import PLAIN, Counted, constrained, rosenbrock, solve, target, toy
from worlds.windy import BEST, Winds, windy

from symphys.shooting import Evaluator, ScenarioSamples, ShootingProblem, Values
from symphys.solvers import SOLVERS, Outcome, Status
from symphys.types import Array

Rank = tuple[bool, float, float]
Spoil = Callable[[Values], Values]
SAMPLED = ["stochastic", "evolution", "cma"]
VALIDATION = 24


@dataclass(frozen=True)
class Seen:
    """A point that was evaluated."""

    z: Array
    smoothing: float
    merit: float
    errors: Array

    def rank(self, problem: ShootingProblem, name: str) -> Rank:
        """The lower the better: met first, for IPOPT then what violates constraints least, then the merit."""
        broken = [error for error in self.errors[problem.limits] if error > 1]
        return not problem.met(self.errors), max(broken, default=0.0) if name == "ipopt" else 0.0, self.merit


@dataclass
class Recorded:
    """Everything that an evaluator gave, spoilt first."""

    evaluator: Evaluator
    spoil: Spoil
    seen: list[Seen] = field(default_factory=list)

    def evaluate(self, kind: str, Z: Array, smoothing: float) -> Values:
        """Pass on and record what is finite."""
        found = self.spoil(getattr(self.evaluator, kind)(Z, smoothing))
        rows = zip(Z.copy(), found.merit, found.objective, found.errors, strict=True)
        for z, merit, objective, errors in rows:
            if np.isfinite([merit, objective, *errors]).all():
                self.seen.append(Seen(z, smoothing, float(merit), errors.copy()))
        return found

    value, gradient, residuals, jacobian = Counted.value, Counted.gradient, Counted.residuals, Counted.jacobian


def recorded(problem: ShootingProblem, spoil: Spoil = lambda found: found) -> tuple[ShootingProblem, Recorded]:
    """The problem with its evaluations recorded."""
    evaluator = Recorded(problem.evaluator, spoil)
    return replace(problem, evaluator=evaluator), evaluator


def cliff() -> ShootingProblem:
    """A throw over a wall: the flatter the further, until it hits, where a flatter one is better again."""
    return toy(1, objective=lambda z, s: ca.if_else(z > 6.87, 0.5 * (z - 7), 5 + 0.1 * (z - 4) ** 2 / 9), guess=7.0)


def rugged() -> ShootingProblem:
    """Kinks everywhere on a slope."""
    return toy(2, objective=lambda z, s: ca.sumsqr(z - 2) / 50 + ca.sum1(ca.fabs(ca.sin(5 * z))), guess=-0.3)


def valley() -> ShootingProblem:
    """Nothing is finite between 0.5 and 1; the minimum is at 2."""

    def miss(z: Any, s: Any) -> Any:
        return (z - 2) + 0 * ca.sqrt((z - 0.5) * (z - 1))

    return toy(2, miss, guess=0.2)


def fenced() -> ShootingProblem:
    """The target cannot be reached within the constraint; the lowest merit, where it begins, is beside that."""
    return toy(
        2,
        lambda z, s: z - 2,
        errors=lambda z, s: ca.norm_2(z - 2) / 1e-3,
        constraint=lambda z, s: z[0] + z[1] - 1,
        guess=408 / 804,
    )


def opposite(**more: Any) -> ShootingProblem:
    """With smoothing the minimum lies where the exact merit is high, and that has a hill between."""

    def worth(z: Any, s: Any) -> Any:
        return ca.if_else(s > 0, (z - 8) ** 2, ca.cos(z) + z**2 / 60)  # least near 3.04 and 9.1

    return toy(1, objective=worth, guess=3.0, **more)


def noisy(seed: int) -> Spoil:
    """Another merit at each evaluation."""
    stream = np.random.default_rng(seed)

    def spoil(found: Values) -> Values:
        noise = 0.2 * stream.standard_normal(len(found.merit))
        return replace(found, merit=found.merit + noise, objective=found.objective + noise)

    return spoil


PROBLEMS: dict[str, Callable[[], ShootingProblem]] = {
    "cliff": cliff,
    "rugged": rugged,
    "valley": valley,
    "fenced": fenced,
    "constrained": constrained,
    "rosenbrock": rosenbrock,
    "target": target,
}


def lost(found: Outcome, problem: ShootingProblem, name: str, seen: list[Seen]) -> list[Seen]:
    """What was better than the result."""
    ranks = [each.rank(problem, name) for each in seen if np.array_equal(each.z, found.z)]
    assert ranks, "the result was never evaluated"
    return [each for each in seen if each.rank(problem, name) < min(ranks)]


@few("name", PLAIN, 4)
@few("kind", PROBLEMS, 2)
@seeds(4)
def test_the_result_is_the_best_of_what_was_evaluated(name: str, kind: str, seed: int) -> None:
    problem, evaluator = recorded(PROBLEMS[kind]())
    found = solve(name, problem, seed)
    if found.status is not Status.NOT_APPLICABLE:
        assert any(np.array_equal(each.z, problem.start(seed)) for each in evaluator.seen)
        assert not lost(found, problem, name, evaluator.seen)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLAIN)
@seeds(4)
def test_so_it_is_where_evaluations_are_noisy(name: str, seed: int) -> None:
    problem, evaluator = recorded(rosenbrock(), noisy(seed))
    assert not lost(solve(name, problem, seed), problem, name, evaluator.seen)


def test_ipopt_passes_a_better_point_by_and_says_so() -> None:
    """Here it does; what it ends at is no solution then."""
    problem, evaluator = recorded(cliff())
    lines: list[str] = []
    found = solve("ipopt", problem, log=lines.append)
    assert any("EXIT: Optimal Solution Found" in line for line in lines)
    assert not lost(found, problem, "ipopt", evaluator.seen)
    assert found.status is Status.STALLED and "passed" in found.advice


def test_ipopt_keeps_what_violates_least_not_what_the_penalty_likes() -> None:
    """The solution is on the constraint, the lowest merit beside it."""
    problem, evaluator = recorded(fenced())
    found = solve("ipopt", problem)
    assert abs(found.z.sum() - 1) < 1e-7
    merit = {each.merit for each in evaluator.seen if np.array_equal(each.z, found.z)}
    assert min(each.merit for each in evaluator.seen) < min(merit)


@pytest.mark.parametrize("name", [name for name in PLAIN if name != "least_squares"])
@pytest.mark.parametrize("smoothings", [(1.0, 0.0), (1.0, 0.1, 0.0), (0.5,)])
def test_stages_end_no_worse_exactly_than_they_began(name: str, smoothings: tuple[float, ...]) -> None:
    """The guess is nearly the exact minimum, and the stages lead away from it."""
    problem, evaluator = recorded(opposite(smoothing=smoothings))
    found = solve(name, problem, options={"sigma": 0.05} if name == "cma" else {})
    exact = [each for each in evaluator.seen if each.smoothing == 0]
    assert not lost(found, problem, name, exact)
    assert found.z[0] == pytest.approx(3.0, abs=0.2)
    assert found.stages[0].z == pytest.approx([8.0], abs=1e-2)
    assert found.status is Status.STALLED and "the guess" in found.advice
    assert found.counts.rollouts == sum(stage.counts.rollouts for stage in found.stages)


@pytest.mark.parametrize("name", PLAIN)
def test_where_the_guess_is_worse_stages_change_nothing(name: str) -> None:
    """The last stage's point is the solution, its status that of the solve, to the bit."""
    problem = toy(1, lambda z, s: z - 1 - s, guess=5.0, smoothing=(1.0, 0.0))
    found = solve(name, problem)
    assert found.status is Status.CONVERGED and found.advice == ""
    assert np.array_equal(found.z, found.stages[-1].z)


class Watched(Winds):
    """Winds whose validations are recorded; ``hill`` (z) is added to the merit, ``miss`` (z) is an error."""

    def __init__(self, hill: Callable[[Array], Array], miss: Callable[[Array], Array] | None = None) -> None:
        super().__init__()
        self.hill, self.miss = hill, miss
        self.seen: list[Seen] = []

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        found, more = super().value(Z, drawn, smoothing), self.hill(Z) if smoothing == 0 else 0.0
        errors = found.errors if self.miss is None else self.miss(Z)[:, None] + np.zeros((len(found.merit), 1))
        found = replace(found, merit=found.merit + more, objective=found.objective + more, errors=errors)
        if len(Z) == 1 and len(drawn.numbers) == VALIDATION:
            self.seen.append(Seen(Z[0].copy(), smoothing, float(found.merit.mean()), found.errors[0]))
        return found


HILLS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array] | None]] = {
    "cliff": (lambda Z: np.where(Z[:, 0] < 2.95, 50.0, 0.0), None),
    "valley": (lambda Z: np.where((Z[:, 0] < 2.9) & (Z[:, 0] > -50), np.nan, 0.0), None),
    "noise": (lambda Z: 3 * np.sin(1e5 * Z[:, 0]), None),
    "fence": (lambda Z: 0 * Z[:, 0], lambda Z: np.where(Z[:, 0] > 2.9, 0.5, 2.0)),
    "none": (lambda Z: 0 * Z[:, 0], None),
}


def sampled(name: str, winds: Watched, smoothings: tuple[float, ...] = (0.0,), seed: int = 0) -> Outcome:
    """Solved from far off what is best."""
    own = {"population": 6, "evaluations": 1200, "samples": 4, "sigma": 0.5}
    others = {"iterations": 40, "samples": 8, "rate": 0.1}
    options = {**(own if name == "cma" else others), "validation": VALIDATION}
    problem = replace(windy(), scenario=winds, stop_when_met=False, smoothing=smoothings)
    return SOLVERS[name].solve(problem, BEST + 2.5, SOLVERS[name].Options(**options), seed)


@few("name", SAMPLED, 2)
@few("kind", HILLS, 2)
def test_where_samples_differ_the_guess_is_validated_too(name: str, kind: str) -> None:
    for seed in range(3):
        winds = Watched(*HILLS[kind])
        found = sampled(name, winds, seed=seed)
        seen = [each for each in winds.seen if np.isfinite(each.merit)]
        assert any(np.array_equal(each.z, BEST + 2.5) for each in seen)
        assert not lost(found, windy(), name, seen)
        if kind in ("cliff", "fence") and np.array_equal(found.z, BEST + 2.5):
            assert "start" in found.advice


@pytest.mark.parametrize("name", SAMPLED)
def test_so_are_the_points_of_stages(name: str) -> None:
    """What the smoothed stage descends to lies on a hill, exactly."""
    winds = Watched(HILLS["cliff"][0])
    found = sampled(name, winds, (1.0, 0.0))
    exact = [each for each in winds.seen if each.smoothing == 0]
    assert not lost(found, windy(), name, exact)
    assert found.z[0] >= 2.95
    assert "the guess" in found.advice
