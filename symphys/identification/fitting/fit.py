"""The fit of all recordings: start values, growing horizons, and estimates of unknown noise between fits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.remaining import VAGUE_ERROR
from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, FitStep, begin
from symphys.identification.inference.uncertainty import Information, Uncertainty, uncertainty
from symphys.identification.interface import DerivedResiduals, FitParameters, RecordedResiduals, ResidualRows, Rows
from symphys.records import dataclass
from symphys.types import Array, Bools, Ints

GUESS_FACTORS = (0.01, 0.03, 0.1, 0.3, 0.5, 2.0, 4.0, 10.0)
"""Factors on a guess other than 0."""
RANGE_SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of the range between two bounds; of ten scales to both sides for a number at 0 with an open bound."""
TRIAL_STEPS = 4
"""Steps of all numbers from each value."""
MIN_GAIN = 4.0
"""Least decrease, in merits per residual, for another start: two standard errors."""


def begin_with_effect(
    problem: RecordedResiduals, options: FitOptions, which: Ints, stop: Callable[[], bool] | None = None
) -> FitState:
    """Return the guess, with other values of shared numbers without effect, which ``notes`` list.

    Friction so high that balls stick has no effect: the merit has no slope there, and a fit stays. Such a number is
    tried at several values, each the start of a few steps of all numbers; the fit begins at the best.
    """
    shared, own, notes = problem.shared.guess.copy(), problem.own.guess, list[str]()
    for j in without_effect(problem, options, which) if options.start_values else ():
        name, guess = problem.shared.names[j], float(shared[j])
        trials = {guess: tried(problem, options, which, shared)}
        for value in values_to_try(problem.shared, int(j)):
            if stop is None or not stop():
                there = shared.copy()
                there[j] = value
                trials[value] = tried(problem, options, which, there)
        best = min(trials, key=lambda value: trials[value])
        size = sum(len(problem.rows(int(k)).time) for k in which)
        text = f"{name} has no effect on what was measured at its guess, {guess:.4g}"
        if trials[guess] - trials[best] > MIN_GAIN * trials[best] / max(size, 1):
            shared[j] = best
            notes.append(f"{text}: the fit begins at {best:.4g}, the best of {len(trials)} values")
        else:
            others = f"none of {len(trials) - 1} values from {min(trials):.4g} to {max(trials):.4g} begins a better fit"
            notes.append(f"{text}, and {others}")
    return replace(begin(shared, own), notes=tuple(notes))


def without_effect(problem: RecordedResiduals, options: FitOptions, which: Ints) -> Ints:
    """Return shared numbers whose standard error at the guess is ``VAGUE_ERROR`` times their size."""
    parameters = problem.shared
    system = RecordingFit(problem, options, which).system(parameters.guess, problem.own.guess)
    if not system.finite:
        return np.zeros(0, np.int64)
    size = np.maximum(np.abs(parameters.guess) / parameters.scale, 1.0)
    squares = (system.reference - system.prior_block) * size**2
    return np.flatnonzero((squares < 1 / VAGUE_ERROR**2) & (parameters.lower < parameters.upper))


def values_to_try(parameters: FitParameters, j: int) -> list[float]:
    """Return other values of a number, rising: multiples of its guess, shares of the range between its bounds."""
    guess, lower, upper = (float(each[j]) for each in (parameters.guess, parameters.lower, parameters.upper))
    found = {guess * factor for factor in GUESS_FACTORS}
    if np.isfinite(lower) and np.isfinite(upper):
        found |= {lower + share * (upper - lower) for share in RANGE_SHARES}
    elif guess == 0:
        away = 10 * float(parameters.scale[j])
        found |= {sign * share * away for sign in (-1, 1) for share in RANGE_SHARES}
    return sorted(value for value in found if lower <= value <= upper and value != guess)


def tried(problem: RecordedResiduals, options: FitOptions, which: Ints, shared: Array) -> float:
    """Return the merit after a few steps from shared numbers (s,); inf where a simulation is not finite."""
    outcome = RecordingFit(problem, replace(options, iterations=TRIAL_STEPS), which).run(
        begin(shared, problem.own.guess)
    )
    return np.inf if outcome.status is FitStatus.NOT_FINITE and not outcome.system.finite else outcome.merit


MIN_NOISE_FACTOR = 1e-12
"""Least factor on the guess of a noise: residuals of exact recordings have none."""
MIN_DEGREES_OF_FREEDOM = 0.5
"""Least number of residuals less their leverage for an estimate."""
MAX_ITERATIONS, MIN_CHANGE = 50, 1e-4
"""Iterations of Huber's proposal 2 on the same residuals, at most, and the change at which they end."""


class RescaledResiduals(DerivedResiduals):
    """A problem whose residuals of each quantity are divided by an additional factor."""

    def __init__(self, problem: RecordedResiduals, factors: Array) -> None:
        """Multiply the noise of the problem by ``factors`` (q,) by quantity."""
        super().__init__(problem)
        self.factors = factors
        self._divisors: dict[int, Array] = {}

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording, with the estimated noise."""
        rows = self.problem.rows(recording)
        return replace(rows, noise=rows.noise * self.factors[rows.quantity])

    def _divisor(self, recording: int) -> Array:
        if recording not in self._divisors:
            self._divisors[recording] = self.factors[self.problem.rows(recording).quantity]
        return self._divisors[recording]

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the rescaled residuals."""
        found = self.problem.residuals(shared, own, which)
        return [r / self._divisor(int(k)) for k, r in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Return the rescaled residuals and derivatives."""
        found = []
        for k, (r, by_shared, by_own) in zip(which, self.problem.jacobian(shared, own, which), strict=True):
            divisor = self._divisor(int(k))
            found.append((r / divisor, by_shared / divisor[:, None], by_own / divisor[:, None]))
        return found


def noise_factors(
    problem: RecordedResiduals, evaluated: Rows, which: Ints, loss: RobustLoss, information: Information
) -> Array:
    """Estimate (q,) the factor on the noise of each quantity; 1 where it is given.

    sigma^2 = sum psi(r / sigma)^2 / (beta (m - h)), with m residuals of the quantity, h their leverage (how many
    numbers they determine), and beta the mean of psi^2 under normal noise (Huber's proposal 2). In least squares that
    is the unbiased variance.
    """
    # Leverages: diagonal of J (J'J)^-1 J' by shared and own numbers.
    count = len(problem.quantities)
    quantities, leverages = [], []
    for at, (k, (_, by_shared, by_own)) in enumerate(zip(which, evaluated, strict=True)):
        quantities.append(problem.rows(int(k)).quantity)
        own_rows = by_own * problem.own.scale[k] * information.free_own[at]
        ahead = by_shared * problem.shared.scale * information.free_shared + own_rows @ information.gain[at]
        alone = own_rows @ information.own.whitener[at]
        leverages.append(np.sum((ahead @ information.shared.whitener) ** 2, axis=1) + np.sum(alone**2, axis=1))
    r, quantity, leverage = (np.concatenate(each) for each in ([r for r, _, _ in evaluated], quantities, leverages))
    # Fixed-point iteration of Huber's proposal 2.
    factors = np.ones(count)
    for _ in range(MAX_ITERATIONS):
        scaled = r / factors[quantity]
        squares = np.bincount(quantity, loss.influence(scaled) ** 2, minlength=count)
        freedom = np.bincount(quantity, 1 - leverage * loss.inside(scaled), minlength=count)
        enough = (freedom > MIN_DEGREES_OF_FREEDOM) & ~problem.noise_known
        change = np.sqrt(squares / (loss.normal_square * np.where(enough, freedom, 1.0)))
        change = np.where(enough, np.maximum(change, MIN_NOISE_FACTOR), 1.0)
        factors = np.maximum(factors * change, MIN_NOISE_FACTOR)
        if np.all(np.abs(change - 1) < MIN_CHANGE):
            break
    return factors


Selection = Callable[[ResidualRows], Bools]
"""The m rows of a recording -> (m,) which of them count."""


def first_share(share: float) -> Selection:
    """Select what was measured in the first ``share`` of the time of a recording, above 0 and at most 1."""
    return lambda rows: rows.time <= share * rows.time.max(initial=0.0)


def before_impact(rows: ResidualRows) -> Bools:
    """Select what was measured before the first impact."""
    after = rows.time[~np.isnan(rows.impact)]
    return np.asarray(rows.time < after.min(initial=np.inf))


class PartialRecordings(DerivedResiduals):
    """A problem with some rows of each recording only.

    After an impact a motion depends on its start more and more steeply, and where it leads to other impacts the merit
    has a minimum for each. A fit of the first third of each recording has few of them. It is the start of a fit of the
    first half, and so on to the whole.
    """

    def __init__(self, problem: RecordedResiduals, selection: Selection) -> None:
        """Take the rows chosen by ``selection``, which is called once for each recording."""
        super().__init__(problem)
        self.selection = selection
        self._kept: dict[int, Bools] = {}

    def kept(self, recording: int) -> Bools:
        """Return (m,) which residuals of the problem are kept."""
        if recording not in self._kept:
            self._kept[recording] = self.selection(self.problem.rows(recording))
        return self._kept[recording]

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals that are kept."""
        rows, kept = self.problem.rows(recording), self.kept(recording)
        columns = ("quantity", "component", "time", "noise", "impact")
        return replace(rows, **{name: getattr(rows, name)[kept] for name in columns})

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the residuals that are kept."""
        found = self.problem.residuals(shared, own, which)
        return [r[self.kept(int(k))] for k, r in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Return the residuals that are kept, and their derivatives."""
        found = []
        for k, parts in zip(which, self.problem.jacobian(shared, own, which), strict=True):
            r, by_shared, by_own = (part[self.kept(int(k))] for part in parts)
            found.append((r, by_shared, by_own))
        return found


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
