"""The problem of identification: residuals of recordings as functions of shared and own numbers.

K recordings have s shared numbers together (friction, a mass) and o own numbers each (a start, a time offset). The
Jacobian of all residuals then is an arrow: a recording's residuals depend on the shared numbers and on its own alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Protocol

import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.types import Array, Bools, Ints

Rows = list[tuple[Array, Array, Array]]
"""For each recording (m,) residuals, (m, s) and (m, o) their derivatives by the shared and the own numbers."""


class IdentificationError(SymphysError):
    """Raised for recordings or options that allow no identification; names fault and valid values."""


@dataclass(frozen=True, eq=False)
class FitParameters:
    """Numbers to estimate: n shared ones, arrays (n,), or those of K recordings, arrays (K, n).

    Attributes:
        names: (n,) as reports show them.
        guess, lower, upper: where the fit starts, and between which bounds it stays; -inf and inf are none.
        scale: by how much each changes sensibly; above 0.
        prior_mean, prior_deviation: prior mean and standard deviation; inf: no prior.
        quantities: (n,) what each sets, ``cube.mass``; advice depends on the last word. Empty: the names.
        units: (n,) as reports show them; empty: none.
    """

    names: tuple[str, ...]
    guess: Array
    lower: Array
    upper: Array
    scale: Array
    prior_mean: Array
    prior_deviation: Array
    quantities: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise IdentificationError, which names the first number that cannot be fitted."""
        for each in ("lower", "upper", "scale", "prior_mean", "prior_deviation"):
            if getattr(self, each).shape != self.guess.shape:
                raise IdentificationError(f"{each} has the shape {getattr(self, each).shape}, not {self.guess.shape}")
        if self.guess.shape[-1:] != (len(self.names),):
            raise IdentificationError(f"{len(self.names)} names for numbers of the shape {self.guess.shape}")
        faults = (
            (~np.isfinite(self.guess), "the guess is not finite: give it a number"),
            (~(np.isfinite(self.scale) & (self.scale > 0)), "the scale must be a number above 0"),
            (~((self.lower <= self.guess) & (self.guess <= self.upper)), "the guess must lie between the bounds"),
            (~(self.prior_deviation > 0), "the standard deviation of the prior must be above 0"),
        )
        for bad, what in faults:
            if bad.any():
                raise IdentificationError(f"{self.names[int(np.argwhere(bad)[0][-1])]}: {what}")

    @property
    def sets(self) -> tuple[str, ...]:
        """Return (n,) the quantity that each number sets."""
        return self.quantities or self.names


def fit_parameters(
    names: Sequence[str],
    guess: object,
    lower: object = -np.inf,
    upper: object = np.inf,
    scale: object = None,
    prior_mean: object = 0.0,
    prior_deviation: object = np.inf,
    quantities: Sequence[str] = (),
    units: Sequence[str] = (),
) -> FitParameters:
    """Broadcast arguments to the guess, (n,) or (K, n); the default scale is |guess|, 1 for 0."""
    start = np.array(guess, float)
    sizes = np.where(start == 0, 1.0, np.abs(start)) if scale is None else scale

    def spread(value: object) -> Array:
        return np.array(np.broadcast_to(np.asarray(value, float), start.shape))

    return FitParameters(
        names=tuple(names),
        guess=start,
        lower=spread(lower),
        upper=spread(upper),
        scale=spread(sizes),
        prior_mean=spread(prior_mean),
        prior_deviation=spread(prior_deviation),
        quantities=tuple(quantities),
        units=tuple(units),
    )


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """The meaning of the m residuals of one recording.

    Attributes:
        quantity: (m,) index into the measured quantities of the problem.
        component: (m,) of the quantity, from 0.
        time: (m,) [s] from the start of the recording.
        noise: (m,) by what each residual was divided, in the unit of the quantity.
        impact: (m,) [s] time since the last impact before the sample; nan before the first, or where it is not known.
    """

    quantity: Ints
    component: Ints
    time: Array
    noise: Array
    impact: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Set unknown times since impacts to nan."""
        if not self.impact.size:
            object.__setattr__(self, "impact", np.full(self.time.shape, np.nan))


class RecordedResiduals(Protocol):
    """Residuals r = (simulated - measured) / noise of K recordings.

    Missing samples are left out, so residuals have no NaN. A simulation that is not finite gives inf in all of its
    residuals.
    """

    recordings: tuple[str, ...]
    """(K,) names."""
    held_back: Bools
    """(K,) not fitted to, but predicted."""
    shared: FitParameters
    """(s,)"""
    own: FitParameters
    """(K, o)"""
    quantities: tuple[str, ...]
    """The measured values, by name."""
    units: tuple[str, ...]
    """Of the quantities; empty texts where there is none."""
    noise_known: Bools
    """Of the quantities: False where ``noise`` is a guess, whose scale is estimated."""

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording; called often, so implementations cache it."""

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the residuals (m_k,) of each recording in ``which``; shared (s,), own (K, o)."""

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Residuals and derivatives of each recording in ``which``."""


class DerivedResiduals:
    """A problem derived from another one, with the same recordings, numbers and quantities."""

    def __init__(self, problem: RecordedResiduals) -> None:
        """Copy everything but the residuals from ``problem``."""
        self.problem = problem
        self.recordings, self.held_back = problem.recordings, problem.held_back
        self.shared, self.own = problem.shared, problem.own
        self.quantities, self.units, self.noise_known = problem.quantities, problem.units, problem.noise_known

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording."""
        return self.problem.rows(recording)

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the residuals (m_k,) of each recording in ``which``."""
        return self.problem.residuals(shared, own, which)

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Return residuals and derivatives of each recording in ``which``."""
        return self.problem.jacobian(shared, own, which)
