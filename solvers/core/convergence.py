"""Convergence tests of descents: stationary points, plateaus, values that are not finite, and stagnating merits.

On a plateau no variable influences an unmet target, as where a ball misses another. A long first step may end on one,
with a merit that is even lower than at the start: the gradient there is exactly zero, and no method that follows
gradients comes back. So a candidate where the gradient (for least squares the Jacobian) vanishes that did not before,
while something is missed, counts as a bad step: it is refused and shortened as a line search shortens. Two rollouts
distinguish a plateau from a minimum. After ``MAX_SHORTENINGS`` the point is taken after all, since the plateau may be
all there is. Refused points were evaluated and count as work.
"""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Status, StopReason
from symphys.solvers.core.point import Point
from symphys.types import Array

MAX_SHORTENINGS = 6
"""Largest number of times that a step is shortened."""
SHORTENING_FACTOR = 0.25
"""Factor on a refused descent step."""
VANISHED_RATIO = 1e-12
"""Ratio to the previous derivatives below which derivatives count as zero."""
ERROR_TOLERANCE = 1e-12
"""Relative difference up to which errors count as equal."""
PROBE_STEP = 1e-4
"""Length of the step to neighbouring points, in x = z / scale."""
PLATEAU_ADVICE = (
    "nothing that may vary has any influence there on what is missed, as where friction holds a body (stages such as "
    "smoothing = [0.1, 0.01, 0] in [simulation] let go of it) or a ball passes another by: try another guess "
    "(`symphys show FILE` draws it), or more seeds with a larger `spread`"
)


def ends_on_plateau(evaluator: CountingEvaluator, point: Point, derivatives: Array, before: Array) -> bool:
    """Whether a step ended on a plateau; derivatives: gradients (n,) or Jacobians (m, n) at and before ``point``."""
    if point.met or not point.errors.size:
        return False
    now, then = (float(np.linalg.norm(each * evaluator.scale)) for each in (derivatives, before))
    return now <= VANISHED_RATIO * then and is_plateau(evaluator, point.z)


def is_plateau(evaluator: CountingEvaluator, z: Array) -> bool:
    """Whether some unmet error is constant around z; without errors, whether the merit is."""
    step = PROBE_STEP * evaluator.scale * probe_direction(z.size)
    # Two points within the bounds at one and two steps.
    step = np.where(evaluator.clip(z + 2 * step) == z + 2 * step, step, -step)
    near, far = (evaluator.value(evaluator.clip(z + length * step)) for length in (1, 2))
    if not (near.finite and far.finite):
        return False
    a, b = (point.errors if point.errors.size else np.array([point.merit]) for point in (near, far))
    asked = a > 1 if near.errors.size else np.array([True])
    return bool(np.any(asked & (np.abs(a - b) <= ERROR_TOLERANCE * np.abs(a))))


def probe_direction(n: int) -> Array:
    """Return a fixed unit vector (n,) without a distinguished component."""
    u = np.random.default_rng(0).standard_normal(n)
    return np.asarray(u / np.linalg.norm(u))


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
