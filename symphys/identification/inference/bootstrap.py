"""Bootstrap intervals over recordings: each draw has as many recordings as there are, with replacement.

A draw is one Gauss-Newton step from the estimate with the Jacobians kept, own numbers eliminated: a linear solve of the
size of the shared numbers, so that thousands of draws take milliseconds. It is exact where the model is linear within
the interval; ``refitted`` fits some draws in full, which shows whether it is. Intervals are bias-corrected and
accelerated (BCa; Efron 1987), the acceleration from the same step with one recording left out.

Unlike intervals from the Jacobian it needs no noise model: recordings that differ from each other by more than noise
explains widen it. With fewer than ``MIN_RECORDINGS`` recordings a draw says nothing, and there is none.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.stats

from symphys.identification.fitting.arrow import ArrowSystem
from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.state import FitOptions, FitState, begin
from symphys.identification.inference.uncertainty import CONFIDENCE_LEVEL, Information
from symphys.identification.interface import IdentificationError, RecordedResiduals
from symphys.records import dataclass
from symphys.types import Array, Ints

MIN_RECORDINGS = 5
"""Least number of recordings for a bootstrap."""
MIN_DRAWS = 100
"""Least number of draws for an interval."""
MIN_INFORMATION_SHARE = 1e-10
"""Share of the information of all recordings below which a draw has none along a direction."""
DRAWS_PER_BATCH = 256
"""Draws that are solved at once, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Draws of the shared numbers, in their own units.

    Attributes:
        draws: (b, s).
        interval: (s, 2) of 95 %, nan for what a bound holds, and where a bootstrap is not possible.
        percentiles: (s, 2) the same without correction.
        refits: (r, s) draws that were fitted in full, the first r of ``draws``.
        note: why there is none; empty otherwise.
    """

    draws: Array
    interval: Array
    percentiles: Array
    refits: Array
    note: str = ""


def bootstrap(
    problem: RecordedResiduals,
    shared: Array,
    system: ArrowSystem,
    information: Information,
    draws: int = 2000,
    seed: int = 0,
) -> Bootstrap:
    """Bootstrap about the estimate (s,), whose arrow is ``system``; equal seeds give equal draws.

    Raises:
        IdentificationError: too few draws for an interval.
    """
    if draws < MIN_DRAWS:
        raise IdentificationError(f"{draws} draws of a bootstrap: at least {MIN_DRAWS} make an interval")
    recordings, s = len(information.left), len(shared)
    if recordings < MIN_RECORDINGS:
        return no_bootstrap(s, f"a bootstrap over recordings needs at least {MIN_RECORDINGS}, there are {recordings}")
    weights = resampling_weights(recordings, draws, seed)
    found = steps(problem, shared, system, information, weights)
    left_out = steps(problem, shared, system, information, 1.0 - np.eye(recordings))
    tails = np.array([(1 - CONFIDENCE_LEVEL) / 2, (1 + CONFIDENCE_LEVEL) / 2])
    held = ~information.free_shared
    percentiles, interval = np.quantile(found, tails, axis=0).T, bca(found, shared, left_out, tails)
    percentiles[held], interval[held] = np.nan, np.nan
    return Bootstrap(found, interval, percentiles, np.zeros((0, s)))


def no_bootstrap(s: int, note: str) -> Bootstrap:
    """Return a bootstrap of s numbers without draws, and why there are none."""
    none = np.full((s, 2), np.nan)
    return Bootstrap(np.zeros((0, s)), none, none, np.zeros((0, s)), note)


def resampling_weights(recordings: int, draws: int, seed: int) -> Array:
    """Draw (draws, K) the number of occurrences of each recording in each draw."""
    stream = np.random.default_rng(seed)
    return stream.multinomial(recordings, np.full(recordings, 1 / recordings), size=draws).astype(float)


def steps(
    problem: RecordedResiduals, shared: Array, system: ArrowSystem, information: Information, weights: Array
) -> Array:
    """Compute (b, s) the estimates after one Gauss-Newton step with the weights (b, K), within the bounds."""
    s, whitener = len(shared), information.shared.whitener
    sides = system.gradients[:, :s] + np.einsum("kos,ko->ks", information.gain, system.own_gradient)
    rows = information.left @ whitener
    shares = rows.transpose(0, 2, 1) @ rows
    prior = whitener.T @ (system.prior_block[:, None] * whitener)
    moved = np.zeros((len(weights), s))
    for start in range(0, len(weights), DRAWS_PER_BATCH):
        some = weights[start : start + DRAWS_PER_BATCH]
        values, vectors = np.linalg.eigh(np.tensordot(some, shares, 1) + prior)
        known = values > MIN_INFORMATION_SHARE * np.max(values, axis=1, initial=0.0, keepdims=True)
        along = np.einsum("bij,bi->bj", vectors, (some @ sides + system.prior_gradient) @ whitener)
        along = np.where(known, along / np.where(known, values, 1.0), 0.0)
        moved[start : start + DRAWS_PER_BATCH] = -np.einsum("bij,bj->bi", vectors, along) @ whitener.T
    return np.clip(shared + moved * problem.shared.scale, problem.shared.lower, problem.shared.upper)


def bca(draws: Array, estimate: Array, left_out: Array, tails: Array) -> Array:
    """Compute (s, 2) bias-corrected and accelerated quantiles of draws (b, s); left_out (K, s): one recording less."""
    # Bias correction z0: quantile of the estimate among the draws.
    below = np.mean(draws < estimate, axis=0) + np.mean(draws == estimate, axis=0) / 2
    shift = scipy.stats.norm.ppf(np.clip(below, 1 / len(draws), 1 - 1 / len(draws)))
    # Acceleration a from the jackknife.
    away = left_out.mean(axis=0) - left_out
    spread = np.sum(away**2, axis=0)
    skew = np.where(spread > 0, np.sum(away**3, axis=0) / (6 * np.where(spread > 0, spread, 1.0) ** 1.5), 0.0)
    # Levels Phi(z0 + (z0 + z) / (1 - a (z0 + z))) (Efron 1987).
    ends = scipy.stats.norm.ppf(tails)[:, None] + shift
    levels = scipy.stats.norm.cdf(shift + ends / (1 - skew * ends))
    return np.array([np.quantile(draws[:, j], levels[:, j]) for j in range(draws.shape[1])]).reshape(-1, 2)


def refitted(
    problem: RecordedResiduals,
    options: FitOptions,
    at: FitState,
    which: Ints,
    count: int,
    seed: int,
    draws: int,
    stop: Callable[[], bool] | None = None,
) -> Array:
    """Fit in full the first ``count`` of ``draws`` of ``bootstrap``: (r, s); fewer after an interruption."""
    found: list[Array] = []
    for weights in resampling_weights(len(which), draws, seed)[:count]:
        if stop is not None and stop():
            break
        drawn = weights > 0
        fit = RecordingFit(problem, options, which[drawn], weights[drawn])
        found.append(fit.run(begin(at.shared, at.own), stop=stop).state.shared)
    return np.array(found).reshape(-1, len(at.shared))
