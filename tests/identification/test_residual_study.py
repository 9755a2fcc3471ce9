"""Noise is called noise, and an effect that the model misses is found where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, Truth, oscillator, recordings

from symphys.identification import IdentificationOptions, fit_parameters, identify
from symphys.identification.inference.residual_study import explained, ljung_box
from symphys.results.identification import Identification
from symphys.types import Array

QUIET = IdentificationOptions(draws=0)


def of_flight(missed: float, seed: int, jump: float = 0.0) -> Identification:
    """A ball falls; its model has neither the drag ``missed`` [1/s], nor the ``jump`` [m] after an impact at 0.6 s."""

    def measured(shared: Array, own: Array, time: Array) -> Array:
        return (own[0] * time - shared[0] / 2 * time**2 * (1 - missed * time / 3) + jump * (time > 0.6))[:, None]

    truth = Truth(
        measured, ("gravity",), np.array([9.81]), np.array([[5.0], [4.0], [6.0], [7.0]]), 1.2, np.array([0.005])
    )
    problem = recordings(truth, seed, impacts=[0.6] * 4)
    problem.model = lambda shared, own, time: (own[0] * time - shared[0] / 2 * time**2)[:, None]
    return identify(problem, QUIET)


def test_noise_is_noise_in_each_draw() -> None:
    verdicts = [of_flight(0.0, seed).quantities[0].verdict for seed in range(20)]
    assert verdicts == ["noise"] * 20


def test_a_missing_drag_is_found_over_the_time() -> None:
    for seed in range(5):
        found = of_flight(0.3, seed)
        (place,) = found.quantities
        assert place.verdict == "missing effect" and place.by_time > 0.3 and place.autocorrelation > 0.5
        assert "the time in the recording" in place.text and any("misses an effect" in doubt for doubt in found.doubts)


def test_what_an_impact_leaves_is_found_after_it() -> None:
    (place,) = of_flight(0.0, 0, jump=0.05).quantities
    assert place.verdict == "missing effect" and place.by_impact > 0.3 and "the time since the impact" in place.text


def test_recordings_that_differ_are_found_and_named_worst() -> None:
    """One recording has another gravity, and no own number to hide it."""
    truth = replace(TRUTHS["oscillator"], own=np.zeros((6, 0)))
    model = lambda shared, own, time: oscillator(shared, np.array([0.1, 0.3]), time) + (time * 0)[:, None]  # noqa: E731
    problem = recordings(replace(truth, model=model), 1)
    problem.measured[4] = problem.measured[4] + 0.01
    found = identify(problem, QUIET)
    assert found.quantities[0].by_recording > 0.3
    assert found.worst(1)[0][0] == "toss/0004" and found.worst(1)[0][1] > 2


@pytest.mark.parametrize(
    ("size", "word"), [(0.5, "of the given noise, which is too large"), (2.0, "times the given noise")]
)
def test_a_noise_that_is_wrong_is_said(size: float, word: str) -> None:
    problem = recordings(TRUTHS["slide"], 2)
    problem.noise = problem.noise / size
    (place,) = identify(problem, QUIET).quantities
    assert place.verdict == "noise" and word in place.text and place.ratio == pytest.approx(size, rel=0.15)
    assert place.rms == pytest.approx(0.004, rel=0.15)


def test_the_test_of_ljung_and_box_is_the_textbooks() -> None:
    """Of one series, of mean 0: n sum r_l^2, each lag by its pairs; uniform under white noise."""
    run = np.array([1.0, -2.0, 0.5, 1.5, -1.0, 0.3, 0.8, -0.6])
    first, _, lags = ljung_box([run])
    assert lags == 2 and first == pytest.approx(float(run[1:] @ run[:-1]) / float(run @ run) * 8 / 7)
    stream = np.random.default_rng(0)
    found = [ljung_box([stream.standard_normal(60) for _ in range(5)])[1] for _ in range(200)]
    assert 0.02 <= np.mean(np.array(found) < 0.1) <= 0.18
    alternating = ljung_box([np.resize([1.0, -1.0], 60)])
    assert alternating[0] < -0.9 and alternating[1] < 1e-6


def test_shares_are_adjusted_for_the_number_of_means() -> None:
    stream = np.random.default_rng(1)
    groups = np.repeat(np.arange(30), 4)
    assert np.mean([explained(stream.standard_normal(120), groups)[0] for _ in range(50)]) < 0.1
    assert 0.02 <= np.mean([explained(stream.standard_normal(120), groups)[1] < 0.1 for _ in range(200)]) <= 0.18
    share, probability = explained(groups - 14.5 + 0.01 * stream.standard_normal(120), groups)
    assert share > 0.99 and probability < 1e-9


def held_back(problem: AnalyticRecordings) -> Identification:
    problem.held_back = np.array([False, False, True])
    return identify(problem, QUIET)


def test_recordings_held_back_are_predicted_and_not_fitted_to() -> None:
    """Their own numbers stay at the guess: an error of the guess is one of the prediction, and of nothing else."""
    truth = TRUTHS["projectile"]
    exact = recordings(truth, 3, off=1.0)
    found = held_back(exact)
    (errors,) = found.held_back_errors
    assert errors.recordings == 1 and errors.ratio == pytest.approx(1.0, abs=0.2)
    assert errors.rmse == pytest.approx(0.01 * np.sqrt(2), rel=0.2) and np.isnan(errors.deviation)
    wrong = recordings(truth, 3, off=1.0)
    wrong.own = fit_parameters(wrong.own.names, truth.own + np.array([[0, 0], [0, 0], [1.0, 0]]))
    worse = held_back(wrong)
    assert worse.held_back_errors[0].mean > 0.3 and worse.worst(1)[0][0] == "toss/0002"
    assert [each.value for each in worse.parameters] == pytest.approx(
        [each.value for each in found.parameters], rel=1e-6
    )
    assert np.isnan(worse.own_error[2]).all() and np.array_equal(worse.own[2], wrong.own.guess[2])


def test_an_error_is_the_length_of_the_difference() -> None:
    """Both components off by 3 and 4 cm: 5 cm, whatever the noise."""
    problem = recordings(TRUTHS["projectile"], 4, off=1.0)
    problem.measured[2] = problem.model(problem.shared.guess, problem.own.guess[2], problem.times[2]) + np.array(
        [0.03, 0.04]
    )
    problem.measured[2][5, 1] = np.nan
    problem.shared.lower[:] = problem.shared.upper[:] = problem.shared.guess
    (errors,) = held_back(problem).held_back_errors
    assert errors.mean == pytest.approx((39 * 0.05 + 0.03) / 40, rel=1e-9)
