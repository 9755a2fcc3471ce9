"""The backward pass: from the last state to the first, the optimal change of every knot as a function of the state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symphys.shooting import CompiledRecursion, Expansion, Linearized
from symphys.solvers.ddp.box_qp import solve_box_qp
from symphys.solvers.ddp.knots import AlignedKnots, KnotSteps
from symphys.solvers.ddp.riccati import CostToGo, Feedback, LinearSteps, riccati_recursion
from symphys.types import Array, Bools, Ints

Selection = slice | Ints


@dataclass(frozen=True)
class Bounds:
    """Distances of each entry of z from its bounds, and its typical change; (len(z),)."""

    down: Array
    up: Array
    scale: Array


@dataclass(frozen=True)
class Policy:
    """The result of a backward pass.

    Attributes:
        gains: how the new knots of each step answer: ``ahead`` (w,), and ``back`` (w, n + o + s) of state, old knots
            and static entries; None for steps that decide nothing.
        statics: (s,) the change of the static entries of z.
        first, second: the fall of the objective that is expected of a step of length a: a first + a^2 second.
        gradient: (len(z),) of the augmented objective; 0 where it was not asked for.
    """

    gains: Sequence[Feedback | None]
    statics: Array
    first: float
    second: float
    gradient: Array

    @cached_property
    def aligned(self) -> tuple[Array, Array]:
        """Return ``ahead`` (N, w) and ``back`` (N, w, n) of all steps, where their knots are aligned."""
        gains = [gain for gain in self.gains if gain is not None]
        return np.array([gain.ahead for gain in gains]), np.array([gain.back for gain in gains])


def backward_pass(
    slopes: Iterable[Linearized],
    costs: Expansion,
    knots: KnotSteps,
    statics: Ints,
    bounds: Bounds,
    damping: float,
    gradient: bool = True,
    compiled: CompiledRecursion | None = None,
) -> Policy | None:
    """Compute the policy about a motion; None where a Hessian is not positive definite.

    Args:
        slopes: of runs of steps, the last run first: a run is asked for when those after it are done.
        costs: of the augmented objective.
        knots: of the steps.
        statics: (s,) entries of z.
        bounds: of z.
        damping: of Levenberg and Marquardt: added to the Hessian by knots, in units of their scales.
        gradient: whether it is computed. It takes a costate; without, slopes are those of the whole cost to go.
        compiled: takes runs of small steps.

    Source: Tassa, Erez, Todorov, Synthesis and stabilization of complex behaviors through online trajectory
    optimization, IROS 2012. Theirs has one slope of the cost to go; here it is a costate and what decisions add to
    that. Numbers of the state on which nothing later depends are left out of the recursion.
    """
    # Eliminate all knots, backwards over the steps.
    costate = gradient or knots.aligned is None or bool(len(statics))
    made = _Steps(costs, knots, statics, bounds, damping, costate)
    found = riccati_recursion(made.from_end(slopes), made.last(), compiled)
    if found is None:
        return None
    # The static entries remain: minimise over them, then close the loop.
    slope, curve = made.at_start(found.cost)
    chosen = _static_step(slope, curve, bounds, statics, damping)
    if chosen is None:
        return None
    first, second = found.first + float(slope @ chosen), found.second + float(chosen @ curve @ chosen) / 2
    gains = made.gains(found.feedback[::-1])
    return Policy(gains, chosen, first, second, made.gradient)


class _Steps:
    """The steps of a motion for the Riccati recursion, in states (live tangent, old knots, static entries).

    The numbers of a tangent are live where the step, or a cost, depends on them. Without a costate all are.

    Attributes:
        gradient: (len(z),) of the objective, once all steps were made.
    """

    def __init__(
        self, costs: Expansion, knots: KnotSteps, statics: Ints, bounds: Bounds, damping: float, costate: bool
    ) -> None:
        self.costs, self.knots, self.statics, self.bounds = costs, knots, statics, bounds
        self._aligned = None if len(statics) else knots.aligned
        self._with_costate = costate
        self.gradient = np.zeros(len(bounds.scale))
        self._damping = damping / bounds.scale**2
        self._costate = costs.x[-1]
        self._mixed = bool(costs.ux.any()), bool(costs.uy.any())
        if self._aligned is not None:
            self._own_slopes, self._own_curves = self._aligned_costs(self._aligned)
            self._room = [each[self._aligned.new] for each in (bounds.down, bounds.up, self._damping)]
        self._asked: Bools | None = self._in_costs() if costate else None
        last = slice(0, costs.x.shape[1]) if self._asked is None else _selection(self._asked[-1])
        self._lives = [last] * (len(knots) + 1)
        self._start = np.zeros((costs.x.shape[1], len(statics)))

    def _in_costs(self) -> Bools:
        """Return (N + 1, n) which tangent entries have curvature in some cost; the costate has the slopes."""
        costs = self.costs
        asked: Bools = np.diagonal(costs.xx, axis1=1, axis2=2) != 0  # others are 0 with it: xx is positive semidefinite
        asked |= costs.sx.any(axis=1)
        asked[:-1] |= costs.ux.any(axis=1)
        asked[1:] |= costs.uy.any(axis=1)
        return asked

    def last(self) -> CostToGo:
        """Return the cost to go of the state after the last step, without its costate."""
        live, s = self._lives[-1], len(self.statics)
        curve, by_statics = self.costs.xx[-1][live][:, live], self.costs.sx[-1][:, live]
        if s:
            curve = np.block([[curve, by_statics.T], [by_statics, np.zeros((s, s))]])
        return CostToGo(np.zeros(len(curve)) if self._with_costate else self.costs.x[-1][live], curve)

    def from_end(self, slopes: Iterable[Linearized]) -> Iterator[LinearSteps]:
        """Yield runs of steps, from the last to the first."""
        end = len(self.knots)
        for run in slopes:
            first = end - len(run.a)
            if self._asked is not None:
                in_steps = run.a.reshape(-1, run.a.shape[2]).any(axis=0)
                live = _selection(np.asarray(in_steps | self._asked[first:end].any(axis=0)))
                self._lives[first:end] = [live] * len(run.a)
            if self._aligned is not None:
                yield from self._run(first, end, run, self._aligned)
            else:
                for k in reversed(range(first, end)):
                    yield self._step(k, run.a[k - first], run.b[k - first], run.c[k - first])
            end, self._start = first, run.start
        self.gradient[self.statics] += self.costs.s + self._start.T @ self._costate

    def at_start(self, cost: CostToGo) -> tuple[Array, Array]:
        """Return slope (s,) and curvature (s, s) of the whole motion by the static entries, after the recursion."""
        start = np.concatenate([self._start[self._lives[0]], np.eye(len(self.statics))])
        slope = cost.slope @ start + self._start.T @ self._costate + self.costs.s
        return slope, start.T @ cost.curve @ start + self.costs.ss

    def gains(self, feedback: Sequence[Feedback | None]) -> Sequence[Feedback | None]:
        """Return the feedback of all steps by the whole tangent."""
        n = self.costs.x.shape[1]
        lives = {id(each): each for each in self._lives[:-1]}.values()
        if self._aligned is not None and all(_is_whole(each, n) for each in lives):
            return feedback
        return [self._gain(k, each) for k, each in enumerate(feedback)]

    def _gain(self, k: int, feedback: Feedback | None) -> Feedback | None:
        """Return the feedback of step k by the whole tangent."""
        if feedback is None:
            return None
        n, beside = self.costs.x.shape[1], len(self.knots[k].old) + len(self.statics)
        back = np.zeros((len(feedback.ahead), n + beside))
        live = feedback.back.shape[1] - beside
        back[:, :n][:, self._lives[k]], back[:, n:] = feedback.back[:, :live], feedback.back[:, live:]
        return Feedback(feedback.ahead, back)

    def _run(self, first: int, end: int, run: Linearized, knots: AlignedKnots) -> Iterator[LinearSteps]:
        """Yield a run of steps with knots of their own and no static entries; alone its last one, if sizes differ."""
        steps, n = slice(first, end), run.a.shape[1]
        # Slopes of the next state by (state, knots), and costs of the steps by the same.
        after = np.concatenate([run.a, run.b if knots.plain else run.b @ knots.weights[steps]], axis=2)
        slopes, curves = self._own_slopes[steps], self._own_curves[steps]
        if self._with_costate:
            slopes = self._by_costate(first, run, knots.weights[steps])
            self.gradient[knots.new[steps]] = slopes[:, n:]
        # Mixed second derivatives of costs by inputs and the next state.
        if self._mixed[1]:
            crossed = (knots.weights[steps].transpose(0, 2, 1) @ self.costs.uy[steps]) @ after
            curves = curves.copy()
            curves[:, n:] += crossed
            curves[:, :, n:] += crossed.transpose(0, 2, 1)
        # Restrict the states to the tangent entries on which later costs depend.
        live, later, room = self._lives[first], self._lives[end], [each[steps] for each in self._room]
        if not _is_whole(live, n):
            columns = np.concatenate([np.arange(n)[live], np.arange(n, after.shape[2])])
            after, slopes, curves = after[:, :, columns], slopes[:, columns], curves[:, columns][:, :, columns]
        parts, last = (slopes, curves, *room), len(after) - 1
        if _is_same(live, later):
            yield LinearSteps(after[:, live], *parts)
            return
        yield LinearSteps(after[last:, later], *(each[last:] for each in parts))
        if last:
            yield LinearSteps(after[:last, live], *(each[:last] for each in parts))

    def _aligned_costs(self, knots: AlignedKnots) -> tuple[Array, Array]:
        """Return slopes (N, n + w) and curvatures (N, n + w, n + w) of all costs by the state and the knots."""
        costs, n, across = self.costs, self.costs.x.shape[1], knots.weights.transpose(0, 2, 1)
        by_knots = costs.u if knots.plain else (costs.u[:, None] @ knots.weights)[:, 0]
        slopes = np.concatenate([costs.x[:-1], by_knots], axis=1)
        curves = np.zeros((*slopes.shape, slopes.shape[1]))
        curves[:, :n, :n] = costs.xx[:-1]
        curves[:, n:, n:] = costs.uu if knots.plain else across @ costs.uu @ knots.weights
        if self._mixed[0]:
            curves[:, n:, :n] = costs.ux if knots.plain else across @ costs.ux
            curves[:, :n, n:] = curves[:, n:, :n].transpose(0, 2, 1)
        return slopes, curves

    def _by_costate(self, first: int, run: Linearized, weights: Array) -> Array:
        """Return (K, n + w) slopes of a run of steps by its knots; those by the state are in the costate."""
        costs, by_inputs = self.costs, np.empty((len(run.a), run.b.shape[2]))
        for k in reversed(range(len(run.a))):
            by_inputs[k] = costs.u[first + k] + self._costate @ run.b[k]
            self._costate = costs.x[first + k] + self._costate @ run.a[k]
        slopes = np.zeros((len(run.a), run.a.shape[1] + weights.shape[2]))
        slopes[:, run.a.shape[1] :] = (by_inputs[:, None] @ weights)[:, 0]
        return slopes

    def _step(self, k: int, a: Array, b: Array, c: Array) -> LinearSteps:
        """Return the step and the costs of the state and inputs before it; columns: (state, old, statics, new)."""
        costs, knot, costate, live = self.costs, self.knots[k], self._costate, self._lives[k]
        # Adjoint step: gradient of the objective by the knots and the static entries.
        self._costate = costs.x[k] + costate @ a
        by_inputs, by_statics = costs.u[k] + costate @ b, costate @ c
        by_knots = knot.weights.T @ by_inputs
        self.gradient[knot.acting] += by_knots
        self.gradient[self.statics] += by_statics
        # Slopes of the next state by the columns (state, old knots, statics, new knots).
        rows = self._lives[k + 1]
        a, b, c = a[rows][:, live], b[rows] @ knot.weights, c[rows]
        n, o, s, new = a.shape[1], len(knot.old), len(self.statics), knot.new
        after = np.concatenate([a, b[:, :o], c, b[:, o:]], axis=1)
        acting, statics = _places(n, o, s, len(new)), slice(n + o, n + o + s)
        slope = np.zeros(after.shape[1])
        slope[acting], slope[statics] = by_knots, by_statics
        # Costs by the same columns; knots that act again and statics are carried on unchanged.
        curve = self._curve(k, after, acting)
        through = after
        if s or len(knot.kept):
            through = np.zeros((len(a) + len(knot.kept) + s, after.shape[1]))
            through[: len(a)] = after
            beside = np.concatenate([np.arange(n + o + s + len(new))[acting][knot.kept], np.arange(n + o, n + o + s)])
            through[len(a) + np.arange(len(beside)), beside] = 1.0
        room = (self.bounds.down[new], self.bounds.up[new], self._damping[new])
        return LinearSteps(*(each[None] for each in (through, slope, curve, *room)))

    def _curve(self, k: int, after: Array, acting: Selection) -> Array:
        """Return the curvature of the costs of step k; ``after``: derivative of the state after it."""
        costs, knot, live, s = self.costs, self.knots[k], self._lives[k], len(self.statics)
        size, w = after.shape[1], knot.weights
        own = costs.xx[k][live][:, live]
        n, statics = len(own), slice(size - len(knot.new) - s, size - len(knot.new))
        curve = np.zeros((size, size))
        curve[:n, :n] = own
        crossed = np.zeros((w.shape[1], size))
        crossed[:, acting] = w.T @ costs.uu[k] @ w / 2
        if self._mixed[0]:
            crossed[:, :n] += w.T @ costs.ux[k][:, live]
        if self._mixed[1]:
            crossed += (w.T @ costs.uy[k][:, self._lives[k + 1]]) @ after
        if s:
            crossed[:, statics] += (costs.su[k] @ w).T
            curve[statics, :n] = costs.sx[k][:, live]
            curve[:n, statics] = curve[statics, :n].T
        curve[acting] += crossed
        curve[:, acting] += crossed.T
        return curve


def _selection(chosen: NDArray[np.bool_]) -> Selection:
    """Return a selection of these numbers; a slice, which copies nothing, where they are contiguous."""
    numbers = np.flatnonzero(chosen)
    if not len(numbers):
        return slice(0, 0)
    first, last = int(numbers[0]), int(numbers[-1])
    return slice(first, last + 1) if last - first + 1 == len(numbers) else numbers


def _is_whole(selection: Selection, n: int) -> bool:
    """Whether all of n numbers are selected."""
    return isinstance(selection, slice) and selection == slice(0, n)


def _is_same(one: Selection, other: Selection) -> bool:
    """Whether two selections are of the same numbers."""
    if isinstance(one, slice) or isinstance(other, slice):
        return isinstance(one, slice) and isinstance(other, slice) and one == other
    return np.array_equal(one, other)


def _places(n: int, o: int, s: int, new: int) -> Selection:
    """Return the places of the knots among (state, old knots, static entries, new knots)."""
    return np.concatenate([np.arange(n, n + o), np.arange(n + o + s, n + o + s + new)]) if s else slice(n, n + o + new)


def _static_step(slope: Array, curve: Array, bounds: Bounds, statics: Ints, damping: float) -> Array | None:
    """Return (s,) the optimal change of the static entries."""
    if not len(statics):
        return np.zeros(0)
    damped = (curve + curve.T) / 2 + np.diag(damping / bounds.scale[statics] ** 2)
    found = solve_box_qp(damped, slope, bounds.down[statics], bounds.up[statics], np.zeros(len(statics)))
    return None if found is None else found.step
