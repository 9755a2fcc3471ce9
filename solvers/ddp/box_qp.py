"""Small quadratic programs within bounds."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from symphys.types import Array, Bools

MAX_ITERATIONS = 100
"""Largest number of projected Newton steps."""
ARMIJO_SHARE = 0.1
"""Least share of the decrease that the slope predicts."""
SHRINK = 0.6
"""Factor on a refused step."""
MIN_STEP_FACTOR = 1e-10
"""Least factor on a step."""
GRADIENT_TOLERANCE = 1e-10
"""Projected gradient, relative to the first one, that counts as zero."""


@cache
def lapack() -> Any:
    """Import and return LAPACK's functions, which problems with one decision a step do not need."""
    from scipy.linalg import lapack as functions

    return functions


class BoxSolution(NamedTuple):
    """A minimum: ``step`` (m,), which entries are ``free`` of bounds, and the Cholesky factor of the free block."""

    step: Array
    free: Bools
    factor: Array | None


def solve_box_qp(hessian: Array, gradient: Array, lower: Array, upper: Array, start: Array) -> BoxSolution | None:
    """Minimise step . hessian . step / 2 + gradient . step within bounds, by projected Newton steps.

    Args:
        hessian: (m, m), positive definite.
        gradient: (m,).
        lower: (m,), may be infinite.
        upper: (m,), likewise.
        start: (m,) where to begin.

    Returns:
        None where the Hessian of the free entries is not positive definite.

    Source: Tassa, Mansard, Todorov, Control-Limited Differential Dynamic Programming, ICRA 2014, section III.
    """
    whole = _within(hessian, gradient, lower, upper)
    if whole is not None:
        return whole
    x = np.clip(start, lower, upper)
    free, factor = np.zeros(len(x), np.bool_), None
    size = 1.0 + float(np.abs(gradient).max(initial=0.0))
    for _ in range(MAX_ITERATIONS):
        slope = gradient + hessian @ x
        # Free set: entries at no bound that the gradient pushes against.
        now = ~(((x <= lower) & (slope > 0)) | ((x >= upper) & (slope < 0)))
        if factor is None or not np.array_equal(now, free):
            free = now
            if not free.any():
                return BoxSolution(x, free, None)
            factor, failed = lapack().dpotrf(hessian[free][:, free], lower=1)
            if failed:
                return None
        if np.abs(slope[free]).max() <= GRADIENT_TOLERANCE * size:
            break
        # Newton step in the free entries, then an Armijo search along its projection.
        ahead = np.zeros(len(x))
        ahead[free] = -lapack().dpotrs(factor, slope[free], lower=1)[0]
        found = _projected(hessian, gradient, (lower, upper), x, slope, ahead)
        if found is None:
            break
        x = found
    return BoxSolution(x, free, factor)


def _within(hessian: Array, gradient: Array, lower: Array, upper: Array) -> BoxSolution | None:
    """Return the unconstrained minimum, where it exists and lies within the bounds."""
    factor, failed = lapack().dpotrf(hessian, lower=1)
    if failed:
        return None
    step = -lapack().dpotrs(factor, gradient, lower=1)[0]
    inside = np.all(step >= lower) and np.all(step <= upper)
    return BoxSolution(step, np.ones(len(step), np.bool_), factor) if inside else None


def _projected(
    hessian: Array, gradient: Array, bounds: tuple[Array, Array], x: Array, slope: Array, ahead: Array
) -> Array | None:
    """Return the first point along the projected step with enough decrease; None if there is none."""
    value, share = x @ (hessian @ x) / 2 + gradient @ x, 1.0
    while share > MIN_STEP_FACTOR:
        trial = np.clip(x + share * ahead, *bounds)
        gain = value - (trial @ (hessian @ trial) / 2 + gradient @ trial)
        if gain >= ARMIJO_SHARE * -(slope @ (trial - x)) and np.any(trial != x):
            return trial
        share *= SHRINK
    return None
