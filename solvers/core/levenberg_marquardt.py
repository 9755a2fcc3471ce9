"""Levenberg-Marquardt within bounds: the damping rule, the active set, and the search for a step that lowers the merit.

About a point the merit has a quadratic model with the matrix H (J'J of residuals with the Jacobian J) and half the
gradient g. A step d solves (H + lambda I) d = -g over the variables that are free: those at a bound that the gradient
pushes against are held, and the step is projected into the bounds. The gain ratio, the decrease of the merit over that
of the model, decides whether a step is taken, and moves lambda (Nielsen 1999; Madsen, Nielsen, Tingleff 2004,
algorithm 3.16).

``descend`` is the search. How the linear system is solved is up to its model: by a dense factorisation for the solver
``least_squares``, by a Schur complement over recordings for identification.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum
from typing import Any, Generic, Protocol, Self, TypeVar

from symphys.records import dataclass
from symphys.types import Array, Bools

MIN_DAMPING_FACTOR = 1 / 3
"""Least factor on lambda, after a step whose decrease was as the model predicted."""
MIN_GAIN_RATIO = 1e-4
"""Least ratio of actual to predicted decrease with which a step is taken."""
MAX_RELATIVE_DAMPING = 1e20
"""Largest lambda over the largest diagonal entry of the first H; beyond it steps vanish."""

StepT = TypeVar("StepT")
EndT = TypeVar("EndT")
EndT_co = TypeVar("EndT_co", covariant=True)
DampedT = TypeVar("DampedT", bound="Damped")


@dataclass(frozen=True, kw_only=True, eq=False)
class Damped:
    """The damping of an iteration; states of a descent extend it.

    Attributes:
        damping: lambda.
        growth: the factor on lambda after a step that is refused.
        stiffest: a lambda beyond which the search for a step is given up.
    """

    damping: float
    growth: float
    stiffest: float

    def more_damped(self) -> Self:
        """Return the state with more damping, after a refused step."""
        return replace(self, damping=self.damping * self.growth, growth=2 * self.growth)

    def less_damped(self, gain: float) -> Self:
        """Return the state with the damping after a step with this gain ratio."""
        share = min(max(gain, 0.0), 1.0)
        return replace(self, damping=self.damping * max(MIN_DAMPING_FACTOR, 1 - (2 * share - 1) ** 3), growth=2.0)


def first_damping(share: float, largest: float) -> dict[str, Any]:
    """Return the fields of ``Damped`` at the start, from the largest diagonal entry of H there."""
    size = largest or 1.0
    return {"damping": share * size, "growth": 2.0, "stiffest": MAX_RELATIVE_DAMPING * size}


def movable(values: Array, lower: Array, upper: Array, gradient: Array) -> Bools:
    """Return False for variables at a bound that the gradient pushes against, and for those whose bounds are equal."""
    against = ((values <= lower) & (gradient > 0)) | ((values >= upper) & (gradient < 0))
    return ~against & (lower < upper)


@dataclass(frozen=True)
class Trial(Generic[StepT]):
    """An evaluated step.

    Attributes:
        step: within the bounds.
        merit: after it; not finite where the evaluation is not.
        expected: by how much the model lowers the merit.
    """

    step: StepT
    merit: float
    expected: float


class Refusal(Enum):
    """The consequence of a refused step: a trial with more damping, or again with the same."""

    STIFFER = 1
    AGAIN = 2


class LocalModel(Protocol[StepT, EndT_co]):
    """The model of the merit about a point, for one iteration.

    Attributes:
        merit: at the point.
    """

    merit: float

    def trial(self, damping: float) -> Trial[StepT] | EndT_co:
        """Solve the damped system, project the step into the bounds, and evaluate it; or end the iteration."""
        ...

    def judge(self, step: StepT, gain: float) -> EndT_co | Refusal:
        """Take a step with this gain ratio, or refuse it."""
        ...


def descend(model: LocalModel[StepT, EndT], state: DampedT) -> tuple[EndT | None, DampedT]:
    """Try steps from a point, with growing damping, until the model takes one or ends the iteration.

    Returns:
        What the model returned, None where lambda is beyond ``stiffest``; and the state with the damping of the next
        iteration.
    """
    while state.damping <= state.stiffest:
        trial = model.trial(state.damping)
        if not isinstance(trial, Trial):
            return trial, state
        modelled = trial.expected > 0 and math.isfinite(trial.merit)
        gain = (model.merit - trial.merit) / trial.expected if modelled else -math.inf
        found = model.judge(trial.step, gain)
        if not isinstance(found, Refusal):
            return found, state.less_damped(gain)
        if found is Refusal.STIFFER:
            state = state.more_damped()
    return None, state
