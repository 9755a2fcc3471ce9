"""Vanishing gradients: plateaus, where no variable influences an unmet target, as where a ball misses another.

A long first step may end on one, with a merit that is even lower than at the start: the gradient there is exactly
zero, and no method that follows gradients comes back. So a candidate where the gradient (for least squares the
Jacobian) vanishes that did not before, while something is missed, counts as a bad step: it is refused and shortened
as a line search shortens. Two rollouts beside it distinguish a plateau from a minimum. After ``MAX_SHORTENINGS`` the
point is taken after all, since the plateau may be all there is. Refused points were evaluated and count as work.
"""

from __future__ import annotations

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
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
