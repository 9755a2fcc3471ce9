"""The fit of all recordings, alternating with estimates of unknown noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from symphys.identification.fitting.horizons import PartialRecordings, before_impact, first_share
from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.noise import MIN_NOISE_FACTOR, RescaledResiduals, noise_factors
from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.fitting.start_values import begin_with_effect
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, FitStep, begin
from symphys.identification.inference.uncertainty import Uncertainty, uncertainty
from symphys.identification.interface import RecordedResiduals, Rows
from symphys.types import Array, Ints

MAX_ROUNDS = 20
"""Largest number of alternations between fit and noise."""
MIN_NOISE_CHANGE = 1e-3
"""Relative change of the noise below which it has converged."""
EARLY_TOLERANCE = 0.1
"""Standard errors that may remain in a fit to a first share of the time, which starts another fit."""
COARSE_TOLERANCE = 1e-2
"""Standard errors that may remain in a fit while the noise still changes."""

Monitor = Callable[[FitStep, FitState], None]


@dataclass(frozen=True, eq=False)
class FittedRecordings:
    """A fit together with its noise.

    Attributes:
        problem: residuals divided by the noise, as given or estimated.
        outcome: where the fit ended.
        evaluated: the Jacobian there, of the recordings that were fitted to.
        uncertainty: there; None where the fit ended without finite residuals.
    """

    problem: RecordedResiduals
    outcome: FitOutcome
    evaluated: Rows
    uncertainty: Uncertainty | None


def fit(
    problem: RecordedResiduals,
    options: FitOptions,
    which: Ints | None = None,
    start: FitState | None = None,
    monitor: Monitor | None = None,
    stop: Callable[[], bool] | None = None,
) -> FittedRecordings:
    """Fit the recordings in ``which``, those not held back by default, and estimate noise that is not given.

    Shared numbers without an effect at their guess begin elsewhere, where that is better. Each share in
    ``options.horizons`` of the recordings is the start of the next. ``start`` goes on from an interrupted
    fit.
    """
    which = np.flatnonzero(~problem.held_back) if which is None else which
    early = replace(options, tolerance=max(EARLY_TOLERANCE, options.tolerance))
    for share in options.horizons:
        if start is not None and start.horizon > share:
            continue
        last = share == options.horizons[-1]
        part = problem if share == 1 else PartialRecordings(problem, first_share(share))
        if start is not None and start.horizon < share:
            start = replace(start, damping=math.nan, growth=2.0, quiet=0)
        start = replace(start or begin_with_effect(problem, options, which, stop), horizon=share)
        found = fit_part(part, options if last else early, which, start, monitor, stop)
        if last or found.uncertainty is None or found.outcome.status is FitStatus.INTERRUPTED:
            break
        start = found.outcome.state
    return found


def fit_part(
    problem: RecordedResiduals,
    options: FitOptions,
    which: Ints,
    start: FitState,
    monitor: Monitor | None,
    stop: Callable[[], bool] | None,
) -> FittedRecordings:
    """Fit one share of the recordings, alternating between fit and noise."""
    known = bool(problem.noise_known.all())
    if known:
        outcome = RecordingFit(problem, options, which).run(start, monitor, stop)
        return described(problem, outcome, which, options.loss)
    coarse = replace(options, tolerance=max(COARSE_TOLERANCE, options.tolerance))
    factors = np.array(start.noise) if start.noise else np.ones(len(problem.quantities))
    for _ in range(MAX_ROUNDS):
        scaled = RescaledResiduals(problem, factors)
        outcome = RecordingFit(scaled, coarse, which).run(start, monitor, stop)
        found = described(scaled, outcome, which, options.loss)
        if found.uncertainty is None or outcome.status is FitStatus.INTERRUPTED:
            return found
        start = replace(outcome.state, noise=tuple(map(float, factors)))
        change = noise_factors(scaled, found.evaluated, which, options.loss, found.uncertainty.information)
        if np.all(np.abs(change - 1) < MIN_NOISE_CHANGE):
            break
        factors = np.maximum(factors * change, MIN_NOISE_FACTOR)
        start = replace(start, damping=math.nan, growth=2.0, quiet=0, noise=tuple(map(float, factors)))
    scaled = RescaledResiduals(problem, factors)
    outcome = RecordingFit(scaled, options, which).run(start, monitor, stop)
    return described(scaled, outcome, which, options.loss)


def own_numbers(
    problem: RecordedResiduals, shared: Array, own: Array, which: Ints, options: FitOptions, early: bool
) -> Array:
    """Fit own numbers (K, o) to the recordings in ``which``; ``early``: only before their first impact.

    Shared numbers stay. A recording whose simulation is not finite there keeps its own numbers.
    """
    part = PartialRecordings(problem, before_impact) if early else problem
    finite = [bool(np.isfinite(r).all()) for r in part.residuals(shared, own, which)]
    some = which[np.array(finite, bool)]
    if not some.size or not own.shape[1]:
        return own
    return RecordingFit(part, options, some, hold_shared=True).run(begin(shared, own)).state.own


def described(problem: RecordedResiduals, outcome: FitOutcome, which: Ints, loss: RobustLoss) -> FittedRecordings:
    """Add the uncertainty at the end of a fit."""
    shared, own = outcome.state.shared, outcome.state.own
    evaluated = problem.jacobian(shared, own, which)
    if not outcome.system.finite:
        return FittedRecordings(problem, outcome, evaluated, None)
    found = uncertainty(problem, evaluated, shared, own, which, loss, bool(problem.noise_known.all()))
    return FittedRecordings(problem, outcome, evaluated, found)
