"""The backward pass: from the last state to the first, the optimal change of every knot as a function of the state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.records import dataclass
from symphys.shooting import CompiledRecursion, Expansion, Linearized, costates
from symphys.solvers.ddp.box_qp import solve_box_qp
from symphys.solvers.ddp.knots import KnotSteps
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
        ahead: (N, w) the change of the new knots of each step; 0 of knots that are none, see ``KnotArrays``.
        back: (N, w, n + o + s) how they answer the state, old knots and static entries.
        statics: (s,) the change of the static entries of z.
        first, second: the fall of the objective that is expected of a step of length a: a first + a^2 second.
        gradient: (len(z),) of the augmented objective; 0 where it was not asked for.
    """

    ahead: Array
    back: Array
    statics: Array
    first: float
    second: float
    gradient: Array


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
        compiled: makes costates, and takes runs of small steps.

    Source: Tassa, Erez, Todorov, Synthesis and stabilization of complex behaviors through online trajectory
    optimization, IROS 2012. Theirs has one slope of the cost to go; here it is a costate and what decisions add to
    that. Numbers of the state on which nothing later depends are left out of the recursion.
    """
    # Eliminate all knots, backwards over the steps.
    costate = gradient or bool(knots.padded.old.size or len(statics))
    made = _Steps(costs, knots, statics, bounds, damping, costate, compiled)
    found = riccati_recursion(made.from_end(slopes), made.last(), compiled)
    if found is None:
        return None
    # The static entries remain: minimise over them, then close the loop.
    slope, curve = made.at_start(found.cost)
    chosen = _static_step(slope, curve, bounds, statics, damping)
    if chosen is None:
        return None
    first, second = found.first + float(slope @ chosen), found.second + float(chosen @ curve @ chosen) / 2
    return Policy(*made.gains(found.feedback), chosen, first, second, made.gradient)


class _Steps:
    """The steps of a motion for the Riccati recursion, in states (live tangent, old knots, static entries).

    The numbers of a tangent are live where the step, or a cost, depends on them. Without a costate all are.

    Attributes:
        gradient: (len(z),) of the objective, once all steps were made.
    """

    def __init__(
        self,
        costs: Expansion,
        knots: KnotSteps,
        statics: Ints,
        bounds: Bounds,
        damping: float,
        costate: bool,
        compiled: CompiledRecursion | None,
    ) -> None:
        self._compiled = compiled
        self.costs, self.knots, self.statics, self.padded = costs, knots, statics, knots.padded
        self._with_costate = costate
        self.gradient = np.zeros(len(bounds.scale))
        self._by_knots = np.zeros(len(bounds.scale) + 1)  # the last of knots that are none
        self._costate = costs.x[-1]
        self._mixed = bool(costs.ux.any()), bool(costs.uy.any())
        damped = damping / bounds.scale**2
        room = ((bounds.down, 0.0), (bounds.up, 0.0), (damped, 1.0))  # knots that are none stay at 0
        self._room = [np.append(each, none)[self.padded.new] for each, none in room]
        self._curves = self._curves_of_costs()
        self._asked: Bools | None = self._in_costs() if costate else None
        last = slice(0, costs.x.shape[1]) if self._asked is None else _selection(self._asked[-1])
        self._lives = [last] * (len(knots) + 1)
        self._start = np.zeros((costs.x.shape[1], len(statics)))
        self._runs = list[tuple[slice, Selection]]()

    @property
    def _sizes(self) -> tuple[int, int, int, int]:
        """Return the numbers of the tangent, old knots, static entries and new knots."""
        return self.costs.x.shape[1], self.padded.old.shape[1], len(self.statics), self.padded.new.shape[1]

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
        live, (_, o, s, _) = self._lives[-1], self._sizes
        curve, by_statics = self.costs.xx[-1][live][:, live], self.costs.sx[-1][:, live]
        n = len(curve)
        whole, slope = np.zeros((n + o + s, n + o + s)), np.zeros(n + o + s)
        whole[:n, :n], whole[n + o :, :n], whole[:n, n + o :] = curve, by_statics, by_statics.T
        if not self._with_costate:
            slope[:n] = self.costs.x[-1][live]
        return CostToGo(slope, whole)

    def from_end(self, slopes: Iterable[Linearized]) -> Iterator[LinearSteps]:
        """Yield runs of steps, from the last to the first."""
        end = len(self.knots)
        for run in slopes:
            first = end - len(run.a)
            if self._asked is not None:
                in_steps = run.a.reshape(-1, run.a.shape[2]).any(axis=0)
                live = _selection(np.asarray(in_steps | self._asked[first:end].any(axis=0)))
                self._lives[first:end] = [live] * len(run.a)
            yield from self._run(first, end, run)
            end, self._start = first, run.start
        self.gradient += self._by_knots[:-1]
        self.gradient[self.statics] += self.costs.s + self._start.T @ self._costate

    def at_start(self, cost: CostToGo) -> tuple[Array, Array]:
        """Return slope (s,) and curvature (s, s) of the whole motion by the static entries, after the recursion."""
        _, o, s, _ = self._sizes
        start = np.concatenate([self._start[self._lives[0]], np.zeros((o, s)), np.eye(s)])
        slope = cost.slope @ start + self._start.T @ self._costate + self.costs.s
        return slope, start.T @ cost.curve @ start + self.costs.ss

    def gains(self, feedback: Sequence[Feedback]) -> Feedback:
        """Return the feedback of all steps by the whole tangent, from that of the runs that were made."""
        (n, o, s, w), count = self._sizes, len(self.knots)
        whole = Feedback(np.zeros((count, w)), np.zeros((count, w, n + o + s)))
        for (steps, live), (ahead, back) in zip(self._runs, feedback, strict=True):
            whole.ahead[steps] = ahead
            whole.back[steps, :, _columns(live, n, n + o + s)] = back
        return whole

    def _curves_of_costs(self) -> Array:
        """Return the curvatures (N, c, c) of all costs by the columns (state, old knots, static entries, new knots)."""
        costs, weights, (n, o, s, w) = self.costs, self.padded.weights, self._sizes
        acting, statics, across = _places(n, o, s, w), slice(n + o, n + o + s), weights.transpose(0, 2, 1)
        curves = np.zeros((len(weights), n + o + s + w, n + o + s + w))
        curves[:, :n, :n] = costs.xx[:-1]
        crossed = np.zeros((len(weights), o + w, curves.shape[2]))
        crossed[:, :, acting] = across @ costs.uu @ weights / 2
        if self._mixed[0]:
            crossed[:, :, :n] = across @ costs.ux
        if s:
            crossed[:, :, statics] = (costs.su @ weights).transpose(0, 2, 1)
            curves[:, statics, :n] = costs.sx[:-1]
            curves[:, :n, statics] = costs.sx[:-1].transpose(0, 2, 1)
        curves[:, acting] += crossed
        curves[:, :, acting] += crossed.transpose(0, 2, 1)
        return curves

    def _run(self, first: int, end: int, run: Linearized) -> Iterator[LinearSteps]:
        """Yield a run of steps; alone its last one where other entries of the tangent are live after it."""
        costs, steps, (n, o, s, w) = self.costs, slice(first, end), self._sizes
        weights, acting = self.padded.weights[steps], _places(n, o, s, w)
        # Slopes of costs; those by the state are in the costate, if there is one.
        slopes = np.zeros((end - first, n + o + s + w))
        by_inputs, by_statics = costs.u[steps], np.zeros((end - first, s))
        if self._with_costate:
            by_inputs, by_statics = self._by_costate(first, run)
            self.gradient[self.statics] += by_statics.sum(axis=0)
        else:
            slopes[:, :n] = costs.x[steps]
        by_knots = (by_inputs[:, None] @ weights)[:, 0]
        slopes[:, acting], slopes[:, n + o : n + o + s] = by_knots, by_statics
        np.add.at(self._by_knots, np.concatenate([self.padded.old[steps], self.padded.new[steps]], axis=1), by_knots)
        # Slopes of the next state by (state, old knots, static entries, new knots).
        b = run.b @ weights
        after = np.concatenate([run.a, b[:, :, :o], run.c, b[:, :, o:]], axis=2)
        curves = self._curves[steps]
        if self._mixed[1]:
            crossed = (weights.transpose(0, 2, 1) @ costs.uy[steps]) @ after
            curves = curves.copy()
            curves[:, acting] += crossed
            curves[:, :, acting] += crossed.transpose(0, 2, 1)
        # Restrict the states to the tangent entries on which later costs depend.
        live, later, room = self._lives[first], self._lives[end], [each[steps] for each in self._room]
        beside = self._carried(first, end)
        if not _is_whole(live, n):
            columns = _columns(live, n, after.shape[2])
            after, slopes, curves = after[:, :, columns], slopes[:, columns], curves[:, columns][:, :, columns]
            beside = beside[:, :, columns]
        parts, last = (slopes, curves, *room), end - first - 1
        if _is_same(live, later):
            self._runs.append((steps, live))
            yield LinearSteps(np.concatenate([after[:, live], beside], axis=1), *parts)
            return
        self._runs.append((slice(end - 1, end), live))
        through = np.concatenate([after[last:, later], beside[last:]], axis=1)
        yield LinearSteps(through, *(each[last:] for each in parts))
        if last:
            self._runs.append((slice(first, end - 1), live))
            through = np.concatenate([after[:last, live], beside[:last]], axis=1)
            yield LinearSteps(through, *(each[:last] for each in parts))

    def _carried(self, first: int, end: int) -> Array:
        """Return the rows (K, o + s, c) that carry knots which act again, and static entries, to the next state."""
        n, o, s, w = self._sizes
        rows = np.zeros((end - first, o + s, n + o + s + w))
        rows[:, :o, _places(n, o, s, w)] = self.padded.keep[first:end]
        rows[:, o + np.arange(s), n + o + np.arange(s)] = 1.0
        return rows

    def _by_costate(self, first: int, run: Linearized) -> tuple[Array, Array]:
        """Return slopes (K, m) by inputs and (K, s) by static entries of the objective, and move on the costate."""
        steps = slice(first, first + len(run.a))
        after, self._costate = costates(run.a, self.costs.x[steps], self._costate, self._compiled)
        return self.costs.u[steps] + (after[:, None] @ run.b)[:, 0], (after[:, None] @ run.c)[:, 0]


def _selection(chosen: NDArray[np.bool_]) -> Selection:
    """Return a selection of these numbers; a slice, which copies nothing, where they are contiguous."""
    numbers = np.flatnonzero(chosen)
    if not len(numbers):
        return slice(0, 0)
    first, last = int(numbers[0]), int(numbers[-1])
    return slice(first, last + 1) if last - first + 1 == len(numbers) else numbers


def _columns(live: Selection, n: int, count: int) -> Selection:
    """Return the columns of a selection of the first n numbers, then of all from n to ``count``."""
    return slice(None) if _is_whole(live, n) else np.concatenate([np.arange(n)[live], np.arange(n, count)])


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
