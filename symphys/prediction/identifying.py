"""``symphys.identify``: what the recordings of a problem say about its variables."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from symphys import files
from symphys import identification as numbers
from symphys.errors import SymphysError
from symphys.identification import FitOptions, FitState, FitStep, IdentificationOptions, SearchOptions, revive_state
from symphys.prediction.replays import worst_replays
from symphys.prediction.residuals import RecordingResiduals, residuals_of
from symphys.problem import IdentifySettings, Problem
from symphys.problem.loading import Source, load
from symphys.results.identification import Identification
from symphys.results.identification.replays import write_replays
from symphys.suggest import hint
from symphys.threads import limited

STATE = "identification_state.json"
"""Of a folder: where an interrupted fit goes on."""
DAMPING = 1e-6
"""The first of the fit. Of 285 tosses of a cube 25 steps from it bring the merit to 0.055e6; from 1e-3 15 to 0.30e6."""
CHOICES = {"loss": ("squares", "huber"), "check": ("none", "cma")}
"""Settings that have one of some values."""
Monitor = Callable[[FitStep], None]


def identify(
    problem: Source,
    folder: Path | str | None = None,
    *,
    threads: int | None = None,
    monitor: Monitor | None = None,
    stop: Callable[[], bool] | None = None,
    **settings: Any,
) -> Identification:
    """Estimate a problem's variables from its recordings, and say what one may believe of the estimates.

    Args:
        problem: what ``load`` takes, with [[recording]] tables.
        folder: gets identification.json and identification.npz, and what an interrupted fit goes on from; None: none.
        threads: that share the simulations; None: one for each processor.
        monitor: is told of each iteration.
        stop: is asked after each iteration whether to stop there.
        settings: in place of those in [identify]: ``loss="huber"``, ``bootstrap=200``, ``check="cma"``,
            ``horizons=(0.3, 0.5, 0.7, 0.85, 1)``, ``held_back_starts="before impact"``.

    Returns:
        Estimates with intervals, what is not determined, what is left; see ``Identification``. Own numbers of
        recordings that are held back come from where ``held_back_starts`` says, with the shared numbers held.

    Raises:
        ProblemError: the problem file is wrong.
        SymphysError: there is nothing to identify, or a simulation is not finite at the guess.

    Example:
        >>> import symphys
        >>> found = symphys.identify("bounce_recorded")
        >>> round(found["bounce"].value, 2)
        0.75
    """
    loaded = load(problem)
    chosen = with_settings(loaded.identify, settings)
    place = None if folder is None else Path(folder)
    with limited():
        residuals = residuals_of(loaded, threads)
        key = state_key(loaded, chosen)
        start = None if place is None else saved_state(place, key, residuals)

        def told(step: FitStep, state: FitState) -> None:
            if place is not None:
                files.write_json(place / STATE, {"key": key, **state.plain()})
            if monitor is not None:
                monitor(step)

        if place is not None:
            files.make_folder(place)
        found = numbers.identify(residuals, options_of(chosen), start, told, stop, loaded.name, loaded.title)
    if place is not None:
        write_replays(place, *worst_replays(loaded, residuals, found))
        found.write(place)
        if found.status != numbers.FitStatus.INTERRUPTED.value:
            files.remove(place / STATE)
    return found


def with_settings(given: IdentifySettings, settings: dict[str, Any]) -> IdentifySettings:
    """Those of the file with others in their place; SymphysError names one that there is not, or has no such value."""
    for name in settings:
        if name not in vars(given):
            raise SymphysError(f"identify has no setting {name!r}; {hint(name, vars(given))}")
        if name in CHOICES and settings[name] not in CHOICES[name]:
            raise SymphysError(f"{name} is {settings[name]!r}: {hint(str(settings[name]), CHOICES[name])}")
    return replace(given, **settings)


def options_of(settings: IdentifySettings) -> IdentificationOptions:
    """What is computed."""
    threshold = settings.threshold if settings.loss == "huber" else math.inf
    search = SearchOptions(settings.check_evaluations, seed=settings.seed) if settings.check == "cma" else None
    horizons = tuple(map(float, settings.horizons))
    fit = FitOptions(settings.iterations, DAMPING, settings.tolerance, threshold=threshold, horizons=horizons)
    draws, starts, seed = settings.bootstrap, settings.held_back_starts, settings.seed
    return IdentificationOptions(fit, draws=draws, search=search, held_back_starts=starts, seed=seed)


def state_key(problem: Problem, settings: IdentifySettings) -> str:
    """The same for the same problem, recordings and settings."""
    return sha256(f"{problem.identity}\n{dict(problem.settings)}\n{settings}".encode()).hexdigest()


def saved_state(folder: Path, key: str, residuals: RecordingResiduals) -> FitState | None:
    """Where an interrupted fit of the same problem was; None: nowhere."""
    if not (folder / STATE).exists():
        return None
    saved = files.read_json(folder / STATE)
    return revive_state(saved, residuals) if isinstance(saved, dict) and saved.get("key") == key else None
