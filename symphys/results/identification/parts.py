"""Parts of the record of an identification: estimates, open directions, residuals by quantity, predictions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class ParameterEstimate:
    """A shared number; nan is what is not known.

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
    """Numbers that the recordings do not determine.

    Attributes:
        names: of the shared numbers that take part.
        own_names: of own numbers that move along.
        text: what is open, in words.
        advice: which recording would determine it, in a sentence.
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
    """What the fit leaves of a measured quantity; nan is what is not known.

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
    """How far simulations are from some recordings, in one quantity.

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
        text: what that means, in a sentence.
    """

    merit: float
    found: float
    lower: bool
    values: Mapping[str, float]
    evaluations: int
    text: str
