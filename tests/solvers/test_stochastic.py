"""Descent over samples drawn anew finds what is best on the average, and goes on to the bit where it was stopped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from worlds.toys import toy
from worlds.windy import BEST, Winds, windy

from symphys.shooting import ScenarioSamples, Values
from symphys.solvers import SOLVERS, Status, StochasticOptions, TraceRow
from symphys.solvers.randomized.aggregation import average, centred, evolution, mixed
from symphys.types import Array

SOLVE = SOLVERS["stochastic"].solve


def options(**changes: Any) -> StochasticOptions:
    return StochasticOptions(**{"iterations": 150, "samples": 8, "rate": 0.05, "validation": 32, **changes})


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_it_finds_the_best_on_the_average(share: float) -> None:
    """By gradients, by values alone, and by both."""
    problem = windy()
    found = SOLVE(problem, np.array([3.0, 3.0]), options(evolution=share, rate=0.1))
    assert found.status is Status.BUDGET
    assert found.z == pytest.approx(BEST, abs=0.1)
    assert found.counts.gradients == 150 * 8
    assert (found.counts.rollouts > 150 * 16) == (share > 0)


def test_discretisations_take_turns() -> None:
    problem = windy()
    SOLVE(problem, np.zeros(2), options(iterations=4))
    assert isinstance(problem.scenario, Winds)
    assert problem.scenario.asked == [0, 1, 0, 1]


def test_horizons_grow() -> None:
    """Over the first share of the iterations, evenly."""
    problem = windy()
    SOLVE(problem, np.zeros(2), options(iterations=8, horizons=(1.0, 2.0), growth=0.5))
    assert isinstance(problem.scenario, Winds)
    assert problem.scenario.horizons == [1, 1, 2, 2, np.inf, np.inf, np.inf, np.inf]


def test_validation_keeps_the_best_point() -> None:
    """A rate that leaps about ends worse than what is kept."""
    kept, last = (SOLVE(windy(), BEST, options(rate=1.0, hold=1.0, patience=0, every=1, validation=count))
                  for count in (32, 0))  # fmt: skip
    distance = [float(np.linalg.norm(found.z - BEST)) for found in (kept, last)]
    assert distance[0] < 0.5 * distance[1]


def test_a_point_that_meets_everything_in_the_problem_s_own_sample_goes_first() -> None:
    """However low the mean of one that does not: on its way to the lowest, the last that meets is kept."""

    class Strict(Winds):
        def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
            found = super().value(Z, drawn, smoothing)
            short = np.broadcast_to(BEST[:1] + 0.5 - Z[:, :1], (len(found.merit), 1))
            return replace(found, errors=1 + short)

    problem = replace(windy(), scenario=Strict(), stop_when_met=False)
    start = np.add(BEST, [1.0, 0.0])
    found = SOLVE(problem, start, options(iterations=120, rate=0.02, hold=1.0, patience=0, every=1))
    assert 0.5 <= found.z[0] - BEST[0] < 0.53


@pytest.mark.parametrize("stop", [3, 40])
def test_it_goes_on_to_the_bit(stop: int) -> None:
    def press(row: TraceRow) -> None:
        if row.iteration == stop:
            raise KeyboardInterrupt

    whole = SOLVE(windy(), np.ones(2), options(iterations=60), seed=3)
    first = SOLVE(windy(), np.ones(2), options(iterations=60), seed=3, monitor=press)
    assert first.status is Status.INTERRUPTED
    second = SOLVE(windy(), np.ones(2), options(iterations=60), seed=3, checkpoint=first.checkpoint)
    assert np.array_equal(second.z, whole.z)
    assert [row.objective for row in second.trace] == [row.objective for row in whole.trace]
    assert second.counts == whole.counts


def test_seeds_differ() -> None:
    a, b = (SOLVE(windy(), np.ones(2), options(iterations=5), seed=seed).z for seed in (0, 1))
    assert not np.array_equal(a, b)


def test_samples_that_are_not_finite_are_left_out_and_logged() -> None:
    """All of them: it ends, and says why."""
    lines: list[str] = []
    found = SOLVE(windy(storm=0.2, badly=np.nan), np.ones(2), options(), log=lines.append)
    assert found.z == pytest.approx(BEST, abs=0.2)
    assert any("not finite" in line for line in lines)
    assert SOLVE(windy(spread=np.nan), np.ones(2), options(samples=1)).status is Status.BUDGET
    spoilt = SOLVE(windy(storm=-1, badly=np.nan), np.ones(2), options())
    assert spoilt.status is Status.NOT_FINITE and "[termination]" in spoilt.advice


def test_without_a_scenario_it_is_not_for_this_problem() -> None:
    found = SOLVE(toy(2, objective=lambda z, s: ca.sumsqr(z)), np.ones(2), options())
    assert found.status is Status.NOT_APPLICABLE and "[[scenario]]" in found.advice


def test_each_gradient_is_shortened_by_itself() -> None:
    """However long; fallen ones count more; what explodes keeps its direction."""
    slopes = np.array([[0.1, 0.0], [0.0, 30.0], [1e200, 1e200]])
    values = Values(np.zeros(3), np.arange(3.0), np.zeros((3, 0)), gradient=slopes, alive=np.array([1.0, 0.0, 1.0]))
    found = average(values, np.ones(2), 1.0, 2.0)
    assert found.gradient == pytest.approx([(0.1 + 0.5**0.5) / 4, (2 + 0.5**0.5) / 4], rel=1e-12)
    assert (found.objective, found.alive, found.left_out) == (1.0, pytest.approx(2 / 3), 0)
    assert found.longest == pytest.approx(2**0.5 * 1e200)
    assert found.typical == pytest.approx(30)
    along = np.array([1 + 0.5**0.5, 1 + 0.5**0.5]) / 3
    assert found.agreement == pytest.approx(np.linalg.norm(along), rel=1e-12)


def test_evolution_estimates_the_gradient() -> None:
    """Of a quadratic, on the average of many pairs."""
    winds, z, step = Winds(), np.array([1.5, 0.75]), np.array([0.1, 0.2])
    rng = np.random.default_rng(0)
    found = evolution(lambda Z, drawn: winds.value(Z, drawn, 0.0), z, step, winds.draw(rng, 20_000), rng)
    way = 2 * (z - BEST) * step
    assert found.gradient @ way == pytest.approx(np.linalg.norm(found.gradient) * np.linalg.norm(way), rel=1e-3)
    assert (found.pairs, found.alive) == (20_000, 1.0)
    assert found.merit == pytest.approx(((z - BEST) ** 2).sum() + 2 * 0.3**2 / 3 + (step**2).sum(), rel=0.02)
    assert mixed(np.array([3.0, 0]), np.array([0, 0.1]), 0.25) == pytest.approx([0.75, 0.25])


def test_ranks() -> None:
    """Equal merits share theirs; nothing is said where all are equal."""
    assert centred(np.array([[3.0, 1.0], [9.0, 3.0]])) == pytest.approx(np.array([[0, -0.5], [0.5, 0]]))
    assert centred(np.ones((2, 3))) == pytest.approx(np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("name", "value"),
    [("rate", 0.0), ("clip", 0.0), ("samples", 0), ("evolution", 1.5), ("betas", (1.0, 0.5)), ("horizons", (0.0,))],
)
def test_options_that_cannot_be(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        StochasticOptions(**{name: value})


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_what_is_held_by_equal_bounds_is_no_part_of_the_gradient(share: float) -> None:
    """However steep the merit is along it."""
    problem = windy()
    (block,) = problem.blocks
    held = replace(block, lower=np.array([-np.inf, 2.0]), upper=np.array([np.inf, 2.0]), scale=np.array([1, 1e6]))
    found = SOLVE(replace(problem, blocks=(held,)), np.array([3.0, 2.0]), options(evolution=share))
    assert found.z == pytest.approx([BEST[0], 2.0], abs=0.1)
    assert all(row.gradient_norm < 10 for row in found.trace)
