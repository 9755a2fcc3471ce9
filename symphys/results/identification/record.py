"""identification.json and identification.npz of a run folder: one definition for writer and reader.

| file | holds |
|---|---|
| identification.json | estimates with intervals, open directions, residuals by quantity, predictions, how it ended |
| identification.npz | own numbers, correlations, iterations, draws of the bootstrap, every residual |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys import json_values as values
from symphys.records import dataclass
from symphys.results.text_files import ReportError, read_archive, read_table
from symphys.types import Array


@dataclass(frozen=True)
class ParameterEstimate:
    """The estimate of a shared number; nan where unknown.

    Attributes:
        name, unit: as reports show them.
        value: the estimate.
        error: its standard error; inf where the recordings do not determine it.
        lower, upper: of the 95 % interval from the Jacobian; nan at a bound.
        bootstrap_lower, bootstrap_upper: of the 95 % interval from the bootstrap over recordings.
        at_bound: "lower" or "upper" for the bound that holds it, else empty.
        guess: where the fit began.
        least, most: its bounds; -inf and inf are none.
        prior_mean, prior_deviation: of its prior; a deviation of inf is none.
    """

    name: str
    unit: str
    value: float
    error: float
    lower: float
    upper: float
    bootstrap_lower: float
    bootstrap_upper: float
    at_bound: str
    guess: float
    least: float
    most: float
    prior_mean: float
    prior_deviation: float


@dataclass(frozen=True)
class OpenDirection:
    """A direction of numbers that the recordings do not determine.

    Attributes:
        names: of the shared numbers that take part.
        own_names: of own numbers that move along.
        text: description of the direction.
        advice: the recording that would determine it, in a sentence.
        error: standard error of the least determined direction, in units of the numbers; inf: no information.
        by_prior: whether a prior determines it.
    """

    names: tuple[str, ...]
    own_names: tuple[str, ...]
    text: str
    advice: str
    error: float
    by_prior: bool


@dataclass(frozen=True)
class QuantityResiduals:
    """The residuals of a measured quantity after the fit; nan where unknown.

    Attributes:
        name, unit: of the quantity.
        count: of residuals.
        noise: [unit] root mean square of the standard deviations by which they were divided.
        noise_known: whether the noise was given; else it is estimated.
        rms: [unit] root mean square.
        ratio: root mean square of residuals by noise: 1 where the noise explains them.
        mean: by noise.
        autocorrelation: from one sample to the next, of the same component.
        ljung_box: probability that white noise is correlated as much over ``lags`` samples.
        lags: of that test.
        by_time, by_impact, by_recording: share of the squares that means over the time, the time since an impact, or
            recording by recording explain, adjusted for their number.
        verdict: "noise", "missing effect" or "too few".
        text: why, in words.
    """

    name: str
    unit: str
    count: int
    noise: float
    noise_known: bool
    rms: float
    ratio: float
    mean: float
    autocorrelation: float
    ljung_box: float
    lags: int
    by_time: float
    by_impact: float
    by_recording: float
    verdict: str
    text: str


@dataclass(frozen=True)
class PredictionErrors:
    """The errors of simulations against some recordings, in one quantity.

    Attributes:
        name, unit: of the quantity.
        recordings: how many.
        mean, deviation: [unit] of the recordings' mean errors; an error is the length of the difference at a sample.
        rmse: [unit] root mean square of the errors at all samples.
        ratio: root mean square of the differences by noise.
    """

    name: str
    unit: str
    recordings: int
    mean: float
    deviation: float
    rmse: float
    ratio: float


@dataclass(frozen=True)
class GlobalSearch:
    """A search of the shared numbers by an evolution strategy, as a check against local minima.

    Attributes:
        merit, found: of the fit, and the lowest that the search came to.
        lower: whether that is lower by more than one standard error makes.
        values: (s,) where, by name.
        evaluations: of all recordings.
        text: the interpretation, in a sentence.
    """

    merit: float
    found: float
    lower: bool
    values: Mapping[str, float]
    evaluations: int
    text: str


IDENTIFICATION, ARRAYS = "identification.json", "identification.npz"
FORMAT = 1
HISTORY = ("iteration", "merit", "left", "damping", "step", "simulations", "jacobians", "seconds")
"""Columns of the iterations: ``left`` are standard errors to the minimum of the quadratic model."""
ARRAY = {"array": True}
"""Metadata of fields in the archive."""


@dataclass(frozen=True, eq=False)
class Identification:
    """The estimates from K recordings: s shared numbers, and o own numbers of each recording.

    Attributes:
        problem, title: names.
        status, reason: how the fit ended, and what that means.
        merit: sum of the losses of all residuals, and of the priors.
        residual_count, freedom: residuals that were fitted to, and those less the numbers that were estimated.
        threshold: of Huber's loss, in units of the noise; inf: least squares.
        parameters: the shared numbers.
        own_names: of the own numbers.
        open: directions that the recordings do not determine.
        quantities: residuals of each measured quantity, in the fitted recordings.
        fitted_errors, held_back_errors: how far simulations are from the recordings that were fitted to, and from those
            that were held back.
        recordings: (K,) names.
        search: the check against local minima, where there was one.
        starts: numbers without an effect at their guess, and where the fit began instead, a sentence each.
        bootstrap_note: why there is no bootstrap; else how its steps compare with fits in full.
        doubts: why not to rely on it, a sentence each.
        seconds: wall time by part: "fit", "uncertainty", "bootstrap", "study", "search".
        evaluations: "simulations" and "jacobians" of single recordings.
        held_back: (K,) 1 where a recording was held back, else 0.
        recording_ratio: (K,) root mean square of residuals by noise.
        own, own_error: (K, o) own numbers and their standard errors.
        own_at_bound: (K, o) -1 at the lower bound, 1 at the upper, else 0.
        correlation, covariance: (s, s) of the shared numbers; nan where not known.
        history: (i, 8) the iterations, with the columns of ``HISTORY``.
        draws: (b, s) of the bootstrap.
        residual, residual_recording, residual_quantity, residual_component, residual_time, residual_impact: (m,) every
            residual by noise, held back ones too; indices; [s] time, and time since the last impact.
    """

    problem: str
    title: str
    status: str
    reason: str
    merit: float
    residual_count: int
    freedom: int
    threshold: float
    parameters: tuple[ParameterEstimate, ...]
    own_names: tuple[str, ...]
    open: tuple[OpenDirection, ...]
    quantities: tuple[QuantityResiduals, ...]
    fitted_errors: tuple[PredictionErrors, ...]
    held_back_errors: tuple[PredictionErrors, ...]
    recordings: tuple[str, ...]
    search: GlobalSearch | None
    starts: tuple[str, ...]
    bootstrap_note: str
    doubts: tuple[str, ...]
    seconds: Mapping[str, float]
    evaluations: Mapping[str, float]
    held_back: Array = field(repr=False, metadata=ARRAY)
    recording_ratio: Array = field(repr=False, metadata=ARRAY)
    own: Array = field(repr=False, metadata=ARRAY)
    own_error: Array = field(repr=False, metadata=ARRAY)
    own_at_bound: Array = field(repr=False, metadata=ARRAY)
    correlation: Array = field(repr=False, metadata=ARRAY)
    covariance: Array = field(repr=False, metadata=ARRAY)
    history: Array = field(repr=False, metadata=ARRAY)
    draws: Array = field(repr=False, metadata=ARRAY)
    residual: Array = field(repr=False, metadata=ARRAY)
    residual_recording: Array = field(repr=False, metadata=ARRAY)
    residual_quantity: Array = field(repr=False, metadata=ARRAY)
    residual_component: Array = field(repr=False, metadata=ARRAY)
    residual_time: Array = field(repr=False, metadata=ARRAY)
    residual_impact: Array = field(repr=False, metadata=ARRAY)

    def __getitem__(self, name: str) -> ParameterEstimate:
        """Return the estimate of a shared number; KeyError lists the names."""
        found = {each.name: each for each in self.parameters}
        if name not in found:
            raise KeyError(f"no shared number {name}: there are {', '.join(found)}")
        return found[name]

    def own_numbers(self, recording: str) -> dict[str, tuple[float, float]]:
        """Return own numbers of a recording by name, each with its standard error; KeyError if unknown."""
        if recording not in self.recordings:
            raise KeyError(
                f"no recording {recording}: there are {len(self.recordings)}, the first {self.recordings[:1]}"
            )
        k = self.recordings.index(recording)
        pairs = zip(self.own_names, self.own[k], self.own_error[k], strict=True)
        return {name: (float(value), float(error)) for name, value, error in pairs}

    def worst(self, count: int = 5) -> tuple[tuple[str, float], ...]:
        """Return the recordings whose residuals are largest, and their root mean square by noise."""
        order = np.argsort(np.where(np.isnan(self.recording_ratio), -np.inf, -self.recording_ratio))
        known = [int(k) for k in order if not np.isnan(self.recording_ratio[k])]
        return tuple((self.recordings[k], float(self.recording_ratio[k])) for k in known[:count])

    def to_json(self) -> dict[str, Any]:
        """Return the object of identification.json, which has all but the arrays."""
        found = {each.name: getattr(self, each.name) for each in fields(self) if not is_array(each)}
        for name in ("parameters", "open", "quantities", "fitted_errors", "held_back_errors"):
            found[name] = [vars(each) for each in found[name]]
        found["search"] = None if self.search is None else vars(self.search)
        return {"format": FORMAT, **found}

    def write(self, folder: Path) -> None:
        """Write both files; the table last, since nothing counts without it."""
        files.write_npz(
            folder / ARRAYS, {each.name: getattr(self, each.name) for each in fields(self) if is_array(each)}
        )
        files.write_json(folder / IDENTIFICATION, self.to_json())


def is_array(each: Any) -> bool:
    """Whether a field is in the archive."""
    return bool(each.metadata.get("array"))


def read_identification(folder: Path) -> Identification:
    """Read the record in a folder.

    Raises:
        ReportError: a file is missing, or is none of this kind.
    """
    table = read_table(folder / IDENTIFICATION)
    if table.get("format") != FORMAT:
        known = values.name(table.get("format")) or "unknown"
        raise ReportError(f"{IDENTIFICATION}: format {known}, {FORMAT} is expected")
    plain = [each.name for each in fields(Identification) if not is_array(each)]
    if missing := [name for name in plain if name not in table]:
        raise ReportError(f"{IDENTIFICATION}: it lacks {', '.join(missing)}")
    names = [each.name for each in fields(Identification) if is_array(each)]
    arrays = read_archive(folder / ARRAYS, names)
    if missing := [name for name in names if name not in arrays]:
        raise ReportError(f"{ARRAYS}: it lacks {', '.join(missing)}")
    searched = table["search"]
    given: dict[str, Any] = {name: np.asarray(arrays[name], float) for name in names}
    given["search"] = values.record(GlobalSearch, searched, values.words) if isinstance(searched, dict) else None
    record = values.record(Identification, table, values.words, **given)
    if record.recording_ratio.shape != (len(record.recordings),) or record.own.shape[:1] != (len(record.recordings),):
        raise ReportError(f"{ARRAYS}: it is not of the recordings in {IDENTIFICATION}")
    return record
