"""By values alone, the evolution strategy and CMA-ES find what is best on the average over samples of a scenario."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds.toys import toy
from worlds.windy import BEST, windy

from symphys.solvers import SOLVERS, CmaOptions, EvolutionOptions, Outcome, Status, TraceRow

START = np.array([3.0, 3.0])


def evolve(problem: Any, seed: int = 0, **more: Any) -> Outcome:
    options = EvolutionOptions(iterations=150, samples=16, rate=0.1, sigma=0.1, validation=32)
    return SOLVERS["evolution"].solve(problem, START, options, seed, **more)


def search(problem: Any, seed: int = 0, **more: Any) -> Outcome:
    options = CmaOptions(evaluations=4000, samples=8, validation=32, population=10)
    return SOLVERS["cma"].solve(problem, START, options, seed, **more)


@pytest.mark.parametrize("solve", [evolve, search])
def test_they_find_what_is_best_on_the_average(solve: Any) -> None:
    """And count each rollout."""
    found = solve(windy())
    assert found.status is Status.BUDGET
    assert found.z == pytest.approx(BEST, abs=0.1)
    assert found.counts.gradients == 0 and found.counts.rollouts > 4000


@pytest.mark.parametrize("solve", [evolve, search])
def test_they_go_on_to_the_bit(solve: Any) -> None:
    def press(row: TraceRow) -> None:
        if row.iteration == 12:
            raise KeyboardInterrupt

    whole = solve(windy(), seed=3)
    first = solve(windy(), seed=3, monitor=press)
    assert first.status is Status.INTERRUPTED
    second = solve(windy(), seed=3, checkpoint=first.checkpoint)
    assert np.array_equal(second.z, whole.z)
    assert [row.objective for row in second.trace] == [row.objective for row in whole.trace]
    assert second.counts == whole.counts


@pytest.mark.parametrize("solve", [evolve, search])
def test_what_is_kept_does_best_in_other_samples_than_it_was_found_in(solve: Any) -> None:
    """What was best in a few of them was lucky: its merit there is lower than what the kept point is worth."""
    found = solve(windy(spread=2.0))
    assert min(row.objective for row in found.trace) < found.trace[-1].best


@pytest.mark.parametrize("solve", [evolve, search])
def test_numbers_that_are_not_finite(solve: Any) -> None:
    """All of them: it ends, and says why."""
    found = solve(windy(storm=-1, badly=np.nan))
    assert found.status is Status.NOT_FINITE and found.advice


def test_an_evolution_strategy_needs_a_scenario() -> None:
    found = evolve(toy(2, objective=lambda z, s: ca.sumsqr(z)))
    assert found.status is Status.NOT_APPLICABLE and "[[scenario]]" in found.advice


def test_cma_stops_where_all_is_met() -> None:
    """In the validation samples."""
    problem = windy()
    problem = replace(problem, stop_when_met=True, scenario=Content())
    assert search(problem).status is Status.MET


class Content(type(windy().scenario)):  # type: ignore[misc]
    """Winds, with an error that is met near the best point."""

    def value(self, Z: Any, drawn: Any, smoothing: float) -> Any:
        found = super().value(Z, drawn, smoothing)
        return replace(found, errors=np.linalg.norm(Z - BEST, axis=1)[:, None] * np.ones((len(found.merit), 1)) / 0.2)
