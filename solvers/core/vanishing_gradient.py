"""Vanishing gradients: plateaus, where no variable has any influence on what is missed, as where a ball misses another.

A long first step may end on one, with a merit that is even lower than at the start: the gradient there is exactly
zero, and no method that follows gradients comes back. So a candidate where the gradient (for least squares the
Jacobian) vanishes that did not before, while something is missed, counts as a bad step: it is refused and shortened
as a line search shortens. Two rollouts beside it distinguish a plateau from a minimum. After ``REFUSALS`` the point is
taken after all, as the plateau may be all there is. What is refused was evaluated, so it counts as work.
"""

from __future__ import annotations

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.point import Point
from symphys.types import Array

REFUSALS = 6
"""A step is shortened so often at most."""
SHORTER = 0.25
"""What is left of a descent step that is refused."""
VANISHED = 1e-12
"""Derivatives below this share of those before are none."""
SAME = 1e-12
"""Errors that differ by no more, relative to themselves, are the same."""
STEP = 1e-4
"""Length of the step to points beside, in x = z / scale."""
FLAT = (
    "nothing that may vary has any influence there on what is missed, as where friction holds a body (stages such as "
    "smoothing = [0.1, 0.01, 0] in [simulation] let go of it) or a ball passes another by: try another guess "
    "(`symphys show FILE` draws it), or more seeds with a larger `spread`"
)


def vanished(evaluator: CountingEvaluator, point: Point, derivatives: Array, before: Array) -> bool:
    """Whether a step ended on a plateau; derivatives: gradients (n,) or Jacobians (m, n) at and before ``point``."""
    if point.met or not point.errors.size:
        return False
    now, then = (float(np.linalg.norm(each * evaluator.scale)) for each in (derivatives, before))
    return now <= VANISHED * then and flat(evaluator, point.z)


def flat(evaluator: CountingEvaluator, z: Array) -> bool:
    """Whether something that is missed stays the same beside z; without errors, whether the merit does."""
    step = STEP * evaluator.scale * direction(z.size)
    step = np.where(evaluator.clip(z + 2 * step) == z + 2 * step, step, -step)
    near, far = (evaluator.value(evaluator.clip(z + length * step)) for length in (1, 2))
    if not (near.finite and far.finite):
        return False
    a, b = (point.errors if point.errors.size else np.array([point.merit]) for point in (near, far))
    asked = a > 1 if near.errors.size else np.array([True])
    return bool(np.any(asked & (np.abs(a - b) <= SAME * np.abs(a))))


def direction(n: int) -> Array:
    """A unit vector (n,), always the same, with no component that is special."""
    u = np.random.default_rng(0).standard_normal(n)
    return np.asarray(u / np.linalg.norm(u))
