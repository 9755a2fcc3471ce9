"""A fit that begins with what happens first reaches a minimum that a fit of the whole does not."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, Truth, recordings, tumble
from tools.repeats import few

from symphys.identification import (
    FitOptions,
    FitState,
    FitStatus,
    FitStep,
    IdentificationError,
    IdentificationOptions,
    fit,
    identify,
    revive_state,
)
from symphys.identification.fitting.fit import PartialRecordings, before_impact, first_share

GROWING = (0.3, 0.5, 0.7, 0.85, 1.0)


def tumbles(count: int = 12) -> AnalyticRecordings:
    """Chaotic bounces, numbers off by 10 %, starts by 4 %."""
    stream = np.random.default_rng(0)
    own = np.stack([stream.uniform(0.7, 1.4, count), stream.uniform(0.2, 1.0, count)], axis=1)
    truth = Truth(tumble, ("gravity", "restitution"), np.array([9.81, 0.7]), own, 2.0, np.array([0.005, 0.005]), 60)
    problem = recordings(truth, 1, off=1.1)
    problem.own.guess[:] = own * (1.03 + 0.01 * stream.standard_normal(own.shape))
    problem.own.lower[:] = 0.01
    return problem


@pytest.mark.slow
def test_growing_horizons_follow_chaos() -> None:
    """To residuals of the size of the noise, where all at once ends at more than ten times it."""
    at_once = fit(tumbles(), FitOptions(iterations=40)).outcome
    grown = fit(tumbles(), FitOptions(iterations=40, horizons=GROWING)).outcome
    size = 12 * 120
    assert grown.merit / size == pytest.approx(1.0, abs=0.1)
    assert at_once.merit / size > 100
    np.testing.assert_allclose(grown.state.shared, [9.81, 0.7], rtol=1e-3)


def test_they_end_where_the_whole_does_where_there_is_one_minimum() -> None:
    for known in (True, False):
        problem = recordings(TRUTHS["projectile"], 2, noise_known=np.array([known]))
        whole, grown = (fit(problem, FitOptions(horizons=each)).outcome for each in ((1.0,), GROWING))
        assert grown.status is FitStatus.CONVERGED
        np.testing.assert_allclose(grown.state.shared, whole.state.shared, rtol=1e-5)


def test_a_share_has_the_rows_of_its_time() -> None:
    problem = recordings(TRUTHS["bounce"], 3, impacts=[0.4, 0.3, 0.5])
    part, which = PartialRecordings(problem, first_share(0.5)), np.array([2, 0])
    at = problem.shared.guess, problem.own.guess, which
    for k, r, (_, by_shared, by_own), whole in zip(
        which, part.residuals(*at), part.jacobian(*at), problem.residuals(*at), strict=True
    ):
        rows = part.rows(int(k))
        assert rows.time.max() <= 0.9 and len(rows.time) == len(rows.impact) == 20
        assert np.array_equal(r, whole[:20]) and by_shared.shape == (20, 2) and by_own.shape == (20, 1)


@few("known", [True, False], 1)
@pytest.mark.parametrize("after", [3, 8, 11])
def test_an_interruption_in_any_of_them_loses_nothing(known: bool, after: int) -> None:
    problem = recordings(TRUTHS["bounce"], 4, off=1.1, noise_known=np.array([known]))
    options, told, states = FitOptions(horizons=GROWING), list[FitStep](), list[FitState]()
    whole = fit(problem, options).outcome
    assert len(whole.state.history) > after

    def monitor(step: FitStep, state: FitState) -> None:
        told.append(step)
        states.append(state)

    half = fit(problem, options, monitor=monitor, stop=lambda: len(told) >= after).outcome
    assert half.status is FitStatus.INTERRUPTED
    rest = fit(problem, options, start=revive_state(json.loads(json.dumps(states[-1].plain())), problem)).outcome
    assert np.array_equal(rest.state.shared, whole.state.shared) and np.array_equal(rest.state.own, whole.state.own)
    assert [replace(step, seconds=0.0) for step in rest.state.history] == [
        replace(step, seconds=0.0) for step in whole.state.history
    ]


@pytest.mark.parametrize("wrong", [(), (0.5,), (0.5, 0.3, 1.0), (0.0, 1.0), (1.0, 1.2)])
def test_horizons_rise_to_one(wrong: tuple[float, ...]) -> None:
    with pytest.raises(IdentificationError, match="1"):
        FitOptions(horizons=wrong)


def test_starts_of_recordings_held_back_come_from_before_the_impact() -> None:
    """The prediction then is as good as that of the exact start, and what happens later has no part in the start."""
    truth = TRUTHS["bounce"]
    problem = recordings(truth, 5, off=1.0, impacts=[float(np.sqrt(2 * own[0] / 9.81)) for own in truth.own])
    problem.held_back[2] = True
    problem.own.guess[2] = 1.5
    late = problem.times[2] > 0.6
    errors = {}
    for starts in ("guess", "whole", "before impact"):
        found = identify(problem, IdentificationOptions(draws=0, held_back_starts=starts))
        errors[starts] = found.held_back_errors[0].ratio
    assert errors["guess"] > 10 and errors["whole"] < 2 and errors["before impact"] < 2
    assert found.own[2, 0] == pytest.approx(1.4, abs=0.01)
    problem.measured[2][late] += 1.0
    later = identify(problem, IdentificationOptions(draws=0, held_back_starts="before impact"))
    assert later.own[2, 0] == found.own[2, 0] and later.held_back_errors[0].ratio > 10
    with pytest.raises(IdentificationError, match='"before impact"'):
        IdentificationOptions(held_back_starts="before impacts")


def test_before_the_impact_is_before_the_first() -> None:
    rows = recordings(TRUTHS["bounce"], 0, impacts=[0.5, 0.5, 0.5]).rows(0)
    assert np.array_equal(before_impact(rows), rows.time < 0.5)
    assert before_impact(replace(rows, impact=np.full(40, np.nan))).all()
