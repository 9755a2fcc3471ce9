"""The backward pass of a plan: every step has decisions of its own, and nothing else is decided.

It is ``symphys.solvers.ddp.backward_pass`` for this case, with a few products a step: at hundreds of plans a second
every microsecond counts.

Source: Tassa, Mansard, Todorov, Control-Limited Differential Dynamic Programming, ICRA 2014.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg.lapack
from numpy.typing import NDArray

from symphys.mpc.horizon_costs import QuadraticCosts
from symphys.solvers.ddp.box_qp import solve_box_qp

Array = NDArray[np.float64]


def riccati_pass(
    a: Array, b: Array, costs: QuadraticCosts, room: tuple[Array, Array], damping: Array
) -> tuple[Array, Array] | None:
    """Feedforward (N, w) and gains (N, w, n); None where a Hessian is not positive definite, or slopes not finite.

    Args:
        a: (N, n, n) the next state by the state.
        b: (N, n, w) the next state by the decisions.
        costs: about the motion.
        room: (N, w) each, how far decisions may go down and up.
        damping: (w,) added to the diagonal of the Hessian by decisions.
    """
    steps, n, width = b.shape
    through = np.concatenate([a, b], axis=2)
    curves = costs.curve[:-1]
    if costs.ahead is not None:
        curves = curves.copy()
        later = costs.ahead @ through
        curves[:, n:] += later
        curves[:, :, n:] += later.transpose(0, 2, 1)
    slope, curve = costs.slope[-1, :n], costs.curve[-1, :n, :n]
    ahead, back = np.empty((steps, width)), np.empty((steps, width, n))
    stiff = np.diag(damping)
    lower, upper = room
    for k in range(steps - 1, -1, -1):
        step = through[k]
        q = costs.slope[k] + slope @ step
        whole = curves[k] + step.T @ (curve @ step)
        inputs, cross = whole[n:, n:], whole[n:, :n]
        found = _decided(inputs + stiff, q[n:], cross, lower[k], upper[k])
        if found is None:
            return None
        first, gains = found
        ahead[k], back[k] = first, gains
        mixed = gains.T @ (inputs @ gains + cross)
        slope = q[:n] + (inputs @ first + q[n:]) @ gains + first @ cross
        curve = whole[:n, :n] + mixed + cross.T @ gains
        curve = 0.5 * (curve + curve.T)
    return (ahead, back) if np.isfinite(ahead).all() and np.isfinite(back).all() else None


def _decided(hessian: Array, slope: Array, cross: Array, lower: Array, upper: Array) -> tuple[Array, Array] | None:
    """The best decisions within bounds (w,), and how those that are free of the bounds answer the state (w, n)."""
    if len(slope) == 1:
        curvature = hessian[0, 0]
        if not curvature > 0:
            return None
        wanted = -slope[0] / curvature
        if lower[0] < wanted < upper[0]:
            return np.array([wanted]), cross / -curvature
        return np.array([min(max(wanted, lower[0]), upper[0])]), np.zeros_like(cross)
    factor, fault = scipy.linalg.lapack.dpotrf(hessian, lower=1, clean=0)
    if fault:
        return None
    both, _ = scipy.linalg.lapack.dpotrs(factor, np.column_stack([slope, cross]), lower=1)
    first = -both[:, 0]
    if (first >= lower).all() and (first <= upper).all():
        return first, -both[:, 1:]
    found = solve_box_qp(0.5 * (hessian + hessian.T), slope, lower, upper, np.clip(first, lower, upper))
    if found is None:
        return None
    gains = np.zeros_like(cross)
    if found.factor is not None:
        answer, _ = scipy.linalg.lapack.dpotrs(found.factor, cross[found.free], lower=1)
        gains[found.free] = -answer
    return found.step, gains
