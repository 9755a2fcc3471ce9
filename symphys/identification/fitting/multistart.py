"""Check against local minima: CMA-ES over the shared numbers (Hansen 2016), then fits from its candidates.

A candidate is rated by the merit after a few steps of Levenberg-Marquardt of the own numbers, from those of the fit.
A search that comes to rest begins again elsewhere: anywhere between two bounds, otherwise farther and farther from the
fit. The best candidate, and the best of those that are far from it and from the fit, are starts of fits in full: a
valley beside the fit's is found even where the searches themselves return to the fit.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.identification.fitting.levenberg_marquardt import RecordingFit
from symphys.identification.fitting.state import FitOptions, FitOutcome, begin
from symphys.identification.interface import FitParameters, IdentificationError, RecordedResiduals
from symphys.records import dataclass
from symphys.results.identification.record import GlobalSearch
from symphys.types import Array, Ints

MIN_START_DISTANCE = 0.5
"""Distance, in scales, beyond which candidates are separate starts."""


@dataclass(frozen=True)
class SearchOptions:
    """Options of the check against local minima.

    Attributes:
        evaluations: candidates at most; each simulates every recording ``own_steps`` times, and its Jacobian.
        sigma: first standard deviation, in scales.
        own_steps: of the own numbers, of each candidate.
        restarts: searches from elsewhere, after the one from the fit.
        starts: fits in full, from the best candidates.
        seed: of the search.
    """

    evaluations: int = 200
    sigma: float = 1.0
    own_steps: int = 2
    restarts: int = 3
    starts: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        """Raise IdentificationError, which names the option and what would be valid."""
        if not self.sigma > 0:
            raise IdentificationError(f"sigma is {self.sigma}: it must be above 0")
        for name in ("evaluations", "own_steps", "starts"):
            if not getattr(self, name) >= 1:
                raise IdentificationError(f"{name} is {getattr(self, name)}: it must be at least 1")
        if not self.restarts >= 0:
            raise IdentificationError(f"restarts is {self.restarts}: it must be at least 0")


def search(
    problem: RecordedResiduals,
    fitted: FitOutcome,
    which: Ints,
    options: FitOptions,
    settings: SearchOptions,
    stop: Callable[[], bool] | None = None,
) -> tuple[GlobalSearch, FitOutcome]:
    """Search for a lower minimum; return the search, and the outcome with the lowest merit, which may be ``fitted``."""
    candidates = strategy(problem, fitted, which, options, settings, stop)
    best = fitted
    for shared in far_apart(candidates, fitted.state.shared, problem.shared.scale)[: settings.starts]:
        fit = RecordingFit(problem, options, which)
        found = fit.run(begin(shared, fitted.state.own), stop=stop)
        if found.merit < best.merit:
            best = found
    size = sum(len(problem.rows(int(k)).time) for k in which)
    lower = best.merit < fitted.merit * (1 - 1 / size)
    values = dict(zip(problem.shared.names, map(float, best.state.shared), strict=True))
    return GlobalSearch(fitted.merit, best.merit, lower, values, len(candidates), words(fitted, best, lower)), best


def words(fitted: FitOutcome, best: FitOutcome, lower: bool) -> str:
    """Describe the result of the search."""
    if not lower:
        return "CMA-ES, and fits from what it found, came to nothing lower than the fit"
    share = fitted.merit / best.merit if best.merit > 0 else math.inf
    return f"CMA-ES found a minimum whose merit is lower by a factor of {share:.3g}: the fit was in a local one"


def strategy(
    problem: RecordedResiduals,
    fitted: FitOutcome,
    which: Ints,
    options: FitOptions,
    settings: SearchOptions,
    stop: Callable[[], bool] | None,
) -> list[tuple[float, Array]]:
    """Return (merit, shared (s,)) of each candidate whose simulations are finite."""
    import cma  # late: it takes a second to import

    parameters = problem.shared
    free = np.flatnonzero(parameters.lower < parameters.upper)
    stream = np.random.default_rng(settings.seed)
    at = (fitted.state.shared / parameters.scale)[free]
    size = sum(len(problem.rows(int(k)).time) for k in which)
    # One number more, without effect: pycma 4.5 cannot search in a single one.
    bounds = [[*sides(bound[free] / parameters.scale[free]), None] for bound in (parameters.lower, parameters.upper)]
    quiet = {"verbose": -9, "verb_log": 0, "verb_disp": 0, "signals_filename": "", "seed": math.nan}
    given: dict[str, Any] = {"bounds": bounds, "randn": lambda *shape: stream.standard_normal(shape), **quiet}
    found: list[tuple[float, Array]] = []
    evaluated = 0
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for restart in range(1 + settings.restarts):
            given["tolfun"] = max(min([fitted.merit, *(merit for merit, _ in found)]) / max(size, 1), 1e-11)
            begin_at = at if restart == 0 else elsewhere(parameters, at, free, settings.sigma * 2.0**restart, stream)
            evolution = cma.CMAEvolutionStrategy([*begin_at, 0.0], settings.sigma, given)
            while evaluated < settings.evaluations and not evolution.stop() and not (stop and stop()):
                asked = evolution.ask()
                merits = []
                for x in asked:
                    shared = fitted.state.shared.copy()
                    shared[free] = np.asarray(x)[:-1] * parameters.scale[free]
                    shared = np.clip(shared, parameters.lower, parameters.upper)
                    merit = rated(problem, shared, fitted.state.own, which, options, settings.own_steps)
                    merits.append(merit)
                    if math.isfinite(merit):
                        found.append((merit, shared))
                evaluated += len(asked)
                evolution.tell(asked, merits)
    return found


def elsewhere(parameters: FitParameters, at: Array, free: Ints, away: float, stream: np.random.Generator) -> Array:
    """Draw a start (n,) of the free numbers: between two bounds, else about ``at`` (n,) at the scale ``away``."""
    lower, upper = (bound[free] / parameters.scale[free] for bound in (parameters.lower, parameters.upper))
    bounded = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(bounded, lower, 0.0), np.where(bounded, upper, 1.0)
    drawn = low + stream.random(at.shape) * (high - low)
    return np.clip(np.where(bounded, drawn, at + away * stream.standard_normal(at.shape)), lower, upper)


def rated(problem: RecordedResiduals, shared: Array, own: Array, which: Ints, options: FitOptions, steps: int) -> float:
    """Return the merit after ``steps`` steps of the own numbers; inf where a simulation is not finite."""
    iterations = steps if own.shape[1] else 0
    fit = RecordingFit(problem, replace(options, iterations=iterations), which, hold_shared=True)
    return fit.run(begin(shared, own)).merit


def sides(bound: Array) -> list[float | None]:
    """Return one side of the bounds in pycma's form: None where there is none."""
    return [float(value) if math.isfinite(value) else None for value in bound]


def far_apart(candidates: list[tuple[float, Array]], start: Array, scale: Array) -> list[Array]:
    """Return the best candidate, then repeatedly the best that is far from the start and all earlier ones."""
    ordered = [shared for _, shared in sorted(candidates, key=lambda each: each[0])]
    chosen = ordered[:1]
    for shared in ordered[1:]:
        if all(np.linalg.norm((shared - other) / scale) > MIN_START_DISTANCE for other in (start, *chosen)):
            chosen.append(shared)
    return chosen
