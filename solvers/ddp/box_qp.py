"""Small quadratic programs within bounds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDS = 100
ARMIJO = 0.1
SHRINK = 0.6
SMALLEST = 1e-10
FLAT = 1e-10
"""A projected gradient below it, relative to the first, is none."""


class BoxSolution(NamedTuple):
    """A minimum: ``step`` (m,), which entries are ``free`` of the bounds, and the Cholesky factor of these."""

    step: Array
    free: Mask
    factor: tuple[Array, bool] | None


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
    x = np.clip(start, lower, upper)
    free, factor = np.zeros(len(x), np.bool_), None
    size = 1.0 + float(np.abs(gradient).max(initial=0.0))
    for _ in range(ROUNDS):
        slope = gradient + hessian @ x
        now = ~(((x <= lower) & (slope > 0)) | ((x >= upper) & (slope < 0)))
        if factor is None or not np.array_equal(now, free):
            free = now
            if not free.any():
                return BoxSolution(x, free, None)
            try:
                factor = scipy.linalg.cho_factor(hessian[np.ix_(free, free)], lower=True, check_finite=False)
            except np.linalg.LinAlgError:
                return None
        if np.abs(slope[free]).max() <= FLAT * size:
            break
        ahead = np.zeros(len(x))
        ahead[free] = -scipy.linalg.cho_solve(factor, slope[free], check_finite=False)
        found = _projected(hessian, gradient, (lower, upper), x, slope, ahead)
        if found is None:
            break
        x = found
    return BoxSolution(x, free, factor)


def _projected(
    hessian: Array, gradient: Array, bounds: tuple[Array, Array], x: Array, slope: Array, ahead: Array
) -> Array | None:
    """The first point along the projected step that is enough lower; None where none is."""
    value, share = x @ (hessian @ x) / 2 + gradient @ x, 1.0
    while share > SMALLEST:
        trial = np.clip(x + share * ahead, *bounds)
        gain = value - (trial @ (hessian @ trial) / 2 + gradient @ trial)
        if gain >= ARMIJO * -(slope @ (trial - x)) and np.any(trial != x):
            return trial
        share *= SHRINK
    return None
