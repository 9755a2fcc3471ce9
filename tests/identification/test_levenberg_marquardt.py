"""The fit ends where a dense one does, loses nothing when it is interrupted, and says why it ends."""

from __future__ import annotations

import json
import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from data.analytic_recordings import TRUTHS, AnalyticRecordings, recordings
from tools.repeats import first

from symphys.identification import FitOptions, FitStatus, IdentificationError, fit_parameters, revive_state
from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.state import FitState, FitStep
from symphys.types import Array

TIGHT = FitOptions(tolerance=1e-9, iterations=300, patience=0)


def dense(problem: AnalyticRecordings, z: Array) -> tuple[Array, Array]:
    """(m,) all residuals and priors, and (m, s + K o) their Jacobian, at shared and own numbers in one vector."""
    s, (count, o) = len(problem.shared.names), problem.own.guess.shape
    rows, parts = problem.jacobian(z[:s], z[s:].reshape(count, o), np.arange(count)), []
    for k, (_, by_shared, by_own) in enumerate(rows):
        block = np.zeros((len(by_own), count * o))
        block[:, k * o : (k + 1) * o] = by_own
        parts.append(np.hstack([by_shared, block]))
    mean = np.concatenate([problem.shared.prior_mean, problem.own.prior_mean.ravel()])
    deviation = np.concatenate([problem.shared.prior_deviation, problem.own.prior_deviation.ravel()])
    return np.concatenate([*(r for r, _, _ in rows), (z - mean) / deviation]), np.vstack(
        [*parts, np.diag(1 / deviation)]
    )


def by_scipy(problem: AnalyticRecordings, threshold: float = math.inf) -> Array:
    """(s + K o,) where scipy's dense trust region ends."""
    parts = [(p.guess.ravel(), p.lower.ravel(), p.upper.ravel()) for p in (problem.shared, problem.own)]
    guess, lower, upper = (np.concatenate(each) for each in zip(*parts, strict=True))
    robust = {"loss": "huber", "f_scale": threshold} if threshold < math.inf else {}
    tolerances = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 1000}
    found = scipy.optimize.least_squares(
        lambda z: dense(problem, z)[0], guess, lambda z: dense(problem, z)[1], (lower, upper), **robust, **tolerances
    )
    return np.asarray(found.x)


def both(state: FitState) -> Array:
    return np.concatenate([state.shared, state.own.ravel()])


@first("name", TRUTHS)
@pytest.mark.parametrize("threshold", [math.inf, 1.0])
def test_the_minimum_is_that_of_the_dense_problem(name: str, threshold: float) -> None:
    problem = recordings(TRUTHS[name], 3)
    outcome = RecordingFit(problem, replace(TIGHT, threshold=threshold)).run()
    assert outcome.status is FitStatus.CONVERGED
    np.testing.assert_allclose(both(outcome.state), by_scipy(problem, threshold), rtol=0, atol=1e-7)


@pytest.mark.parametrize("threshold", [math.inf, 1.0])
def test_so_is_it_within_bounds_that_hold_a_shared_and_an_own_number(threshold: float) -> None:
    problem = recordings(TRUTHS["projectile"], 4, off=0.95)
    problem.shared = fit_parameters(("gravity", "drag"), [9.2, 0.38], lower=0, upper=[9.4, 10])
    problem.own.upper[0, 0] = 2.9
    outcome = RecordingFit(problem, replace(TIGHT, threshold=threshold)).run()
    expected = by_scipy(problem, threshold)
    assert outcome.state.shared[0] == 9.4 and outcome.state.own[0, 0] == 2.9
    # scipy stays inside of bounds, by about 1e-9 of them.
    np.testing.assert_allclose(both(outcome.state), expected, rtol=0, atol=1e-7)


def test_priors_are_rows() -> None:
    problem = recordings(TRUTHS["projectile"], 5)
    problem.shared = fit_parameters(("gravity", "drag"), [9.0, 0.5], prior_mean=9.7, prior_deviation=[0.01, math.inf])
    problem.own.prior_mean[:] = 4.0
    problem.own.prior_deviation[:] = 0.02
    outcome = RecordingFit(problem, TIGHT).run()
    np.testing.assert_allclose(both(outcome.state), by_scipy(problem), rtol=0, atol=1e-7)
    r = dense(problem, both(outcome.state))[0]
    assert outcome.merit == pytest.approx(float(r @ r), rel=1e-12)


def test_a_recording_that_counts_twice_is_one_that_is_there_twice() -> None:
    problem, which = recordings(TRUTHS["oscillator"], 6), np.array([0, 1])
    weighed = RecordingFit(problem, TIGHT, which, np.array([2.0, 1.0])).run()
    twice = replace(
        problem, times=[problem.times[k] for k in (0, 0, 1)], measured=[problem.measured[k] for k in (0, 0, 1)]
    )
    twice.own = fit_parameters(problem.own.names, problem.own.guess[[0, 0, 1]])
    np.testing.assert_allclose(RecordingFit(twice, TIGHT).run().state.shared, weighed.state.shared, rtol=1e-8)


def test_without_own_or_without_shared_numbers() -> None:
    problem = recordings(TRUTHS["slide"], 7)
    problem.model = lambda shared, own, time: TRUTHS["slide"].model(shared, np.array([1.5]), time)
    problem.own = fit_parameters((), np.zeros((3, 0)))
    assert RecordingFit(problem, TIGHT).run().state.shared == pytest.approx(by_scipy(problem), abs=1e-8)
    problem = recordings(TRUTHS["slide"], 7)
    problem.model = lambda shared, own, time: TRUTHS["slide"].model(np.array([0.3]), own, time)
    problem.shared = fit_parameters((), np.zeros(0))
    assert RecordingFit(problem, TIGHT).run().state.own.ravel() == pytest.approx(by_scipy(problem), abs=1e-8)


def test_an_interrupted_fit_goes_on_to_the_last_bit() -> None:
    problem, options = recordings(TRUTHS["bounce"], 8, off=1.2), FitOptions(threshold=2.0)
    whole = RecordingFit(problem, options).run()
    told: list[FitStep] = []
    half = RecordingFit(problem, options).run(monitor=lambda step, _: told.append(step), stop=lambda: len(told) == 4)
    assert half.status is FitStatus.INTERRUPTED and len(half.state.history) == 4
    state = revive_state(json.loads(json.dumps(half.state.plain())), problem)
    rest = RecordingFit(problem, options).run(state)
    assert np.array_equal(both(rest.state), both(whole.state))
    again = [replace(step, seconds=0.0) for step in rest.state.history]
    assert again == [replace(step, seconds=0.0) for step in whole.state.history]


def test_a_damaged_state_is_refused() -> None:
    problem = recordings(TRUTHS["bounce"], 8)
    saved = RecordingFit(problem, FitOptions(iterations=1)).run().state.plain()
    for damage in ({"shared": [1.0]}, {"own": [[1.0]]}, {"history": 3}):
        with pytest.raises(IdentificationError, match="saved fit"):
            revive_state(saved | damage, problem)


def test_steps_into_simulations_that_are_not_finite_are_refused() -> None:
    """The full first step leads where the model has no numbers; the minimum is reached all the same."""
    problem = recordings(TRUTHS["slide"], 9, off=1.3)
    model, tried = problem.model, []

    def cliff(shared: Array, own: Array, time: Array) -> Array:
        beyond = shared[0].real < 0.29
        tried.append(beyond)
        return np.full((len(time), 1), np.inf) if beyond else model(shared, own, time)

    problem.model = cliff
    problem.shared = fit_parameters(("friction",), [0.6])
    outcome = RecordingFit(problem, TIGHT).run()
    assert any(tried) and outcome.status is FitStatus.CONVERGED
    assert outcome.state.shared[0] == pytest.approx(0.3, abs=0.01)


def test_a_start_that_is_not_finite_names_the_recording() -> None:
    problem = recordings(TRUTHS["slide"], 9)
    model = problem.model
    problem.model = lambda shared, own, time: model(shared, own, time) + (np.inf if own[0].real > 2 else 0.0)
    outcome = RecordingFit(problem, TIGHT).run()
    assert outcome.status is FitStatus.NOT_FINITE
    assert "toss/0002 is not finite" in outcome.reason and "toss/0000" not in outcome.reason


def test_a_wrong_jacobian_is_no_minimum() -> None:
    problem = recordings(TRUTHS["oscillator"], 10)
    right = problem.jacobian
    problem.jacobian = lambda *at: [(r, -by_shared, -by_own) for r, by_shared, by_own in right(*at)]  # type: ignore[method-assign]
    outcome = RecordingFit(problem, FitOptions()).run()
    assert outcome.status is FitStatus.STALLED and "the Jacobian is wrong" in outcome.reason


def test_exact_recordings_are_met_exactly() -> None:
    truth = TRUTHS["projectile"]
    problem = recordings(truth, 0)
    problem.measured = [
        truth.model(truth.shared, own, time) for own, time in zip(truth.own, problem.times, strict=True)
    ]
    outcome = RecordingFit(problem, FitOptions()).run()
    assert outcome.status is FitStatus.CONVERGED and "exactly" in outcome.reason
    np.testing.assert_allclose(outcome.state.shared, truth.shared, rtol=1e-8)


@pytest.mark.slow
def test_memory_is_linear_in_the_recordings() -> None:
    """Of one iteration: eight times the recordings take eight times the memory, not sixty-four."""
    peaks = []
    for count in (25, 200):
        truth = replace(TRUTHS["oscillator"], own=np.tile([[0.1, 0.2]], (count, 1)), samples=10)
        fit = RecordingFit(recordings(truth, 11), FitOptions(iterations=1))
        tracemalloc.start()
        fit.run()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 10 * peaks[0]


def test_options_and_parameters_say_what_is_valid() -> None:
    with pytest.raises(IdentificationError, match="damping is 0"):
        FitOptions(damping=0)
    with pytest.raises(IdentificationError, match=r"friction: .*bounds"):
        fit_parameters(("mass", "friction"), [1.0, 0.5], upper=[2.0, 0.4])
    with pytest.raises(IdentificationError, match=r"mass: .*scale"):
        fit_parameters(("mass", "friction"), [1.0, 0.5], scale=[0.0, 1.0])
    problem = recordings(TRUTHS["slide"], 0)
    problem.held_back[:] = True
    with pytest.raises(IdentificationError, match="held back"):
        RecordingFit(problem, FitOptions())
