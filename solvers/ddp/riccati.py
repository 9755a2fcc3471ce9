"""The Riccati recursion: backwards over the steps, the optimal decisions within bounds as functions of the state.

A step leads from a state r to the state after it by r' = through @ (r, v), where v are its decisions, and costs
slope . (r, v) + (r, v) . curve . (r, v) / 2. What a state is, and how many numbers it and the decisions have, may
differ from run to run of steps. A run of small matrices is taken by compiled code, where there is any.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from symphys.shooting import CompiledRecursion
from symphys.solvers.ddp.box_qp import lapack, solve_box_qp
from symphys.types import Array


class LinearSteps(NamedTuple):
    """A run of K linearised steps about a motion; only the state after a run of one may have another size.

    Attributes:
        through: (K, r', r + w) the state after each by (state, decisions).
        slope: (K, r + w) of its costs.
        curve: (K, r + w, r + w) of its costs, symmetric.
        lower, upper: (K, w) of the decisions.
        damping: (K, w) added to the diagonal of the Hessian by decisions.
    """

    through: Array
    slope: Array
    curve: Array
    lower: Array
    upper: Array
    damping: Array


class CostToGo(NamedTuple):
    """Cost to go of a state to second order: ``slope`` (r,) and ``curve`` (r, r)."""

    slope: Array
    curve: Array


class Feedback(NamedTuple):
    """The decisions of K steps: ``ahead`` (K, w), and gains ``back`` (K, w, r) by the state; 0 at active bounds."""

    ahead: Array
    back: Array


class RiccatiSolution(NamedTuple):
    """The result of a recursion.

    Attributes:
        feedback: of the runs, in their order.
        first, second: the fall of the costs that is expected of a step of length a: a first + a^2 second.
        cost: to go, of the first state.
    """

    feedback: list[Feedback]
    first: float
    second: float
    cost: CostToGo


def riccati_recursion(
    runs: Iterable[LinearSteps], last: CostToGo, compiled: CompiledRecursion | None = None
) -> RiccatiSolution | None:
    """Compute the optimal decisions of all steps, backwards; None where a Hessian is not positive definite.

    Args:
        runs: of steps, the last run first; the steps of a run are in the order of time.
        last: the cost of the last state.
        compiled: takes runs that suit it.

    Source: Tassa, Mansard, Todorov, Control-Limited Differential Dynamic Programming, ICRA 2014, section III. The
    damping, of Levenberg and Marquardt, acts on decisions alone: cost to go is what they cost without it.
    """
    cost, found = last, list[Feedback]()
    first = second = 0.0
    for run in runs:
        if compiled is not None and compiled.suits(run.through):
            made = compiled(run.through, run.slope, run.curve, (run.lower, run.upper, run.damping), cost)
            if made is None:
                return None
            ahead, back, expected, (slope, curve) = made
            feedback, cost = Feedback(ahead, back), CostToGo(slope, curve)
        else:
            solved = _taken(run, cost)
            if solved is None:
                return None
            feedback, expected, cost = solved
        found.append(feedback)
        first, second = first + expected[0], second + expected[1]
    return RiccatiSolution(found, first, second, cost)


def _taken(run: LinearSteps, cost: CostToGo) -> tuple[Feedback, tuple[float, float], CostToGo] | None:
    """Take a run of steps; return their feedback, the fall that is expected, and the cost to go before it."""
    slope, curve = cost
    first = second = 0.0
    count, w = run.damping.shape
    rest = run.through.shape[2] - w
    found = Feedback(np.empty((count, w)), np.empty((count, w, rest)))
    for k in reversed(range(count)):
        through, own_slope, own_curve, lower, upper, damping = (each[k] for each in run)
        # Q = cost of the step + cost to go of the next state: slope and curvature by (state, decisions).
        total = own_slope + slope @ through
        whole = own_curve + through.T @ (curve @ through)
        if not w:
            slope, curve = total, whole
            continue
        # Minimise Q over the decisions within bounds; feedback of those at no bound.
        by_decisions, hessian, cross = total[rest:], whole[rest:, rest:], whole[rest:, :rest]
        made = _decided(hessian, damping, by_decisions, cross, lower, upper)
        if made is None:
            return None
        found.ahead[k], found.back[k] = ahead, back = made
        # Expected change for a step length t: first t + second t^2; then the cost to go of the state.
        along = hessian @ ahead
        first, second = first + float(by_decisions @ ahead), second + float(ahead @ along) / 2
        slope = total[:rest] + (along + by_decisions) @ back + ahead @ cross
        # back' hessian back = -back' cross - back' damping back, since back solves the damped system
        curve = whole[:rest, :rest] + (cross - damping[:, None] * back).T @ back
        curve = 0.5 * (curve + curve.T)
    return found, (first, second), CostToGo(slope, curve)


def _decided(
    hessian: Array, damping: Array, slope: Array, cross: Array, lower: Array, upper: Array
) -> tuple[Array, Array] | None:
    """Return the optimal decisions (w,) within bounds, and the gains (w, r) of those that are at no bound."""
    damped = hessian.copy()
    damped.ravel()[:: len(slope) + 1] += damping
    factor, fault = lapack().dpotrf(damped, lower=1, clean=0)
    if fault:
        return None
    both = lapack().dpotrs(factor, np.concatenate([slope[:, None], cross], axis=1), lower=1)[0]
    ahead = -both[:, 0]
    if (ahead >= lower).all() and (ahead <= upper).all():
        return ahead, -both[:, 1:]
    found = solve_box_qp(damped, slope, lower, upper, np.zeros_like(slope))
    if found is None:
        return None
    back = np.zeros_like(cross)
    if found.factor is not None:
        back[found.free] = -lapack().dpotrs(found.factor, cross[found.free], lower=1)[0]
    return found.step, back
