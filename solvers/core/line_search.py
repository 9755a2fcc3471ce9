"""Backtracking along a descent direction until the merit is low enough."""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.point import Point
from symphys.types import Array

ARMIJO_SHARE = 1e-4
"""Least share of the decrease predicted by the slope (Armijo)."""
MIN_SHRINK, MAX_SHRINK = 0.1, 0.5
"""Bounds of the factor on a rejected step, which quadratic interpolation gives."""
MAX_CANDIDATES = 30
"""Largest number of step lengths that are tried."""
RELATIVE_ROUNDING = 64 * float(np.finfo(float).eps)
"""Relative change of a merit that counts as rounding."""


@dataclass(frozen=True)
class LineSearchResult:
    """The end of a line search.

    Attributes:
        point: low enough; None if there was none.
        not_finite: the last candidate was not finite.
    """

    point: Point | None
    not_finite: bool = False


def backtrack(
    evaluator: CountingEvaluator, z: Array, step: Array, slope: float, merit: float, ceiling: float
) -> LineSearchResult:
    """Shorten ``step`` (n,) from z until merit(z + t step) <= ceiling + 1e-4 t slope.

    Args:
        evaluator: each candidate is one rollout.
        z: (n,) where the merit is ``merit``.
        step: (n,) to a point within the bounds.
        slope: d merit / dt at t = 0, negative.
        merit: at z.
        ceiling: the merit of z, or the largest of the last few.
    """
    t, candidate = 1.0, None
    for _ in range(MAX_CANDIDATES):
        candidate = evaluator.value(evaluator.clip(z + t * step))
        if candidate.finite and candidate.merit <= ceiling + ARMIJO_SHARE * t * slope:
            return LineSearchResult(candidate)
        t *= shrink(candidate, t, slope, merit)
    finite = candidate is not None and candidate.finite
    return LineSearchResult(None, not finite)


def shrink(candidate: Point, t: float, slope: float, merit: float) -> float:
    """Return the factor on t: the minimum of the parabola through the values so far, within bounds."""
    above = candidate.merit - merit - t * slope
    if not candidate.finite or above <= 0:
        return MIN_SHRINK if not candidate.finite else MAX_SHRINK
    return min(max(-t * slope / (2 * above), MIN_SHRINK), MAX_SHRINK)
