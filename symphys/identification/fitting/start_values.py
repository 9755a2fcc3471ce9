"""Other start values of shared numbers that have no effect at their guess.

Friction so high that balls stick has no effect: the merit has no slope there, and a fit stays. Such a number is tried
at several values, each the start of a few steps of all numbers; the fit begins at the best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.remaining import VAGUE_ERROR
from symphys.identification.fitting.state import FitOptions, FitState, FitStatus, begin
from symphys.identification.interface import FitParameters, RecordedResiduals
from symphys.types import Array, Ints

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
    """Return the guess, with other values of shared numbers without effect, which ``notes`` list."""
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
