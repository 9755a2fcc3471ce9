"""Backtracking along a descent direction until the merit is low enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.point import Point
from symphys.types import Array

SLOPE_SHARE = 1e-4
"""Of the decrease that the slope promises, so much must come (Armijo)."""
SHORTEST, LONGEST = 0.1, 0.5
"""A rejected step is cut to a share within these, by quadratic interpolation."""
CANDIDATES = 30
ROUNDING = 64 * float(np.finfo(float).eps)
"""Relative change of a merit that is no more than rounding."""


@dataclass(frozen=True)
class LineSearchResult:
    """Where a line search ended.

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
    for _ in range(CANDIDATES):
        candidate = evaluator.value(evaluator.clip(z + t * step))
        if candidate.finite and candidate.merit <= ceiling + SLOPE_SHARE * t * slope:
            return LineSearchResult(candidate)
        t *= shrink(candidate, t, slope, merit)
    finite = candidate is not None and candidate.finite
    return LineSearchResult(None, not finite)


def shrink(candidate: Point, t: float, slope: float, merit: float) -> float:
    """The factor on t: to the lowest point of the parabola through the values so far, within limits."""
    above = candidate.merit - merit - t * slope
    if not candidate.finite or above <= 0:
        return SHORTEST if not candidate.finite else LONGEST
    return min(max(-t * slope / (2 * above), SHORTEST), LONGEST)
