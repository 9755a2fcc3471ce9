"""A fit at a kink of the merit has converged, one that is stuck has not, and vague numbers have no part in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from data.analytic_recordings import TRUTHS, AnalyticRecordings, recordings

from symphys.identification import FitOptions, FitOutcome, FitStatus, IdentificationOptions, fit_parameters, identify
from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.types import Array


def bounces(samples: int, seed: int, copies: int = 1) -> AnalyticRecordings:
    """Balls that bounce; with these seeds an impact falls on a sample where the fit ends."""
    truth = TRUTHS["bounce"]
    own = np.tile(truth.own, (copies, 1)) * (1 + 0.2 * np.random.default_rng(seed).random((3 * copies, 1)))
    return recordings(replace(truth, samples=samples, own=own), seed, off=1.02)


def polished(problem: AnalyticRecordings, outcome: FitOutcome) -> float:
    """The lowest merit about the outcome without any derivative."""
    s, at = len(problem.shared.names), np.concatenate([outcome.state.shared, outcome.state.own.ravel()])

    def merit(z: Array) -> float:
        own = z[s:].reshape(problem.own.guess.shape)
        return sum(float(r @ r) for r in problem.residuals(z[:s], own, np.arange(len(own))))

    simplex = at + np.concatenate([np.zeros((1, at.size)), 1e-4 * np.eye(at.size) * at])
    tight = {"initial_simplex": simplex, "xatol": 1e-10, "fatol": 1e-10, "maxiter": 20000, "maxfev": 20000}
    return float(scipy.optimize.minimize(merit, at, method="Nelder-Mead", options={"adaptive": True, **tight}).fun)


@pytest.mark.parametrize(("samples", "seed"), [(12, 43), (40, 20), (40, 24)])
def test_at_a_kink_no_step_is_left_although_one_side_promises_one(samples: int, seed: int) -> None:
    problem = bounces(samples, seed)
    outcome = RecordingFit(problem, FitOptions()).run()
    assert outcome.status is FitStatus.CONVERGED and "has a kink here" in outcome.reason
    assert outcome.state.history[-1].left > 0.05
    assert f"predicts the minimum {outcome.state.history[-1].left:.2g} standard errors away" in outcome.reason
    errors = (outcome.merit - polished(problem, outcome)) / (outcome.merit / (3 * samples))
    assert errors < 0.05**2


@pytest.mark.slow
def test_kinks_of_some_recordings_of_many() -> None:
    outcome = RecordingFit(bounces(12, 5, copies=40), FitOptions()).run()
    assert outcome.status is FitStatus.CONVERGED and "has a kink here" in outcome.reason


def cliff(height: float) -> AnalyticRecordings:
    """Slides whose residuals jump before the friction that fits."""
    problem = recordings(TRUTHS["slide"], 9)
    model = problem.model
    problem.shared = fit_parameters(("friction",), [0.6])
    problem.model = lambda s, own, time: model(s, own, time) + (height if s[0].real < 0.33 else 0.0)
    return problem


def test_a_fit_that_is_stuck_is_not_converged() -> None:
    """A cliff in the way to the minimum: no lower merit is found, and both sides of the cliff promise one beyond."""
    outcome = RecordingFit(cliff(0.5), FitOptions()).run()
    assert outcome.status is FitStatus.STALLED and outcome.state.history[-1].left > 5
    assert outcome.state.shared[0] == pytest.approx(0.33, abs=1e-3)
    found = identify(cliff(0.5), IdentificationOptions(draws=0))
    assert found.status == "stalled" and found.doubts
    assert RecordingFit(cliff(0.0), FitOptions()).run().status is FitStatus.CONVERGED


def vague() -> AnalyticRecordings:
    """Slides with a second own number, on which the residuals depend by hardly anything, and not as a line does."""
    truth, tiny = TRUTHS["slide"], 1e-4
    own = np.concatenate([truth.own, np.zeros((3, 1))], axis=1)
    problem = recordings(replace(truth, own=own), 0)
    model = problem.model
    problem.model = lambda s, own, time: model(s, own, time) + tiny * np.sin(3 * time[:, None]) * (own[1] - own[1] ** 3)
    problem.own.scale[:, 1] = 1.0
    return problem


def test_a_number_that_is_vague_has_no_part_in_it() -> None:
    problem = vague()
    outcome = RecordingFit(problem, FitOptions()).run()
    left = outcome.state.history[-1].left
    assert outcome.status is FitStatus.CONVERGED and left > 0.5
    assert "excluding own 1 of 3 recordings, which the recordings do not determine" in outcome.reason
    assert f"{left:.2g} standard errors away" in outcome.reason
    plain = RecordingFit(recordings(TRUTHS["slide"], 0), FitOptions()).run()
    assert outcome.state.shared == pytest.approx(plain.state.shared, abs=1e-3)
    found = identify(problem, IdentificationOptions(draws=0))
    assert np.isinf(found.own_error[:, 1]).all() and np.isfinite(found.own_error[:, 0]).all() and not found.doubts
