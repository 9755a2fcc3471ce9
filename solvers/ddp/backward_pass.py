"""The backward pass: from the last state to the first, the best change of every knot as a function of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from symphys.shooting import Expansion, Linearized
from symphys.solvers.ddp.box_qp import BoxSolution, solve_box_qp
from symphys.solvers.ddp.knots import KnotStep

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bounds:
    """Of z: how far each entry may go down and up from where it is, and the size of a typical change; (len(z),)."""

    down: Array
    up: Array
    scale: Array


@dataclass(frozen=True)
class KnotGain:
    """How the new knots of a step answer: ``ahead`` (w,), and ``back`` (w, n + o + s) of state, old knots, statics."""

    ahead: Array
    back: Array


@dataclass(frozen=True)
class Policy:
    """What a backward pass finds.

    Attributes:
        gains: one for each step; None for steps that decide nothing.
        statics: (s,) the change of the static entries of z.
        first, second: the fall of the objective that is expected of a step of length a: a first + a^2 second.
        gradient: (len(z),) of the augmented objective.
    """

    gains: Sequence[KnotGain | None]
    statics: Array
    first: float
    second: float
    gradient: Array


@dataclass
class _Value:
    """The cost to go: of (state, old knots, static entries), to second order."""

    slope: Array
    curve: Array


def backward_pass(
    slopes: Linearized,
    costs: Expansion,
    knots: Sequence[KnotStep],
    statics: NDArray[np.int64],
    bounds: Bounds,
    damping: float,
) -> Policy | None:
    """The policy about a motion; None where a Hessian is not positive definite.

    Args:
        slopes: of the steps.
        costs: of the augmented objective.
        knots: of the steps.
        statics: (s,) entries of z.
        bounds: of z.
        damping: of Levenberg and Marquardt: added to the Hessian by knots, in units of their scales.

    Source: Tassa, Erez, Todorov, Synthesis and stabilization of complex behaviors through online trajectory
    optimization, IROS 2012; bounds as Tassa, Mansard, Todorov, ICRA 2014.
    """
    n, s = slopes.a.shape[1], len(statics)
    curve = _joined(costs.xx[-1], costs.sx[-1], np.zeros((s, s)))
    value = _Value(np.concatenate([costs.x[-1], np.zeros(s)]), curve)
    gains: list[KnotGain | None] = [None] * len(knots)
    gradient, first, second = np.zeros(len(bounds.scale)), 0.0, 0.0
    adjoint = costs.x[-1].copy()
    by_static = costs.s.copy()
    for k in reversed(range(len(knots))):
        knot = knots[k]
        gradient[knot.acting] += knot.weights.T @ (costs.u[k] + slopes.b[k].T @ adjoint)
        by_static += slopes.c[k].T @ adjoint
        adjoint = costs.x[k] + slopes.a[k].T @ adjoint
        slope, curve = _before(slopes, costs, knot, value, k)
        if not len(knot.new):
            value = _Value(slope, curve)
            continue
        place = slice(n + len(knot.old), n + len(knot.old) + len(knot.new))
        found = _decide(slope, curve, place, bounds, knot.new, damping)
        if found is None:
            return None
        gains[k], value, falls = found
        first, second = first + falls[0], second + falls[1]
    gradient[statics] += by_static + slopes.start.T @ adjoint
    start = np.concatenate([slopes.start, np.eye(s)])
    slope, curve = start.T @ value.slope + costs.s, start.T @ value.curve @ start + costs.ss
    chosen = _static_step(slope, curve, bounds, statics, damping)
    if chosen is None:
        return None
    first, second = first + float(slope @ chosen), second + float(chosen @ curve @ chosen) / 2
    return Policy(gains, chosen, first, second, gradient)


def _joined(xx: Array, sx: Array, ss: Array) -> Array:
    return np.block([[xx, sx.T], [sx, ss]]) if len(ss) else xx


def _before(slopes: Linearized, costs: Expansion, knot: KnotStep, value: _Value, k: int) -> tuple[Array, Array]:
    """Slope and curvature of the cost to go from step k by (state, acting knots, static entries)."""
    a, b, c = slopes.a[k], slopes.b[k], slopes.c[k]
    n, acting, s = a.shape[1], len(knot.acting), c.shape[1]
    size, w = n + acting + s, knot.weights
    ahead = np.concatenate([a, b @ w, c], axis=1)
    if len(knot.kept) or s:
        through = np.zeros((len(value.slope), size))
        through[:n] = ahead
        through[n + np.arange(len(knot.kept)), n + knot.kept] = 1.0
        through[n + len(knot.kept) + np.arange(s), n + acting + np.arange(s)] = 1.0
    else:
        through = ahead
    slope = through.T @ value.slope
    curve = through.T @ (value.curve @ through)
    at_knots, at_statics = slice(n, n + acting), slice(n + acting, size)
    slope[:n] += costs.x[k]
    slope[at_knots] += w.T @ costs.u[k]
    curve[:n, :n] += costs.xx[k]
    cross = w.T @ costs.ux[k]
    curve[at_knots, :n] += cross
    curve[:n, at_knots] += cross.T
    curve[at_knots, at_knots] += w.T @ costs.uu[k] @ w
    if costs.uy[k].any():
        later = w.T @ (costs.uy[k] @ ahead)
        curve[at_knots] += later
        curve[:, at_knots] += later.T
    if s:
        curve[at_statics, :n] += costs.sx[k]
        curve[:n, at_statics] += costs.sx[k].T
        mixed = costs.su[k] @ w
        curve[at_statics, at_knots] += mixed
        curve[at_knots, at_statics] += mixed.T
    return slope, curve


def _decide(
    slope: Array, curve: Array, place: slice, bounds: Bounds, new: NDArray[np.int64], damping: float
) -> tuple[KnotGain, _Value, tuple[float, float]] | None:
    """The best new knots, the cost to go without them, and the expected fall."""
    rest = np.r_[0 : place.start, place.stop : len(slope)]
    hessian = curve[place, place]
    damped = hessian + np.diag(damping / bounds.scale[new] ** 2)
    found = solve_box_qp((damped + damped.T) / 2, slope[place], bounds.down[new], bounds.up[new], np.zeros(len(new)))
    if found is None:
        return None
    cross = curve[place][:, rest]
    ahead, back = found.step, _answers(found, cross)
    left_slope = slope[rest] + back.T @ (hessian @ ahead + slope[place]) + cross.T @ ahead
    left = curve[np.ix_(rest, rest)] + back.T @ hessian @ back + back.T @ cross + cross.T @ back
    value = _Value(left_slope, (left + left.T) / 2)
    return KnotGain(ahead, back), value, (float(slope[place] @ ahead), float(ahead @ hessian @ ahead) / 2)


def _answers(found: BoxSolution, cross: Array) -> Array:
    """(w, n + o + s): how the knots that are free answer to what comes."""
    back = np.zeros(cross.shape)
    if found.factor is not None:
        back[found.free] = -scipy.linalg.cho_solve(found.factor, cross[found.free], check_finite=False)
    return back


def _static_step(
    slope: Array, curve: Array, bounds: Bounds, statics: NDArray[np.int64], damping: float
) -> Array | None:
    """(s,) the best change of the static entries."""
    if not len(statics):
        return np.zeros(0)
    damped = (curve + curve.T) / 2 + np.diag(damping / bounds.scale[statics] ** 2)
    found = solve_box_qp(damped, slope, bounds.down[statics], bounds.up[statics], np.zeros(len(statics)))
    return None if found is None else found.step
