"""Convergence tests of descents: stationary points, values that are not finite, and merits that stagnate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.solvers.core.vanishing_gradient import PLATEAU_ADVICE, PROBE_STEP, is_plateau, probe_direction
from symphys.types import Array

MIN_RELATIVE_DECREASE = 1e-5
"""A decrease of the merit by this share of itself is progress."""
SLOPE_TOLERANCE = 1e-3
"""A slope below it, relative to 1 + |merit|, counts as zero: differences of kinked merits are no better."""
INCONSISTENT_GRADIENT = (
    "the gradient vanishes, but the merit does not level out: the gradient is wrong there (`symphys check` compares it "
    "with differences), or the point is at a kink (smoothing above 0 rounds it)"
)
UNMET_STATIONARY = (
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
    """Counts iterations without progress, since a descent may creep at the kinks of contact problems.

    Attributes:
        mark: the merit at the last progress.
        quiet: iterations since.
    """

    mark: float
    quiet: int = 0

    def after(self, merit: float, worth: float = MIN_RELATIVE_DECREASE) -> Progress:
        """Return the progress after an iteration that ended at ``merit``; a fall by the share ``worth`` counts."""
        if merit < self.mark - worth * abs(self.mark):
            return Progress(merit)
        return Progress(self.mark, self.quiet + 1)


def stationary(evaluator: CountingEvaluator, z: Array, merit: float) -> StopReason:
    """Check a vanishing gradient at z: two rollouts show whether the merit levels out there.

    CONVERGED, or STALLED where the merit still has a slope along a fixed direction.
    """
    step = PROBE_STEP * evaluator.scale * probe_direction(z.size)
    step[(evaluator.clip(z + step) != z + step) | (evaluator.clip(z - step) != z - step)] = 0
    ahead, behind = evaluator.value(z + step), evaluator.value(z - step)
    slope = abs(ahead.merit - behind.merit) / (2 * PROBE_STEP)
    return (
        StopReason(Status.STALLED, INCONSISTENT_GRADIENT)
        if slope > SLOPE_TOLERANCE * (1 + abs(merit))
        else converged(evaluator)
    )


def converged(evaluator: CountingEvaluator) -> StopReason:
    """Return the reason for a stationary point, with advice on unmet targets or a plateau."""
    best = evaluator.incumbent.best
    if best is None or best.met:
        return StopReason(Status.CONVERGED)
    if is_plateau(evaluator, best.z):
        return StopReason(Status.CONVERGED, PLATEAU_ADVICE)
    return StopReason(Status.CONVERGED, UNMET_STATIONARY if best.errors.size else "")


def not_finite(point: Point, advice: str = START_NOT_FINITE) -> StopReason:
    """Return ``advice`` where the point's values are not finite, else that its derivatives are not."""
    values = np.isfinite([point.merit, point.objective, *point.errors])
    return StopReason(Status.NOT_FINITE, GRADIENT_NOT_FINITE if np.all(values) else advice)
