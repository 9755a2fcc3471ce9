"""Steps onto a plateau, where no variable has any influence, are refused, and the advice reports an end on one."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds.toys import PLAIN, counted, solve, stop_at, through_json, toy

from symphys.shooting import ShootingProblem
from symphys.solvers import Status
from symphys.solvers.core.convergence import MAX_SHORTENINGS, PLATEAU_ADVICE

every_solver = pytest.mark.parametrize("name", PLAIN)
descents = pytest.mark.parametrize("name", ["gradient", "least_squares"])
EDGE, LEVEL = 0.6, 2.0


def cliff(**more: Any) -> ShootingProblem:
    """3 - 3 z - 20 z^2 should be zero: z = 0.3195. Beyond |z| = 0.6 it is 2, less than at the guess 0, whatever z."""

    def miss(z: Any, s: Any) -> Any:
        return ca.if_else(ca.fabs(z) < EDGE, 3 - 3 * z - 20 * z**2, LEVEL)

    return toy(1, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, **more)


def ledge() -> ShootingProblem:
    """Slopes at the guess 0, and is level right behind it."""
    return toy(1, lambda z, s: ca.if_else(z <= 0, 3 - z, LEVEL), errors=lambda z, s: 5 + 0 * z)


def level(**more: Any) -> ShootingProblem:
    """The same everywhere."""
    return toy(2, lambda z, s: LEVEL + 0 * z, errors=lambda z, s: 5 + 0 * z[0], **more)


def mesa() -> ShootingProblem:
    """Level at 2 around the guess 0; further out a bowl with its bottom at (1, 0)."""

    def miss(z: Any, s: Any) -> Any:
        return ca.if_else(ca.sumsqr(z) < 0.25, ca.vertcat(LEVEL, 0), z - ca.vertcat(1, 0))

    return toy(2, miss, errors=lambda z, s: ca.norm_2(miss(z, s)) / 1e-3)


@descents
def test_a_plateau_is_not_entered(name: str) -> None:
    found = solve(name, cliff())
    assert found.status is Status.MET
    assert abs(3 - 3 * found.z[0] - 20 * found.z[0] ** 2) <= 1e-3


def test_a_search_leaves_a_plateau() -> None:
    """pycma's own patience of one generation does not always do."""
    sigma = {"sigma": 0.2}
    seeds = range(4)
    assert all(solve("cma", mesa(), seed, sigma).status is Status.MET for seed in seeds)
    hasty = [solve("cma", mesa(), seed, {**sigma, "options": {"tolflatfitness": 1}}).advice for seed in seeds]
    assert PLATEAU_ADVICE in hasty


@pytest.mark.parametrize("method", ["gradient", "momentum", "adam"])
def test_every_method_of_descent_refuses(method: str) -> None:
    assert abs(solve("gradient", cliff(), options={"method": method}).z[0]) < EDGE


def test_steps_that_are_taken_as_they_come_are_not_refused() -> None:
    found = solve("gradient", cliff(), options={"backtracking": 0})
    assert (found.status, found.advice, found.counts.gradients) == (Status.CONVERGED, PLATEAU_ADVICE, 2)


@descents
@pytest.mark.parametrize("problem", [cliff(), ledge()], ids=["cliff", "ledge"])
def test_what_is_refused_is_counted(name: str, problem: ShootingProblem) -> None:
    watched, watch = counted(problem)
    found = solve(name, watched)
    assert found.counts.gradients == watch.count["gradient"]
    assert found.counts.jacobians == watch.count["jacobian"]
    assert found.counts.rollouts == watch.count["value"] + watch.count["residuals"]
    assert found.counts.gradients + found.counts.jacobians > len(found.trace)


@descents
def test_a_plateau_is_accepted_after_all(name: str) -> None:
    found = solve(name, ledge())
    assert (found.status, found.advice) == (Status.CONVERGED, PLATEAU_ADVICE)
    assert found.counts.gradients + found.counts.jacobians == 2 + MAX_SHORTENINGS
    assert found.z[0] > 0


@descents
def test_a_minimum_is_no_plateau(name: str) -> None:
    """The first step ends in it, where the gradient is exactly zero; an error is left there."""
    problem = toy(1, lambda z, s: ca.vertcat(z - 1, 1), errors=lambda z, s: 5 + (z - 1) ** 2)
    found = solve(name, problem, options={"damping": 1e-300} if name == "least_squares" else {})
    assert (found.status, found.z[0]) == (Status.CONVERGED, pytest.approx(1))
    assert found.counts.gradients + found.counts.jacobians == 2
    assert found.advice not in ("", PLATEAU_ADVICE)


@every_solver
def test_a_guess_on_a_plateau(name: str) -> None:
    found = solve(name, level())
    assert found.status is (Status.STALLED if name == "cma" else Status.CONVERGED)
    assert found.advice == PLATEAU_ADVICE
    assert "symphys show" in PLATEAU_ADVICE


@pytest.mark.parametrize("name", ["gradient", "least_squares", "ipopt"])
def test_a_guess_on_a_plateau_and_at_a_bound(name: str) -> None:
    assert solve(name, level(bounds=(0.0, 1.0))).advice == PLATEAU_ADVICE


def test_what_bounds_hold_back_is_no_plateau() -> None:
    problem = toy(1, lambda z, s: z + 3, errors=lambda z, s: ca.fabs(z + 3), bounds=(0.0, 1.0))
    for name in PLAIN:
        assert solve(name, problem).advice not in ("", PLATEAU_ADVICE)


@every_solver
def test_one_thing_that_is_missed_may_have_no_influence(name: str) -> None:
    def errors(z: Any, s: Any) -> Any:
        return ca.vertcat(ca.fabs(z[0] - 1) / 1e-3, 7, 0.5)

    found = solve(name, toy(2, lambda z, s: ca.vertcat(z - 1, LEVEL), errors=errors))
    assert (found.status, found.advice) == (Status.CONVERGED, PLATEAU_ADVICE)
    assert found.z == pytest.approx([1, 1], abs=1e-3)


def test_a_level_cost_is_said_too() -> None:
    assert solve("gradient", toy(2, objective=lambda z, s: 0 * z[0] + 1)).advice == PLATEAU_ADVICE


def test_pycma_gives_up_when_told_to() -> None:
    patient, hasty = (solve("cma", level(), options={"options": o}) for o in ({}, {"tolflatfitness": 3}))
    assert len(patient.trace) > 50 > len(hasty.trace) > 3
    assert hasty.advice == PLATEAU_ADVICE


def test_the_generations_on_a_plateau_are_counted_over_a_break() -> None:
    whole = solve("cma", level())
    part = solve("cma", level(), monitor=stop_at(30))
    rest = solve("cma", level(), checkpoint=through_json(part.checkpoint))
    assert (len(rest.trace), rest.status) == (len(whole.trace), whole.status)
    assert np.array_equal(rest.z, whole.z)
