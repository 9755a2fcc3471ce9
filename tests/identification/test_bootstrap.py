"""The bootstrap over recordings: steps with kept Jacobians are fits in full, and intervals cover what differs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, recordings

from symphys.identification import FitOptions, IdentificationError, IdentificationOptions, fit, identify
from symphys.identification.inference.bootstrap import Bootstrap, bootstrap, refitted
from symphys.types import Array


def many(name: str, seed: int, count: int = 20) -> AnalyticRecordings:
    """Recordings with starts of their own."""
    truth, stream = TRUTHS[name], np.random.default_rng(1000 + seed)
    own = truth.own[stream.integers(0, len(truth.own), count)] * (1 + 0.2 * stream.random((count, truth.own.shape[1])))
    return recordings(replace(truth, own=own), seed)


def drawn(problem: AnalyticRecordings, draws: int = 500, seed: int = 0) -> tuple[Bootstrap, Array]:
    """Draws about the estimate, and 5 of them in full."""
    fitted = fit(problem, FitOptions())
    assert fitted.uncertainty is not None
    state, which = fitted.outcome.state, np.arange(len(problem.recordings))
    found = bootstrap(problem, state.shared, fitted.outcome.system, fitted.uncertainty.information, draws, seed)
    return found, refitted(problem, FitOptions(), state, which, 5, seed, draws)


@pytest.mark.parametrize("name", ["projectile", "bounce"])
def test_a_step_is_a_fit_in_full(name: str) -> None:
    """Within a twentieth of the standard deviation of the draws."""
    found, refits = drawn(many(name, 0))
    assert np.max(np.abs(refits - found.draws[:5]) / found.draws.std(axis=0)) < 0.05


def test_draws_depend_on_the_seed_alone() -> None:
    problem = many("slide", 1)
    assert np.array_equal(drawn(problem)[0].draws, drawn(problem)[0].draws)
    assert not np.array_equal(drawn(problem)[0].draws, drawn(problem, seed=1)[0].draws)


def test_intervals_are_as_wide_as_those_of_the_jacobian_where_noise_is_all() -> None:
    found = identify(many("bounce", 2, 40))
    for each in found.parameters:
        share = (each.bootstrap_upper - each.bootstrap_lower) / (each.upper - each.lower)
        assert 0.6 < share < 1.6


def test_recordings_that_differ_widen_the_bootstrap_and_that_is_said() -> None:
    """Each block has a friction of its own: intervals of one friction from the Jacobian are too narrow."""
    problem, stream = many("slide", 3, 30), np.random.default_rng(3)
    for k, time in enumerate(problem.times):
        friction = np.array([0.3 + 0.03 * stream.standard_normal()])
        problem.measured[k] = problem.model(
            friction, problem.own.guess[k] / 1.05, time
        ) + 0.004 * stream.standard_normal((40, 1))  # type: ignore[index]
    found = identify(problem)
    friction = found["friction"]
    assert friction.bootstrap_upper - friction.bootstrap_lower > 2 * (friction.upper - friction.lower)
    assert friction.bootstrap_lower < 0.3 < friction.bootstrap_upper
    assert any("rely on the bootstrap's intervals" in doubt for doubt in found.doubts)


def test_skewed_draws_move_the_interval() -> None:
    """BCa of a mean of squares: the upper side is the longer one, more so than of percentiles."""
    stream = np.random.default_rng(4)
    problem = many("slide", 4, 12)
    problem.model = lambda shared, own, time: shared[0] + 0 * own[0] + 0 * time[:, None]
    problem.measured = [np.full((40, 1), value) for value in stream.exponential(1.0, 12) ** 2]
    problem.own.scale[:] = 1.0
    found, _ = drawn(problem)
    estimate = np.mean([each[0, 0] for each in problem.measured])
    lower, upper = found.interval[0]
    assert upper - estimate > 1.2 * (estimate - lower)
    assert upper > found.percentiles[0, 1] and lower > found.percentiles[0, 0]


def test_few_recordings_and_few_draws_make_none() -> None:
    found = identify(recordings(TRUTHS["slide"], 0))
    assert "needs at least 5, there are 3" in found.bootstrap_note and np.isnan(found["friction"].bootstrap_lower)
    with pytest.raises(IdentificationError, match="100"):
        identify(many("slide", 0), IdentificationOptions(draws=10))
