"""Recordings that leave their model do not hold up the others; a fit that gets next to nothing of it ends."""

from __future__ import annotations

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, recordings

from symphys.identification import FitOptions, FitStatus
from symphys.identification.fitting.levenberg_marquardt import RecordingFit


def with_one_astray() -> AnalyticRecordings:
    """Slides, and one recording whose merit has a sharp bend at its minimum, as chaos makes: steps go far beyond it."""
    problem = recordings(TRUTHS["slide"], 9)
    model = problem.model
    problem.measured[2][:] = 0.0

    def bent(s: np.ndarray, own: np.ndarray, time: np.ndarray) -> np.ndarray:
        if own[0].real < 1.8:
            return model(s, own, time)
        return 0 * model(s, own, time) + 0.05 + np.sqrt(1e-8 + (50 * (own[0] - 2.2)) ** 2)

    problem.model = bent
    return problem


def test_own_steps_are_those_of_the_whole_step() -> None:
    problem = recordings(TRUTHS["bounce"], 0)
    fit = RecordingFit(problem, FitOptions())
    system = fit.system(problem.shared.guess, problem.own.guess)
    free = np.ones(2, bool), np.ones(problem.own.guess.shape, bool)
    shared, own = system.step(10.0, *free)
    np.testing.assert_allclose(system.own_step(shared, np.full(3, 10.0), free[1]), own, rtol=1e-9)
    falls = system.expected_falls(shared, own)
    assert falls.sum() == pytest.approx(system.expected_fall(shared, own))
    held = np.zeros_like(free[1])
    assert not system.own_step(shared, np.full(3, 10.0), held).any()


def test_the_fall_of_each_recording_is_that_of_its_model() -> None:
    """A tiny step lowers each cost as its model says."""
    problem = recordings(TRUTHS["oscillator"], 0)
    fit = RecordingFit(problem, FitOptions())
    system = fit.system(problem.shared.guess, problem.own.guess)
    shared, own = (1e-6 * np.ones(size) for size in (2, problem.own.guess.shape))
    moved = fit.system(
        problem.shared.guess + problem.shared.scale * shared, problem.own.guess + problem.own.scale * own
    )
    np.testing.assert_allclose(system.expected_falls(shared, own), system.costs - moved.costs, rtol=1e-3)


def test_one_recording_astray_does_not_hold_up_the_others() -> None:
    problem = with_one_astray()
    outcome = RecordingFit(problem, FitOptions()).run()
    others = RecordingFit(recordings(TRUTHS["slide"], 9), FitOptions(), which=np.arange(2)).run()
    assert others.status is FitStatus.CONVERGED
    assert outcome.state.own[:2, 0] == pytest.approx(others.state.own[:2, 0], abs=1e-4)
    assert outcome.state.shared == pytest.approx(others.state.shared, abs=1e-4)
    assert outcome.state.own[2, 0] == pytest.approx(2.2, abs=1e-4)


def test_a_fit_ends_whose_jacobian_promises_what_no_step_brings(monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of the Jacobian is not that of the residuals, as where these are rough; steps on bring next to nothing."""
    problem = recordings(TRUTHS["oscillator"], 9)
    true, stray = problem.jacobian, np.abs(np.random.default_rng(0).standard_normal((40, 2)))

    def promising(shared: np.ndarray, own: np.ndarray, which: np.ndarray) -> list[tuple[np.ndarray, ...]]:
        rows = true(shared, own, which)
        return [(r, a + 10 * np.sign(r)[:, None] * stray * np.sqrt(np.mean(a**2)), b) for r, a, b in rows]

    problem.jacobian = promising
    ended = RecordingFit(problem, FitOptions()).run()
    monkeypatch.setattr("symphys.identification.fitting.levenberg_marquardt.MIN_SHARE_OF_MODEL", 0.0)
    on = RecordingFit(problem, FitOptions()).run()
    assert ended.status is on.status is FitStatus.STALLED and ended.state.history[-1].left > 1
    assert len(ended.state.history) < len(on.state.history) - 4
    assert ended.state.history[-1].merit < 1.001 * on.state.history[-1].merit
