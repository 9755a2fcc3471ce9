"""Options, states and outcomes of a fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import field
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np

from symphys.identification.fitting.arrow import ArrowSystem
from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.interface import IdentificationError, RecordedResiduals
from symphys.records import dataclass
from symphys.solvers.core.levenberg_marquardt import Damped
from symphys.types import Array

NUMBERS: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("damping", "growth", "stiffest", "mark", "horizon"), float),
    **dict.fromkeys(("quiet", "first"), int),
}
"""Fields of a state that are one number."""


class FitStatus(Enum):
    """Termination status of a fit."""

    CONVERGED = "converged"
    STALLED = "stalled"
    BUDGET = "budget"
    NOT_FINITE = "not_finite"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class FitOptions:
    """Options of Levenberg-Marquardt.

    Attributes:
        iterations: steps at most, of each horizon and of each turn with the noise.
        damping: first lambda, as a share of the largest diagonal of the first blocks.
        tolerance: converged where so many standard errors are left.
        patience: stalled where the merit has fallen by less than a tenth of a standard error makes in so many steps;
            0 goes on regardless.
        threshold: of Huber's loss, in units of the noise; inf: least squares.
        horizons: shares of the recordings' time that are fitted one after the other, rising to 1. Where impacts make
            motions chaotic, (0.3, 0.5, 0.7, 0.85, 1) ends at minima that a fit of the whole does not reach.
        start_values: whether shared numbers without an effect at their guess are tried at other values first.
    """

    iterations: int = 100
    damping: float = 1e-3
    tolerance: float = 1e-4
    patience: int = 10
    threshold: float = math.inf
    horizons: tuple[float, ...] = (1.0,)
    start_values: bool = True

    def __post_init__(self) -> None:
        """Raise IdentificationError, which names the option and what would be valid."""
        for name in ("iterations", "tolerance", "patience"):
            if not getattr(self, name) >= 0:
                raise IdentificationError(f"{name} is {getattr(self, name)}: it must be at least 0")
        for name in ("damping", "threshold"):
            if not getattr(self, name) > 0:
                raise IdentificationError(f"{name} is {getattr(self, name)}: it must be above 0")
        rising = all(0 < a < b for a, b in pairwise((*self.horizons, math.inf)))
        if not rising or self.horizons[-1:] != (1.0,):
            raise IdentificationError(f"horizons are {self.horizons}: they must be above 0 and rise to 1")

    @property
    def loss(self) -> RobustLoss:
        """The loss."""
        return RobustLoss(self.threshold)


@dataclass(frozen=True)
class FitStep:
    """An iteration; number 0 is the start.

    Attributes:
        iteration: its number.
        merit: sum rho, with priors.
        left: standard errors between the point and where the Jacobian puts the minimum.
        damping: lambda.
        step: length, in scales.
        simulations, jacobians: of single recordings, so far.
        seconds: so far.
    """

    iteration: int
    merit: float
    left: float
    damping: float
    step: float
    simulations: int
    jacobians: int
    seconds: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FitState(Damped):
    """The state between two iterations, from which a fit resumes. Damping nan: the next iteration sets it.

    Attributes:
        shared, own: (s,) and (K, o).
        mark, quiet: the merit at the last progress, and iterations since.
        history: the iterations so far.
        noise: (q,) factors on the noise of each quantity under which the merit is computed; empty: none.
        horizon: share of the recordings that is fitted.
        first: the iteration at which lambda was last set anew.
        notes: on the start of the fit, a sentence each.
    """

    shared: Array
    own: Array
    mark: float = math.inf
    quiet: int = 0
    history: tuple[FitStep, ...] = ()
    noise: tuple[float, ...] = ()
    horizon: float = 0.0
    first: int = 0
    notes: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        """Return JSON-able lists and numbers, from which ``revive_state`` restores the state to the last bit."""
        found = {name: getattr(self, name) for name in NUMBERS}
        rows = [list(vars(row).values()) for row in self.history]
        return {
            "shared": self.shared.tolist(),
            "own": self.own.tolist(),
            **found,
            "history": rows,
            "noise": list(self.noise),
            "notes": list(self.notes),
        }


@dataclass(frozen=True, eq=False)
class FitOutcome:
    """The end of a fit.

    Attributes:
        status, reason: the cause of its end, and an explanation.
        state: there; ``fit`` goes on from it.
        system: the arrow there, of the recordings that were fitted.
        one_sided: (s,) at a kink, how far from the shared numbers the Jacobian of one side has its minimum; else empty.
    """

    status: FitStatus
    reason: str
    state: FitState
    system: ArrowSystem
    one_sided: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def merit(self) -> float:
        """The sum of rho, with priors."""
        return self.system.cost


def begin(shared: Array, own: Array) -> FitState:
    """Return the state before the first iteration, at shared (s,) and own (K, o) within the bounds."""
    return FitState(shared=shared, own=own, damping=math.nan, growth=2.0, stiffest=math.nan)


def revive_state(saved: Mapping[str, Any], problem: RecordedResiduals) -> FitState:
    """Read ``FitState.plain``; IdentificationError if it is damaged or of other parameters."""
    try:
        shared, own = np.array(saved["shared"], float), np.array(saved["own"], float).reshape(problem.own.guess.shape)
        numbers = {name: kind(saved[name]) for name, kind in NUMBERS.items()}
        history = tuple(FitStep(*row) for row in saved["history"])
        noise = tuple(map(float, saved["noise"]))
        notes = tuple(map(str, saved["notes"]))
        state = FitState(shared=shared, own=own, history=history, noise=noise, notes=notes, **numbers)
    except (KeyError, TypeError, ValueError) as error:
        raise IdentificationError(
            f"the saved fit is damaged or of other recordings ({error!r}): start afresh"
        ) from error
    if shared.shape != problem.shared.guess.shape:
        raise IdentificationError(
            f"the saved fit has {shared.size} shared numbers, the problem {len(problem.shared.names)}"
        )
    return state
