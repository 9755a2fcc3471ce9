"""Costs over a horizon, compiled: as numbers inside a rollout, and to second order about a motion, lanes are states.

Second derivatives are those of Gauss and Newton for squares, and made positive semidefinite for other costs, as
``symphys.shooting.Expansion`` has them. Constraints count by the squares of their violations.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import FunctionCall, KernelUnavailable, MemoryLayout, ProcessorKernel, Program, compile_program
from symphys.errors import Issue, ProblemError
from symphys.problem import Constraint
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.stage_functions import ByColumns
from symphys.transcription.staged.stage_terms import StageSymbols, StageTerm
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array, Expr

DRIVEN = (
    "names an input that a controller or force law adds to, beside a state: a plan has no such sum at the end of a "
    "step; name the variable (its part of the input), or leave the state out"
)


@dataclass(frozen=True)
class QuadraticCosts:
    """Costs about a motion, of (state k, decisions k) together; n + w numbers.

    Attributes:
        slope: (N + 1, n + w); of the last state the decisions are 0.
        curve: (N + 1, n + w, n + w).
        ahead: (N, w, n) mixed derivatives by decisions k and state k + 1; None where there are none.
    """

    slope: Array
    curve: Array
    ahead: Array | None


class HorizonCosts:
    """What a problem asks of a motion over the horizon.

    Attributes:
        before, after, end: casadi functions (x, v, p, time) -> (1,): what a step costs at its start and at its end, and
            what the last state costs.
    """

    def __init__(self, symbols: StageSymbols, tangent: Tangent, terms: Sequence[StageTerm], weights: Array) -> None:
        """Compile them.

        Args:
            symbols: that the terms are expressions of.
            tangent: of the states.
            terms: of a problem over one horizon.
            weights: (m, w): the inputs of a step are weights @ v.

        Raises:
            ProblemError: for a term of the inputs that controllers or force laws drive, and of the state after them.
        """
        rollout = symbols.rollout
        self._steps, self._dt = rollout.steps, rollout.dt
        limits = iter(rollout.problem.constraints)
        asked = [_Asked(symbols, term, next(limits) if term.kind == "limit" else None) for term in terms]
        kinds = {when: [each for each in asked if each.when == when] for when in ("before", "after", "end")}
        self.before, self.after, self.end = (_total(rollout, each, weights) for each in kinds.values())
        still = [each for each in asked if each.when == "before" or not each.by_inputs]
        later = [each for each in asked if each not in still]
        self._still = TermStack(rollout, tangent, still, weights)
        self._later = TermStack(rollout, tangent, later, weights) if later else None
        self._n, self._w = tangent.size, int(weights.shape[1])

    def expand(self, x: Array, v: Array, p: Array, clock: float) -> QuadraticCosts:
        """To second order about states (N + 1, nx) and decisions (N, w); ``clock``: [s] the time of the first state."""
        n, steps = self._n, self._steps
        times = np.asarray(clock + np.arange(steps + 1) * self._dt, float)
        slope, curve = self._still.expand(x, np.concatenate([v, v[-1:]]), times, p)
        if self._later is None:
            return QuadraticCosts(slope, curve, None)
        ends, both = self._later.expand(x[1:], v, times[1:], p, first=1)
        slope[1:, :n] += ends[:, :n]
        slope[:-1, n:] += ends[:, n:]
        curve[1:, :n, :n] += both[:, :n, :n]
        curve[:-1, n:, n:] += both[:, n:, n:]
        return QuadraticCosts(slope, curve, both[:, n:, :n])


class _Asked:
    """A term: when it counts, and its value as a function of (x, v, p, time)."""

    def __init__(self, symbols: StageSymbols, term: StageTerm, limit: Constraint | None) -> None:
        self.term, self.kind, steps = term, term.kind, symbols.rollout.steps
        if len(term.steps) == 1:
            self.when = "end"
        else:
            self.when = "after" if term.after else "before"
        self._dt = symbols.rollout.dt
        own = ca.vertcat(symbols.x, symbols.u, symbols.p, symbols.tick)
        if not set(_names(term.value)) <= set(_names(own)):
            raise ProblemError(symbols.rollout.problem.file, [Issue(term.name, DRIVEN)])
        arguments = [symbols.x, symbols.u, symbols.p, symbols.tick]
        self._value = ca.Function("term", arguments, [ca.densify(term.value)])
        self.by_inputs = bool(self._value.jac_sparsity(0, 1).nnz())
        self.factor = np.zeros(steps + 1)
        self.factor[term.states] = term.weight
        self.bounds = None
        if limit is not None:
            self.bounds = tuple(np.broadcast_to(end, (term.size,)) for end in (limit.lower, limit.upper))

    def value(self, x: Expr, u: Expr, p: Expr, time: Expr) -> Expr:
        found = self._value(x, u, p, time / self._dt)
        if self.bounds is not None:
            lower, upper = (ca.DM(end) for end in self.bounds)
            found = found - ca.fmin(ca.fmax(found, lower), upper)
        return found

    @property
    def key(self) -> tuple[str, str, bool]:
        """Terms of one key differ in their ticks only."""
        return self.kind, self.term.name, self.when == "end"


def _names(expression: Expr) -> list[str]:
    """Of the symbols that it is made of; those of one vector have names of their own."""
    return [symbol.name() for symbol in ca.symvar(expression)]


def _symbols(rollout: Rollout, width: int) -> list[Expr]:
    sizes = {"x": rollout.memory.size, "v": width, "p": int(rollout.p.shape[0]), "time": 1}
    return [ca.SX.sym(name, size) for name, size in sizes.items()]


def _total(rollout: Rollout, asked: Sequence[_Asked], weights: Array) -> ca.Function:
    """(x, v, p, time) -> (1,) what these terms cost at one tick."""
    x, v, p, time = _symbols(rollout, weights.shape[1])
    total: Expr = ca.SX(0)
    for each in asked:
        value = each.value(x, ca.mtimes(ca.DM(weights), v), p, time)
        cost: Expr = ca.sum1(value) if each.kind == "cost" else ca.sumsqr(value)
        total += each.term.weight * cost
    return ca.Function("costs", [x, v, p, time], [ca.densify(ca.cse(total))])


class TermStack:
    """Terms on top of each other, with their derivatives by tangent and decisions, at many ticks at once."""

    def __init__(self, rollout: Rollout, tangent: Tangent, asked: Sequence[_Asked], weights: Array) -> None:
        """Compile them; without a compiler casadi's virtual machine evaluates."""
        groups: dict[tuple[str, str, bool], list[_Asked]] = {}
        for each in asked:
            groups.setdefault(each.key, []).append(each)
        squares = [group for group in groups.values() if group[0].kind != "cost"]
        others = [group for group in groups.values() if group[0].kind == "cost"]
        x, v, p, time = _symbols(rollout, weights.shape[1])
        u, basis = ca.mtimes(ca.DM(weights), v), tangent.basis(x, p)
        width, n = weights.shape[1], tangent.size
        r = ca.vertcat(ca.SX(0, 1), *(group[0].value(x, u, p, time) for group in squares))
        slopes = ca.horzcat(ca.mtimes(ca.jacobian(r, x), basis), ca.jacobian(r, v))
        results = [r, _nonzeros(slopes)]
        self._slots, self._shape = _places(slopes), (int(r.shape[0]), n + width)
        self._factors = _factors(rollout.steps, squares)
        self._curved: list[tuple[Array, NDArray[np.int64]]] = []
        both = ca.vertcat(x, v)
        spread = ca.diagcat(basis, ca.SX.eye(width))
        for group in others:
            value = ca.sum1(group[0].value(x, u, p, time))
            curvature, slope = ca.hessian(value, both)
            second: Expr = curvature
            second = ca.mtimes(ca.mtimes(spread.T, second), spread)
            used = np.unique(np.array(second.sparsity().get_triplet()[0], np.int64))
            picked = ca.densify(second[used.tolist(), used.tolist()])
            results += [ca.densify(ca.mtimes(spread.T, slope)), ca.reshape(picked, picked.numel(), 1)]
            self._curved.append((_factors(rollout.steps, [group])[:, 0], used))
        made = ca.cse([ca.densify(each) for each in results])
        self._evaluate = _Rows(ca.Function("terms", [x, v, time, p], made))

    def expand(self, x: Array, v: Array, times: Array, p: Array, first: int = 0) -> tuple[Array, Array]:
        """(T, nx), (T, w), (T,), (np,) -> slopes (T, n + w) and curvatures (T, n + w, n + w).

        ``first``: the number of the first of these states.
        """
        r, packed, *others = self._evaluate(np.concatenate([x, v, times[:, None]], axis=1), p)
        rows, columns = self._slots
        ticks = slice(first, first + len(x))
        slopes = np.zeros((len(x), *self._shape))
        slopes[:, rows, columns] = packed
        weighted = (2 * self._factors[ticks])[:, :, None] * slopes
        slope = np.matmul(r[:, None], weighted)[:, 0]
        curve = np.matmul(slopes.transpose(0, 2, 1), weighted)
        for k, (factors, used) in enumerate(self._curved):
            factor = factors[ticks]
            slope += factor[:, None] * others[2 * k]
            second = factor[:, None, None] * others[2 * k + 1].reshape(len(x), len(used), len(used))
            numbers, vectors = np.linalg.eigh((second + second.transpose(0, 2, 1)) / 2)
            kept = (vectors * np.maximum(numbers, 0.0)[:, None]) @ vectors.transpose(0, 2, 1)
            curve[:, used[:, None], used] += kept
        return slope, curve


def _factors(steps: int, groups: Sequence[Sequence[_Asked]]) -> Array:
    """(N + 1, rows): the weights of stacked terms at each state."""
    columns = [np.zeros((steps + 1, 0))]
    for group in groups:
        total = np.sum([each.factor for each in group], axis=0)
        columns.append(np.tile(total[:, None], group[0].term.size))
    return np.concatenate(columns, axis=1)


def _nonzeros(matrix: Expr) -> Expr:
    return ca.vertcat(ca.SX(0, 1), *matrix.nonzeros())


def _places(matrix: Expr) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, np.int64), np.array(columns, np.int64)


class _Rows:
    """A function (x, v, time, p) row by row: lanes hold rows."""

    def __init__(self, function: ca.Function) -> None:
        self._sizes = [int(function.size1_out(k)) for k in range(function.n_out())]
        self._cuts = np.cumsum([int(function.size1_in(k)) for k in range(2)]).tolist()
        layout = MemoryLayout()
        nx, w, _, np_ = (int(function.size1_in(k)) for k in range(4))
        row, shared = layout.take(nx + w + 1), layout.take(np_)
        outputs = {f"r{k}": layout.take(size) for k, size in enumerate(self._sizes)}
        whole = ca.SX.sym("row", nx + w + 1)
        p = ca.SX.sym("p", np_)
        results = function.call([whole[:nx], whole[nx : nx + w], whole[nx + w], p])
        flat = ca.Function("terms", [whole, p], results)
        program = Program(
            size=layout.size,
            z=row,
            parameters=shared,
            steps=1,
            outputs={name: place for name, place in outputs.items() if place.size},
            prologue=(FunctionCall(flat, (row, shared), tuple(outputs.values())),),
        )
        self._kernel: ProcessorKernel | None = None
        self._mapped = ByColumns(flat)
        with suppress(KernelUnavailable):
            self._kernel = compile_program(program, threads=1)

    def __call__(self, rows: Array, p: Array) -> list[Array]:
        """(T, nx + w + 1), (np,) -> each result (T, size)."""
        if self._kernel is None:
            return [each.T for each in self._mapped(rows.T, np.tile(p[:, None], len(rows)))]
        found = self._kernel.forward(rows, p)
        empty = np.zeros((len(rows), 0))
        return [found.get(f"r{k}", empty) for k in range(len(self._sizes))]
