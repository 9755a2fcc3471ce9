"""The backward pass: from the last state to the first, the best change of every knot as a function of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from symphys.shooting import Expansion, Linearized
from symphys.solvers.ddp.box_qp import solve_box_qp
from symphys.solvers.ddp.knots import KnotStep

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


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
    """The cost to go: of (state, old knots, static entries), to second order.

    Attributes:
        slope: less the costate, which is the slope by the state where nothing is decided any more.
        curve: without the costs of the state itself.
    """

    slope: Array
    curve: Array


def backward_pass(
    slopes: Linearized,
    costs: Expansion,
    knots: Sequence[KnotStep],
    statics: Indices,
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
    optimization, IROS 2012; bounds as Tassa, Mansard, Todorov, ICRA 2014. Theirs has one slope of the cost to go; here
    it is a costate and what decisions add to that.
    """
    n, s = slopes.a.shape[1], len(statics)
    costate, by_inputs, by_statics = _costates(slopes, costs)
    value = _Value(np.zeros(n + s), np.zeros((n + s, n + s)))
    gains: list[KnotGain | None] = [None] * len(knots)
    gradient, first, second = np.zeros(len(bounds.scale)), 0.0, 0.0
    for k in reversed(range(len(knots))):
        knot = knots[k]
        by_knots = knot.weights.T @ by_inputs[k]
        gradient[knot.acting] += by_knots
        value.slope[len(value.slope) - s :] += by_statics[k]
        slope, curve = _before(slopes, costs, knot, value, by_knots, k)
        count = len(knot.new)
        if not count:
            value = _Value(slope, curve)
            continue
        found = _decide(slope, curve, count, bounds, knot.new, damping)
        if found is None:
            return None
        gains[k], value, falls = found
        first, second = first + falls[0], second + falls[1]
    gradient[statics] += costs.s + by_statics.sum(axis=0) + slopes.start.T @ costate
    slope, curve = _at_start(slopes, costs, value, costate)
    chosen = _static_step(slope, curve, bounds, statics, damping)
    if chosen is None:
        return None
    first, second = first + float(slope @ chosen), second + float(chosen @ curve @ chosen) / 2
    return Policy(gains, chosen, first, second, gradient)


def _costates(slopes: Linearized, costs: Expansion) -> tuple[Array, Array, Array]:
    """The costate of the first state (n,), and the slopes by inputs (N, m) and static entries (N, s), step by step."""
    costate = costs.x.copy()
    for k in reversed(range(len(slopes.a))):
        costate[k] += costate[k + 1] @ slopes.a[k]
    later = costate[1:, None]
    by_inputs, by_statics = costs.u + (later @ slopes.b)[:, 0], (later @ slopes.c)[:, 0]
    return costate[0], by_inputs, by_statics


def _before(
    slopes: Linearized, costs: Expansion, knot: KnotStep, value: _Value, by_knots: Array, k: int
) -> tuple[Array, Array]:
    """Slope, less the costate, and curvature of the cost to go from step k, without the costs of its state.

    Columns are (state, old knots, static entries, new knots): what is decided comes last.
    """
    a, b, c, w = slopes.a[k], slopes.b[k], slopes.c[k], knot.weights
    n, o, s, acting = a.shape[1], len(knot.old), c.shape[1], w.shape[1]
    knots = np.concatenate([np.arange(n, n + o), np.arange(n + o + s, n + s + acting)])
    ahead = np.empty((n, n + s + acting))
    ahead[:, :n], ahead[:, knots], ahead[:, n + o : n + o + s] = a, b @ w, c
    through = ahead
    if len(knot.kept) or s:
        through = np.zeros((len(value.slope), ahead.shape[1]))
        through[:n] = ahead
        through[n + np.arange(len(knot.kept)), knots[knot.kept]] = 1.0
        through[n + len(knot.kept) + np.arange(s), n + o + np.arange(s)] = 1.0
    later = value.curve
    later[:n, :n] += costs.xx[k + 1]
    slope, curve = value.slope @ through, through.T @ (later @ through)
    slope[knots] += by_knots
    crossed = np.zeros((acting, len(curve)))
    crossed[:, :n] = w.T @ costs.ux[k]
    if costs.uy[k].any():
        crossed += (w.T @ costs.uy[k]) @ ahead
    crossed[:, knots] += w.T @ costs.uu[k] @ w / 2
    curve[knots] += crossed
    curve[:, knots] += crossed.T
    if s:
        crossed, statics = costs.sx[k + 1] @ ahead, slice(n + o, n + o + s)
        crossed[:, knots] += costs.su[k] @ w
        curve[statics] += crossed
        curve[:, statics] += crossed.T
    return slope, curve


def _at_start(slopes: Linearized, costs: Expansion, value: _Value, costate: Array) -> tuple[Array, Array]:
    """Slope and curvature by the static entries, of the whole motion."""
    start = np.concatenate([slopes.start, np.eye(slopes.start.shape[1])])
    crossed = costs.sx[0] @ slopes.start
    slope = value.slope @ start + slopes.start.T @ costate + costs.s
    own = slopes.start.T @ costs.xx[0] @ slopes.start + crossed + crossed.T + costs.ss
    return slope, start.T @ value.curve @ start + own


def _decide(
    slope: Array, curve: Array, count: int, bounds: Bounds, new: Indices, damping: float
) -> tuple[KnotGain, _Value, tuple[float, float]] | None:
    """The best new knots, the cost to go without them, and the expected fall."""
    rest = len(slope) - count
    hessian, cross = curve[rest:, rest:], curve[rest:, :rest]
    soft = damping / bounds.scale[new] ** 2
    damped = hessian.copy()
    np.fill_diagonal(damped, hessian.diagonal() + soft)
    found = solve_box_qp(damped, slope[rest:], bounds.down[new], bounds.up[new], np.zeros(count))
    if found is None:
        return None
    ahead, back = found.step, np.zeros(cross.shape)
    if found.factor is not None:
        back[found.free] = -lapack.dpotrs(found.factor, cross[found.free], lower=1)[0]
    along = hessian @ ahead
    left_slope = slope[:rest] + (along + slope[rest:]) @ back + ahead @ cross
    left = curve[:rest, :rest] + cross.T @ back - (back.T * soft) @ back
    value = _Value(left_slope, (left + left.T) / 2)
    return KnotGain(ahead, back), value, (float(slope[rest:] @ ahead), float(ahead @ along) / 2)


def _static_step(slope: Array, curve: Array, bounds: Bounds, statics: Indices, damping: float) -> Array | None:
    """(s,) the best change of the static entries."""
    if not len(statics):
        return np.zeros(0)
    damped = (curve + curve.T) / 2 + np.diag(damping / bounds.scale[statics] ** 2)
    found = solve_box_qp(damped, slope, bounds.down[statics], bounds.up[statics], np.zeros(len(statics)))
    return None if found is None else found.step
