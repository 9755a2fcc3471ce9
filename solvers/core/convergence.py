"""Where a descent ends: stationary points, points that are not finite, and merits that hardly fall any more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.core.vanishing_gradient import FLAT, STEP, direction, flat
from symphys.types import Array

WORTH = 1e-5
"""A fall of the merit by this share of itself is progress."""
SLACK = 1e-3
"""A slope below it, relative to 1 + |merit|, is none: differences of kinked merits are no better."""
TILTED = (
    "the gradient vanishes, but the merit does not level out: the gradient is wrong there (`symphys check` compares it "
    "with differences), or the point is at a kink (smoothing above 0 rounds it)"
)
MISSED = (
    "a stationary point where not everything is met: try another guess or seed, other weights, "
    "or stages such as smoothing = [0.1, 0.01, 0] in [simulation]"
)
START_NOT_FINITE = "the simulation of the start is not finite: look at the guess and at the formulas"
GRADIENT_NOT_FINITE = (
    "the cost is finite but its derivative is not: look for roots or norms of something that is zero in the formulas, "
    "or solve with smoothing above 0"
)


@dataclass(frozen=True)
class Progress:
    """Whether a descent still gets anywhere: at the kinks of contact problems it may creep for ever.

    Attributes:
        mark: the merit at the last progress.
        quiet: iterations since.
    """

    mark: float
    quiet: int = 0

    def after(self, merit: float, worth: float = WORTH) -> Progress:
        """With one iteration more, at ``merit``; a fall by the share ``worth`` is progress."""
        if merit < self.mark - worth * abs(self.mark):
            return Progress(merit)
        return Progress(self.mark, self.quiet + 1)


def stationary(evaluator: CountingEvaluator, z: Array, merit: float) -> StopReason:
    """Check a gradient that vanishes at z: two rollouts show whether the merit levels out there.

    CONVERGED, or STALLED where the merit still has a slope along a fixed direction.
    """
    step = STEP * evaluator.scale * direction(z.size)
    step[(evaluator.clip(z + step) != z + step) | (evaluator.clip(z - step) != z - step)] = 0
    ahead, behind = evaluator.value(z + step), evaluator.value(z - step)
    slope = abs(ahead.merit - behind.merit) / (2 * STEP)
    return StopReason(Status.STALLED, TILTED) if slope > SLACK * (1 + abs(merit)) else converged(evaluator)


def converged(evaluator: CountingEvaluator) -> StopReason:
    """A stationary point, with advice where the incumbent misses something or lies on a plateau."""
    best = evaluator.incumbent.best
    if best is None or best.met:
        return StopReason(Status.CONVERGED)
    if flat(evaluator, best.z):
        return StopReason(Status.CONVERGED, FLAT)
    return StopReason(Status.CONVERGED, MISSED if best.errors.size else "")


def not_finite(point: Point, advice: str = START_NOT_FINITE) -> StopReason:
    """``advice`` where the point's values are not finite, else that its derivatives are not."""
    values = np.isfinite([point.merit, point.objective, *point.errors])
    return StopReason(Status.NOT_FINITE, GRADIENT_NOT_FINITE if np.all(values) else advice)
