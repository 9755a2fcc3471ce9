"""From recorded residuals to an Identification: fit, uncertainty, bootstrap, what is left, what is open."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from symphys.identification.fitting.fit import FittedRecordings, Monitor, fit, own_numbers
from symphys.identification.fitting.multistart import SearchOptions, search
from symphys.identification.fitting.state import FitOptions, FitState, begin
from symphys.identification.inference.assessment import doubts, estimates
from symphys.identification.inference.bootstrap import Bootstrap, bootstrap, no_bootstrap, refitted
from symphys.identification.inference.identifiability import open_directions
from symphys.identification.inference.impacts import timed
from symphys.identification.inference.residual_study import (
    ResidualSamples,
    prediction_errors,
    recording_errors,
    samples,
    study,
)
from symphys.identification.inference.uncertainty import Uncertainty
from symphys.identification.interface import IdentificationError, RecordedResiduals
from symphys.results.identification import HISTORY, GlobalSearch, Identification
from symphys.suggest import hint
from symphys.types import Array, Ints

STARTS = ("guess", "before impact", "whole")
"""Where own numbers of recordings that are held back come from."""


@dataclass(frozen=True)
class IdentificationOptions:
    """What is computed.

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
        """IdentificationError names the option and what would be valid."""
        if self.held_back_starts not in STARTS:
            raise IdentificationError(
                f"held_back_starts is {self.held_back_starts!r}: {hint(self.held_back_starts, STARTS)}"
            )


class Clock:
    """Wall time by part."""

    def __init__(self) -> None:
        """Nothing has taken time yet."""
        self.seconds: dict[str, float] = {}

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Count the block."""
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
    """All that the recordings say: see ``Identification``.

    ``start`` goes on from an interrupted fit; ``stop`` is asked after each iteration, ``monitor`` told of each.

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
    """The record of a fit of the recordings in ``which``; ``source`` is the problem with its first noise."""
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
    """Those of the record."""
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
    """The bootstrap, with some draws fitted in full where that is asked for."""
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
