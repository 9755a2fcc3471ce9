"""From recorded residuals to an Identification: fit, uncertainty, bootstrap, residual analysis, doubts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace

import numpy as np

from symphys.identification.fitting.fit import FittedRecordings, Monitor, fit, own_numbers
from symphys.identification.fitting.multistart import SearchOptions, search
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, begin
from symphys.identification.inference.bootstrap import Bootstrap, bootstrap, no_bootstrap, refitted
from symphys.identification.inference.identifiability import open_directions
from symphys.identification.inference.residual_study import (
    ResidualSamples,
    prediction_errors,
    recording_errors,
    samples,
    study,
    timed,
)
from symphys.identification.inference.uncertainty import Uncertainty
from symphys.identification.interface import IdentificationError, RecordedResiduals
from symphys.records import dataclass
from symphys.results.identification import HISTORY, GlobalSearch, Identification, ParameterEstimate, QuantityResiduals
from symphys.suggest import hint
from symphys.types import Array, Ints

STARTS = ("guess", "before impact", "whole")
"""Sources of the own numbers of recordings that are held back."""


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of an identification.

    Attributes:
        fit: of Levenberg-Marquardt and the loss.
        draws: of the bootstrap; 0: none.
        refits: draws of it that are fitted in full, to check the steps.
        search: the check against local minima; None: none.
        held_back_starts: own numbers of recordings held back: "guess" keeps them, "before impact" fits them to what was
            measured before the first impact, "whole" to all of the recording, shared numbers held.
        seed: of the bootstrap.
    """

    fit: FitOptions = field(default_factory=FitOptions)
    draws: int = 2000
    refits: int = 0
    search: SearchOptions | None = None
    held_back_starts: str = "guess"
    seed: int = 0

    def __post_init__(self) -> None:
        """Raise IdentificationError, which names the option and what would be valid."""
        if self.held_back_starts not in STARTS:
            raise IdentificationError(
                f"held_back_starts is {self.held_back_starts!r}: {hint(self.held_back_starts, STARTS)}"
            )


class Clock:
    """Wall time by part."""

    def __init__(self) -> None:
        """Begin with no time counted."""
        self.seconds: dict[str, float] = {}

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Add the time of the block to a part."""
        began = time.perf_counter()
        yield
        self.seconds[part] = self.seconds.get(part, 0.0) + time.perf_counter() - began


def identify(
    problem: RecordedResiduals,
    options: IdentificationOptions | None = None,
    start: FitState | None = None,
    monitor: Monitor | None = None,
    stop: Callable[[], bool] | None = None,
    name: str = "",
    title: str = "",
) -> Identification:
    """Identify the numbers of a problem from its recordings.

    ``start`` goes on from an interrupted fit; ``stop`` and ``monitor`` are called after each iteration.

    Raises:
        IdentificationError: nothing to fit to, or a simulation that is not finite at the guess, by name.
    """
    options, clock = options or IdentificationOptions(), Clock()
    which = np.flatnonzero(~problem.held_back)
    with clock.of("fit"):
        fitted = fit(problem, options.fit, which, start, monitor, stop)
    if fitted.uncertainty is None:
        raise IdentificationError(fitted.outcome.reason)
    searched: GlobalSearch | None = None
    if options.search is not None:
        with clock.of("search"):
            searched, best = search(fitted.problem, fitted.outcome, which, options.fit, options.search, stop)
            if best is not fitted.outcome:
                again = replace(begin(best.state.shared, best.state.own), horizon=1.0, notes=fitted.outcome.state.notes)
                fitted = fit(problem, options.fit, which, again, monitor, stop)
    return assessed(problem, fitted, which, options, clock, searched, stop, name, title)


def assessed(
    source: RecordedResiduals,
    fitted: FittedRecordings,
    which: Ints,
    options: IdentificationOptions,
    clock: Clock,
    searched: GlobalSearch | None = None,
    stop: Callable[[], bool] | None = None,
    name: str = "",
    title: str = "",
) -> Identification:
    """Return the record of a fit of the recordings in ``which``; ``source`` is the problem with its first noise."""
    problem, outcome, known = fitted.problem, fitted.outcome, fitted.uncertainty
    assert known is not None
    shared, own = outcome.state.shared, outcome.state.own
    others = np.setdiff1d(np.arange(len(own)), which)
    if options.held_back_starts != STARTS[0] and others.size:
        with clock.of("starts"):
            if options.held_back_starts == STARTS[1]:
                problem = timed(fitted.problem, source, shared, own)
            own = own_numbers(problem, shared, own, others, options.fit, options.held_back_starts == STARTS[1])
    with clock.of("uncertainty"):
        opened = open_directions(problem, fitted.evaluated, shared, own, which, options.fit.loss, known.information)
    with clock.of("bootstrap"):
        drawn = resampled(fitted, which, options, stop)
    with clock.of("study"):
        problem = timed(fitted.problem, source, shared, own)
        everything = samples(problem, shared, own, np.arange(len(problem.recordings)))
        back = np.isin(everything.recording, which, invert=True)
        of_fitted, of_held_back = everything.some(~back), everything.some(back)
        quantities = study(problem, of_fitted)
        errors = prediction_errors(problem, of_fitted), prediction_errors(problem, of_held_back)
    parameters = estimates(problem, outcome, known, drawn)
    last = outcome.state.history[-1]
    return Identification(
        problem=name,
        title=title,
        status=outcome.status.value,
        reason=outcome.reason,
        merit=outcome.merit,
        residual_count=of_fitted.residual.size,
        freedom=known.freedom,
        threshold=options.fit.threshold,
        parameters=parameters,
        own_names=problem.own.names,
        open=opened,
        quantities=quantities,
        fitted_errors=errors[0],
        held_back_errors=errors[1],
        recordings=problem.recordings,
        search=searched,
        starts=outcome.state.notes,
        bootstrap_note=drawn.note,
        doubts=doubts(outcome, parameters, quantities, drawn, known.freedom),
        seconds=clock.seconds,
        evaluations={"simulations": float(last.simulations), "jacobians": float(last.jacobians)},
        own=own,
        **arrays(fitted, known, which, everything, drawn),
    )


def arrays(
    fitted: FittedRecordings, known: Uncertainty, which: Ints, everything: ResidualSamples, drawn: Bootstrap
) -> dict[str, Array]:
    """Return the arrays of the record."""
    rows, recordings = everything.rows, np.arange(len(fitted.problem.recordings))
    history = [[getattr(row, column) for column in HISTORY] for row in fitted.outcome.state.history]
    return {
        "held_back": np.isin(recordings, which, invert=True).astype(float),
        "recording_ratio": recording_errors(fitted.problem, everything),
        "own_error": known.own_error,
        "own_at_bound": known.own_at_bound.astype(float),
        "correlation": known.correlation,
        "covariance": known.covariance,
        "history": np.array(history, float),
        "draws": drawn.draws,
        "residual": everything.residual,
        "residual_recording": everything.recording.astype(float),
        "residual_quantity": rows.quantity.astype(float),
        "residual_component": rows.component.astype(float),
        "residual_time": rows.time,
        "residual_impact": rows.impact,
    }


def resampled(
    fitted: FittedRecordings, which: Ints, options: IdentificationOptions, stop: Callable[[], bool] | None
) -> Bootstrap:
    """Return the bootstrap, with some draws fitted in full if requested."""
    problem, outcome, known = fitted.problem, fitted.outcome, fitted.uncertainty
    assert known is not None
    state = outcome.state
    if not options.draws:
        return no_bootstrap(len(state.shared), "not asked for")
    found = bootstrap(problem, state.shared, outcome.system, known.information, options.draws, options.seed)
    if found.draws.size and options.refits:
        draws = min(options.refits, options.draws)
        found = replace(
            found, refits=refitted(problem, options.fit, state, which, draws, options.seed, options.draws, stop)
        )
    return found


DOUBTED_RATIO = 1.5
"""Ratio of residuals to a given noise, or of both intervals, above which the Jacobian's are doubted."""
DOUBTED_DIFFERENCE = 0.5
"""Difference of a refitted draw from its step, in standard deviations, above which steps are doubted."""


def estimates(
    problem: RecordedResiduals, outcome: FitOutcome, known: Uncertainty, drawn: Bootstrap
) -> tuple[ParameterEstimate, ...]:
    """Return the shared numbers with both intervals; at a kink the Jacobian's interval reaches to that of its side."""
    parameters, shared = problem.shared, outcome.state.shared
    away = outcome.one_sided if outcome.one_sided.size else np.zeros(len(shared))
    interval = known.interval(shared) + np.stack([np.minimum(away, 0), np.maximum(away, 0)], axis=1)
    units = parameters.units or ("",) * len(parameters.names)
    return tuple(
        ParameterEstimate(
            name=name,
            unit=units[i],
            value=float(shared[i]),
            error=float(known.error[i]),
            lower=float(interval[i, 0]),
            upper=float(interval[i, 1]),
            bootstrap_lower=float(drawn.interval[i, 0]),
            bootstrap_upper=float(drawn.interval[i, 1]),
            at_bound={-1: "lower", 0: "", 1: "upper"}[int(known.at_bound[i])],
            guess=float(parameters.guess[i]),
            least=float(parameters.lower[i]),
            most=float(parameters.upper[i]),
            prior_mean=float(parameters.prior_mean[i]),
            prior_deviation=float(parameters.prior_deviation[i]),
        )
        for i, name in enumerate(parameters.names)
    )


def doubts(
    outcome: FitOutcome,
    parameters: Sequence[ParameterEstimate],
    quantities: Sequence[QuantityResiduals],
    drawn: Bootstrap,
    freedom: int,
) -> tuple[str, ...]:
    """Return a sentence for each reason not to rely on the estimates or on their intervals.

    ``freedom``: residuals less numbers that were estimated.
    """
    found = [] if outcome.status is FitStatus.CONVERGED else [f"the fit has not converged: {outcome.reason}"]
    found += [f"{each.name} is at its {each.at_bound} bound, {each.value:.6g}" for each in parameters if each.at_bound]
    if freedom < 1:
        found.append(f"numbers are {1 - freedom} too many for the residuals: nothing is left to judge the fit by")
    for quantity in quantities:
        if quantity.verdict == "missing effect":
            found.append(f"the model misses an effect on {quantity.name}: {quantity.text}")
        elif quantity.noise_known and quantity.ratio > DOUBTED_RATIO:
            found.append(f"residuals of {quantity.name} are {quantity.ratio:.2g} times the given noise")
    wider = [each.name for each in parameters if bootstrap_share(each) > DOUBTED_RATIO]
    if wider:
        found.append(
            "recordings differ by more than the noise explains: rely on the bootstrap's intervals, which are wider, of "
            + ", ".join(wider)
        )
    if drawn.refits.size:
        spread = drawn.draws.std(axis=0)
        away = np.abs(drawn.refits - drawn.draws[: len(drawn.refits)])
        worst = float(np.max(away / np.where(spread > 0, spread, np.inf)))
        if worst > DOUBTED_DIFFERENCE:
            found.append(
                f"draws of the bootstrap that were fitted in full differ from its steps by up to {worst:.2g} standard "
                "deviations: within the intervals the model is not linear"
            )
    return tuple(found)


def bootstrap_share(each: ParameterEstimate) -> float:
    """Return the ratio of the bootstrap's interval to the Jacobian's; nan where either is unknown."""
    width = each.upper - each.lower
    return (each.bootstrap_upper - each.bootstrap_lower) / width if width > 0 else np.nan
