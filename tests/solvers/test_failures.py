"""Whatever goes wrong in a solve is a status with advice, never an exception."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds.toys import PLAIN, Counted, failing, quadratic, rosenbrock, solve, target, toy

from symphys.shooting import Evaluator, ShootingProblem, Values
from symphys.solvers import SOLVERS, Status

every_solver = pytest.mark.parametrize("name", PLAIN)
KINDS = ("value", "gradient", "residuals", "jacobian")
METHODS = ["spectral", "gradient", "momentum", "adam"]


class Spoiled(Counted):
    """With another gradient and Jacobian."""

    def __init__(self, evaluator: Evaluator, spoil: Callable[[Any], Any]) -> None:
        super().__init__(evaluator)
        self.spoil = spoil

    def evaluate(self, kind: str, Z: Any, smoothing: float) -> Values:
        found = super().evaluate(kind, Z, smoothing)
        wrong = {kind: self.spoil(getattr(found, kind))} if kind in ("gradient", "jacobian") else {}
        return replace(found, **wrong)


def wrong_gradient(problem: ShootingProblem, spoil: Callable[[Any], Any]) -> ShootingProblem:
    return replace(problem, evaluator=Spoiled(problem.evaluator, spoil))


@pytest.mark.parametrize("method", METHODS)
def test_a_wrong_gradient_is_noticed(method: str) -> None:
    for spoil in (lambda g: -g, lambda g: 0 * g):
        found = solve("gradient", wrong_gradient(quadratic(), spoil), options={"method": method, "rates": (0.01,)})
        assert found.status is Status.STALLED
        assert "symphys check" in found.advice


def test_a_gradient_that_vanishes_elsewhere_is_noticed() -> None:
    found = solve("gradient", wrong_gradient(quadratic(), lambda g: g + 1))
    assert found.status is Status.STALLED
    assert "symphys check" in found.advice


@pytest.mark.parametrize("spoil", [lambda j: -j, lambda j: 0 * j, lambda j: j * [1, 0, 0]])
def test_a_wrong_jacobian_is_noticed(spoil: Callable[[Any], Any]) -> None:
    found = solve("least_squares", wrong_gradient(quadratic(), spoil))
    assert found.status is Status.STALLED
    assert "symphys check" in found.advice


@every_solver
def test_nan_at_the_start(name: str) -> None:
    problem = toy(2, lambda z, s: ca.sqrt(z - 1), guess=0.0)
    found = solve(name, problem)
    assert found.status is Status.NOT_FINITE
    assert "start" in found.advice
    assert np.array_equal(found.z, problem.start(0))


@every_solver
def test_nan_beyond_an_edge_is_kept_away_from(name: str) -> None:
    """The root of z + 1 is no number below -1; the minimum is at 4."""
    problem = toy(2, lambda z, s: ca.sqrt(z + 1) - math.sqrt(5), guess=-0.9)
    found = solve(name, problem, options={"sigma": 3.0} if name == "cma" else {})
    assert found.z == pytest.approx([4, 4], abs=1e-3)


@pytest.mark.parametrize("name", ["gradient", "least_squares", "ipopt"])
def test_nan_in_the_derivative_alone(name: str) -> None:
    """A length, at 0."""
    problem = toy(2, lambda z, s: ca.vertcat(ca.norm_2(z), z[1] - 1))
    found = solve(name, problem)
    assert found.status is Status.NOT_FINITE
    assert "derivative" in found.advice


def test_nan_everywhere_but_at_the_start() -> None:
    problem = toy(2, lambda z, s: ca.vertcat(ca.sqrt(-ca.sumsqr(z)), z))
    found = solve("cma", problem)
    assert (found.status, len(found.trace)) == (Status.NOT_FINITE, 1)
    assert "sigma" in found.advice


@every_solver
def test_budget(name: str) -> None:
    key, amount = ("evaluations", 20) if name == "cma" else ("iterations", 3)
    found = solve(name, rosenbrock(), options={key: amount})
    assert found.status is Status.BUDGET
    assert key in found.advice
    assert len(found.trace) == 4 if name != "cma" else found.counts.rollouts <= 1 + 20 + 6


@every_solver
def test_a_budget_of_nothing_still_looks_at_the_start(name: str) -> None:
    key = "evaluations" if name == "cma" else "iterations"
    found = solve(name, rosenbrock(), options={key: 0})
    assert (found.status, len(found.trace)) == (Status.BUDGET, 1)


@every_solver
def test_met_at_the_start(name: str) -> None:
    problem = target()
    found = SOLVERS[name].solve(problem, np.array([2.0, -1.0]), SOLVERS[name].Options())
    assert (found.status, len(found.trace)) == (Status.MET, 1)


def test_least_squares_needs_squares() -> None:
    found = solve("least_squares", toy(2, objective=lambda z, s: ca.exp(z[0]) + z[1] ** 2))
    assert found.status is Status.NOT_APPLICABLE
    assert "no sum of squares" in found.advice and "`squares`" in found.advice


@every_solver
def test_what_casadi_raises_is_a_failure(name: str) -> None:
    found = solve(name, failing(quadratic(), KINDS, 2, RuntimeError("out of order")))
    assert found.status is Status.FAILED
    assert "out of order" in found.advice


@every_solver
def test_a_matrix_that_there_is_no_memory_for_is_a_failure(name: str) -> None:
    found = solve(name, failing(quadratic(), KINDS, 2, MemoryError("Unable to allocate 72 TiB")))
    assert found.status is Status.FAILED
    assert "72 TiB" in found.advice


@every_solver
def test_a_fault_of_the_program_is_not_hidden(name: str) -> None:
    with pytest.raises(KeyError):
        solve(name, failing(quadratic(), KINDS, 2, KeyError("bug")))


@every_solver
def test_a_stationary_point_that_misses_has_advice(name: str) -> None:
    problem = toy(1, lambda z, s: z**2 + 1, errors=lambda z, s: (z**2 + 1) / 1e-3, guess=0.7)
    found = solve(name, problem)
    assert found.status is Status.CONVERGED
    assert "another guess" in found.advice


def test_contradicting_constraints() -> None:
    problem = toy(1, lambda z, s: z, constraint=lambda z, s: z**2 + 1, guess=0.5, stop_when_met=False)
    found = solve("ipopt", problem)
    assert found.status is Status.STALLED
    assert "constraint" in found.advice


def test_a_flat_merit() -> None:
    problem = toy(2, objective=lambda z, s: 0 * z[0] + 1)
    for name in ("gradient", "ipopt"):
        assert solve(name, problem).status is Status.CONVERGED
    assert solve("cma", problem).status in (Status.STALLED, Status.CONVERGED)


def test_creeping_at_a_kink_ends() -> None:
    problem = toy(2, objective=lambda z, s: ca.fabs(z[0]) + 10 * ca.fabs(z[1] - z[0]) + 1, guess=0.5)
    found = solve("gradient", problem, options={"iterations": 5000})
    assert found.status is Status.STALLED
    assert found.counts.gradients < 1000
