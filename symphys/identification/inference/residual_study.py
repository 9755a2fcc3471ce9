"""Residual analysis: whether residuals are noise, or show an effect that the model lacks.

Noise has no memory and no course. Of each quantity this measures the correlation from one sample to the next with the
test of Ljung and Box (1978), pooled over recordings and components, and the share of squares that means explain: over
the time of the recording, over the time since the last impact, and recording by recording. Shares are adjusted for the
number of means, so that noise has about 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.stats

from symphys.identification.interface import DerivedResiduals, RecordedResiduals, ResidualRows
from symphys.records import dataclass
from symphys.results.identification.record import PredictionErrors, QuantityResiduals
from symphys.types import Array, Bools, Ints

COLUMNS = ("quantity", "component", "time", "noise", "impact")
MAX_LAGS = 10
"""Largest lag of the test."""
MIN_RESIDUALS = 20
"""Least number of residuals for a verdict."""
TIME_BINS = 8
"""Number of means over a time."""
MAX_AUTOCORRELATION, MAX_PROBABILITY, MAX_EXPLAINED_SHARE = 0.2, 1e-3, 0.1
"""Bounds of a missing effect: correlation or explained share above, and its probability under noise below."""
COURSE_NAMES = {
    "by_time": "the time in the recording",
    "by_impact": "the time since the impact",
    "by_recording": "which recording it is",
}
MAX_NOISE_RATIO, MIN_NOISE_RATIO = 1.25, 0.8
"""Root mean squares by noise beyond which the given noise is called too small, or too large."""


@dataclass(frozen=True, eq=False)
class ResidualSamples:
    """Residuals of several recordings, one after the other, (m,) each.

    Attributes:
        residual: by noise.
        recording: index among all recordings.
        rows: their description.
    """

    residual: Array
    recording: Ints
    rows: ResidualRows

    def some(self, chosen: Bools) -> ResidualSamples:
        """Return the samples that are chosen (m,)."""
        parts = (getattr(self.rows, name)[chosen] for name in COLUMNS)
        return ResidualSamples(self.residual[chosen], self.recording[chosen], ResidualRows(*parts))

    def of(self, quantity: int) -> ResidualSamples:
        """Return the samples of one quantity."""
        return self.some(self.rows.quantity == quantity)


def samples(problem: RecordedResiduals, shared: Array, own: Array, which: Ints) -> ResidualSamples:
    """Return the residuals of the recordings in ``which``."""
    rows = [problem.rows(int(k)) for k in which]
    found = problem.residuals(shared, own, which)
    joined = [np.concatenate([np.zeros(0), *(getattr(each, name) for each in rows)]) for name in COLUMNS]
    joined[:2] = [each.astype(np.int64) for each in joined[:2]]
    return ResidualSamples(
        np.concatenate([np.zeros(0), *found]), np.repeat(which, [len(r) for r in found]), ResidualRows(*joined)
    )


def study(problem: RecordedResiduals, found: ResidualSamples) -> tuple[QuantityResiduals, ...]:
    """Study each quantity that has residuals."""
    entries = []
    for index, name in enumerate(problem.quantities):
        part = found.of(index)
        if part.residual.size:
            entries.append(quantity_residuals(name, problem.units[index], bool(problem.noise_known[index]), part))
    return tuple(entries)


def quantity_residuals(name: str, unit: str, known: bool, part: ResidualSamples) -> QuantityResiduals:
    """Study the residuals of one quantity."""
    r, rows = part.residual, part.rows
    correlation, probability, lags = ljung_box(series(part))
    since = ~np.isnan(rows.impact)
    groups = part.recording * (int(rows.component.max()) + 1) + rows.component
    shares = {
        "by_time": explained(r, binned(rows.time, rows.component)),
        "by_impact": explained(r[since], binned(rows.impact[since], rows.component[since])),
        "by_recording": explained(r, np.unique(groups, return_inverse=True)[1]),
    }
    measured = QuantityResiduals(
        name=name,
        unit=unit,
        count=r.size,
        noise=rms(rows.noise),
        noise_known=known,
        rms=rms(r * rows.noise),
        ratio=rms(r),
        mean=float(np.mean(r)),
        autocorrelation=correlation,
        ljung_box=probability,
        lags=lags,
        verdict="",
        text="",
        **{name: share for name, (share, _) in shares.items()},
    )
    return judged(
        measured,
        [name for name, (share, chance) in shares.items() if share > MAX_EXPLAINED_SHARE and chance < MAX_PROBABILITY],
    )


def judged(found: QuantityResiduals, courses: Sequence[str]) -> QuantityResiduals:
    """Add the verdict in words; ``courses``: the significant shares."""
    if found.count < MIN_RESIDUALS:
        return replace(found, verdict="too few", text=f"{found.count} residuals are too few for a verdict")
    reasons = [f"{getattr(found, name):.0%} depends on {COURSE_NAMES[name]}" for name in courses]
    if abs(found.autocorrelation) > MAX_AUTOCORRELATION and found.ljung_box < MAX_PROBABILITY:
        reasons.insert(0, f"one sample is like the next (correlation {found.autocorrelation:.2f})")
    missing = bool(reasons)
    if found.noise_known and found.ratio > MAX_NOISE_RATIO:
        reasons.append(f"it is {found.ratio:.2g} times the given noise")
    if found.noise_known and found.ratio < MIN_NOISE_RATIO:
        reasons.append(f"it is {found.ratio:.2g} of the given noise, which is too large")
    text = "; ".join(reasons) or "uncorrelated, without trend, and consistent with the noise level"
    return replace(found, verdict="missing effect" if missing else "noise", text=text)


def series(part: ResidualSamples) -> list[Array]:
    """Return the residuals of each recording and component over time."""
    order = np.lexsort((part.rows.time, part.rows.component, part.recording))
    ends = np.diff(part.recording[order]) | np.diff(part.rows.component[order])
    return np.split(part.residual[order], np.flatnonzero(ends) + 1)


def ljung_box(runs: Sequence[Array]) -> tuple[float, float, int]:
    """Return lag-1 correlation, probability under white noise, and lags, pooled over series of mean 0."""
    longest = max((len(run) for run in runs), default=0)
    lags = min(MAX_LAGS, longest // 4)
    power = sum(float(run @ run) for run in runs)
    count = sum(len(run) for run in runs)
    if lags < 1 or not power > 0:
        return np.nan, np.nan, 0
    # Autocorrelations pooled over the series, and the sum of their weighted squares.
    statistic, first = 0.0, np.nan
    for lag in range(1, lags + 1):
        pairs = [(run[:-lag], run[lag:]) for run in runs if len(run) > lag]
        number = sum(len(left) for left, _ in pairs)
        correlation = sum(float(left @ right) for left, right in pairs) / power * count / number
        first = correlation if lag == 1 else first
        statistic += number * correlation**2
    return first, float(scipy.stats.chi2.sf(statistic, lags)), lags


def binned(time: Array, component: Ints) -> Ints:
    """Return (m,) the group of each sample: one of ``TIME_BINS`` parts in order of time, by component."""
    if not time.size:
        return np.zeros(0, np.int64)
    edges = np.unique(np.quantile(time, np.linspace(0, 1, TIME_BINS + 1)[1:-1]))
    return np.asarray(np.searchsorted(edges, time, side="right") * (int(component.max()) + 1) + component)


def explained(r: Array, group: Ints) -> tuple[float, float]:
    """Return the share of the squares that group means explain, adjusted, and its probability under noise.

    The share is 0 at least, and nan where there are too few; the probability is that of the F test.
    """
    if r.size < MIN_RESIDUALS:
        return np.nan, np.nan
    _, index, sizes = np.unique(group, return_inverse=True, return_counts=True)
    count, freedom = len(sizes), r.size - len(sizes)
    power = float(r @ r)
    if freedom < count or not power > 0:
        return np.nan, np.nan
    means = np.bincount(index, r) / sizes
    left = max(power - float(sizes @ means**2), np.finfo(float).tiny)
    probability = float(scipy.stats.f.sf((power - left) / count / (left / freedom), count, freedom))
    return max(0.0, 1 - left / freedom * r.size / power), probability


def rms(values: Array) -> float:
    """Return the root mean square; nan without values."""
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def prediction_errors(problem: RecordedResiduals, found: ResidualSamples) -> tuple[PredictionErrors, ...]:
    """Compute the errors of simulations against the recordings, by quantity."""
    entries = []
    for index, (name, unit) in enumerate(zip(problem.quantities, problem.units, strict=True)):
        part = found.of(index)
        if not part.residual.size:
            continue
        instants = np.stack([part.recording.astype(float), part.rows.time], axis=1)
        which, index_of = np.unique(instants, axis=0, return_inverse=True)
        lengths = np.sqrt(np.bincount(index_of.ravel(), (part.residual * part.rows.noise) ** 2))
        recordings = np.unique(which[:, 0])
        means = np.array([lengths[which[:, 0] == k].mean() for k in recordings])
        finite = bool(np.isfinite(means).all())
        spread = (float(means.std(ddof=1)) if finite else np.inf) if len(means) > 1 else np.nan
        size = (float(means.mean()), spread, rms(lengths), rms(part.residual))
        entries.append(PredictionErrors(name, unit, len(recordings), *size))
    return tuple(entries)


def recording_errors(problem: RecordedResiduals, found: ResidualSamples) -> Array:
    """Return (K,) the root mean square of residuals by noise of each recording; nan without any."""
    count = len(problem.recordings)
    numbers = np.bincount(found.recording, minlength=count)
    squares = np.bincount(found.recording, found.residual**2, minlength=count)
    return np.sqrt(np.where(numbers > 0, squares / np.where(numbers > 0, numbers, 1), np.nan))


@runtime_checkable
class SimulatedImpacts(Protocol):
    """A problem of identification that also simulates the times of impacts."""

    def simulated_impacts(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the times (i,) [s] of impacts, rising, of each recording in ``which``."""


class TimedRecordings(DerivedResiduals):
    """A problem whose rows have the time since the last impact."""

    def __init__(self, problem: RecordedResiduals, impacts: Sequence[Array]) -> None:
        """Take the times of impacts (i,) [s] of each of the K recordings, rising."""
        super().__init__(problem)
        self.impacts = impacts

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording, with the time since the last impact."""
        rows, instants = self.problem.rows(recording), self.impacts[recording]
        count = np.searchsorted(instants, rows.time)
        last = np.concatenate([[np.nan], instants])[count]
        return replace(rows, impact=rows.time - last)


def timed(problem: RecordedResiduals, source: RecordedResiduals, shared: Array, own: Array) -> RecordedResiduals:
    """Return ``problem`` with the impacts that ``source`` simulates at shared (s,), own (K, o), if it does."""
    if not isinstance(source, SimulatedImpacts):
        return problem
    return TimedRecordings(problem, source.simulated_impacts(shared, own, np.arange(len(own))))
