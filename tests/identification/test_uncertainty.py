"""Intervals cover the truth as often as they say, and are hardly wider than the Cramer-Rao bound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, AnalyticRecordings, Truth, recordings
from tools.repeats import thorough

from symphys.identification import FitOptions, IdentificationOptions, fit, fit_parameters, identify
from symphys.identification.inference.uncertainty import Uncertainty
from symphys.types import Array

DRAWS = 100
UNKNOWN = np.array([False])


def dense_covariance(problem: AnalyticRecordings, shared: Array, own: Array) -> Array:
    """Inverse of J'J of all numbers in one matrix, shared ones first: at the truth it is the Cramer-Rao bound."""
    rows, (count, o) = problem.jacobian(shared, own, np.arange(len(own))), own.shape
    blocks = [
        np.hstack([by_own if j == k else np.zeros((len(by_own), o)) for j in range(count)])
        for k, (_, _, by_own) in enumerate(rows)
    ]
    whole = np.vstack([np.hstack([by_shared, block]) for (_, by_shared, _), block in zip(rows, blocks, strict=True)])
    return np.linalg.inv(whole.T @ whole)


def known(problem: AnalyticRecordings, options: FitOptions | None = None) -> tuple[Array, Array, Uncertainty]:
    fitted = fit(problem, options or FitOptions())
    assert fitted.uncertainty is not None
    return fitted.outcome.state.shared, fitted.outcome.state.own, fitted.uncertainty


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "threshold"),
    [
        ("bounce", math.inf),
        *(thorough(name, math.inf) for name in ("slide", "projectile", "oscillator")),
        *(thorough(name, 1.345) for name in ("bounce", "slide", "projectile", "oscillator")),
    ],
)
def test_intervals_cover_the_truth_and_are_narrow(name: str, threshold: float) -> None:
    """Of 100 draws of the noise, whose size is estimated: 90 to 99, or as many as chance leaves of 95 %.

    Of 100 draws at 95 % fewer than 88 or more than 99 cover in one case of 300; all draws are the same each time.
    """
    truth, covered, widths = TRUTHS[name], 0, []
    for seed in range(DRAWS):
        problem = recordings(truth, seed, noise_known=UNKNOWN)
        shared, _, found = known(problem, FitOptions(threshold=threshold))
        interval = found.interval(shared)
        covered = covered + ((interval[:, 0] <= truth.shared) & (truth.shared <= interval[:, 1]))
        bound = 1.96 * np.sqrt(np.diag(dense_covariance(problem, truth.shared, truth.own)))[: len(shared)]
        widths.append(np.diff(interval)[:, 0] / 2 / bound)
    assert np.all(covered >= 90) and np.all(covered <= 99), covered
    assert np.all(np.mean(widths, axis=0) < 1.1)
    assert np.max(widths) < 1.5


def test_elimination_gives_the_inverse_of_the_whole_matrix() -> None:
    problem = recordings(TRUTHS["projectile"], 1)
    shared, own, found = known(problem)
    whole = dense_covariance(problem, shared, own)
    np.testing.assert_allclose(found.covariance, whole[:2, :2], rtol=1e-8)
    np.testing.assert_allclose(found.own_error.ravel(), np.sqrt(np.diag(whole))[2:], rtol=1e-8)
    assert found.correlation[0, 1] == pytest.approx(whole[0, 1] / math.sqrt(whole[0, 0] * whole[1, 1]), rel=1e-8)


def test_the_sandwich_is_that_of_the_whole_matrix() -> None:
    """H^-1 M H^-1 with psi^2 in M and the mean of psi' in H, both dense."""
    problem, threshold = recordings(TRUTHS["projectile"], 1), 1.2
    shared, own, found = known(problem, FitOptions(threshold=threshold))
    rows, (count, o) = problem.jacobian(shared, own, np.arange(3)), own.shape
    parts = []
    for k, (_, by_shared, by_own) in enumerate(rows):
        parts.append(np.hstack([by_shared, *(by_own if j == k else 0 * by_own for j in range(count))]))
    whole, r = np.vstack(parts), np.concatenate([each for each, _, _ in rows])
    bread = np.linalg.inv(whole.T @ whole * np.mean(np.abs(r) <= threshold))
    meat = (whole.T * np.clip(r, -threshold, threshold) ** 2) @ whole
    sandwich = bread @ meat @ bread * len(r) / (len(r) - 2 - count * o)
    np.testing.assert_allclose(found.covariance, sandwich[:2, :2], rtol=1e-7)
    np.testing.assert_allclose(found.own_error.ravel(), np.sqrt(np.diag(sandwich))[2:], rtol=1e-7)


def test_a_bound_that_holds_is_said_and_the_others_are_as_if_it_were_known() -> None:
    problem = recordings(TRUTHS["projectile"], 2)
    problem.shared = fit_parameters(("gravity", "drag"), [9.3, 0.4], upper=[9.4, 10.0])
    held = identify(problem)
    assert held["gravity"].at_bound == "upper" and math.isnan(held["gravity"].lower)
    assert any("gravity is at its upper bound, 9.4" in doubt for doubt in held.doubts)
    fixed = recordings(TRUTHS["projectile"], 2)
    fixed.shared = fit_parameters(("drag",), [0.4])
    model = fixed.model
    fixed.model = lambda shared, own, time: model([9.4, shared[0]], own, time)  # type: ignore[arg-type]
    assert held["drag"].error == pytest.approx(identify(fixed)["drag"].error, rel=1e-6)


def test_a_prior_narrows_as_information_adds() -> None:
    problem = recordings(TRUTHS["slide"], 3)
    free = known(problem)[2].error[0]
    problem.shared = fit_parameters(("friction",), [0.3], prior_mean=0.3, prior_deviation=free)
    assert known(problem)[2].error[0] == pytest.approx(free / math.sqrt(2), rel=1e-2)


def test_noise_is_estimated_quantity_by_quantity() -> None:
    """Two quantities of unknown noise, 3 and 0.2 times what was guessed: the fit weighs them as if it were known."""
    truth = replace(TRUTHS["projectile"], noise=np.array([0.03, 0.002]))
    given = {"quantities": ("x", "z"), "units": ("m", "m")}
    exact = recordings(truth, 4, noise_known=np.array([True, True]), **given)
    guessed = recordings(truth, 4, noise_known=np.array([False, False]), **given)
    guessed.noise = np.array([0.01, 0.01])
    found, expected = identify(guessed), identify(exact)
    assert [each.noise for each in found.quantities] == pytest.approx([0.03, 0.002], rel=0.2)
    spread = expected["gravity"].error
    assert found["gravity"].error == pytest.approx(spread, rel=0.2)
    assert found["gravity"].value == pytest.approx(expected["gravity"].value, abs=0.2 * spread)


@pytest.mark.slow
def test_the_estimate_of_noise_has_no_bias() -> None:
    """4 samples for 2 numbers: without the leverage it would be too small by a factor of 1.4."""
    line = Truth(
        lambda shared, own, t: (shared[0] + own[0] * t)[:, None],
        ("level",),
        np.array([1.0]),
        np.ones((3, 1)),
        1.0,
        np.array([0.1]),
        3,
    )
    estimates = [
        identify(recordings(line, seed, noise_known=UNKNOWN), IdentificationOptions(draws=0)) for seed in range(60)
    ]
    squares = [each.quantities[0].noise ** 2 for each in estimates]
    assert np.mean(squares) == pytest.approx(0.01, rel=0.2)


def test_gross_errors_widen_little_under_hubers_loss() -> None:
    """A tenth of the samples wrong by 30 deviations: least squares errs by more, and its intervals are wider."""
    truth, stream = TRUTHS["projectile"], np.random.default_rng(5)
    found = {}
    problem = recordings(truth, 5, noise_known=UNKNOWN)
    problem.measured = [each + (stream.random(each.shape) < 0.1) * 0.3 for each in problem.measured]
    for threshold in (math.inf, 1.345):
        found[threshold] = identify(problem, IdentificationOptions(fit=FitOptions(threshold=threshold)))["gravity"]
    robust, squares = found[1.345], found[math.inf]
    assert robust.error < 0.5 * squares.error
    assert abs(robust.value - 9.81) < 4 * robust.error


def test_more_numbers_than_residuals_are_a_doubt() -> None:
    problem = recordings(replace(TRUTHS["projectile"], samples=1, own=TRUTHS["projectile"].own[:2]), 0)
    assert any("are 3 too many for the residuals" in doubt for doubt in identify(problem).doubts)
