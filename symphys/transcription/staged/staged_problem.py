"""A problem step by step, as ``symphys.shooting.StagedProblem`` has it."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from symphys.codegen.backends import BEST
from symphys.problem import Constraint
from symphys.shooting import Expansion, Linearized, StagedMotion
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.columns import ByColumns
from symphys.transcription.staged.linearization import Linearization, statics_of
from symphys.transcription.staged.stage_terms import Slopes, StageTerm, stage_terms

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class RolloutStages:
    """The steps of a rollout, compiled; see ``symphys.shooting.StagedProblem`` for what is public."""

    def __init__(self, rollout: Rollout, backend: str = BEST, threads: int | None = None, exact: bool = False) -> None:
        """Compile the step.

        Args:
            rollout: of a problem.
            backend: what evaluates the step.
            threads: that share a batch; None: one for each processor.
            exact: whether it is for smoothing 0 only.

        Raises:
            SymphysError: for formulas that look at more than one state.
        """
        problem = rollout.problem
        self.rollout, self.steps = rollout, rollout.steps
        self.statics = statics_of(rollout)
        self.terms = stage_terms(rollout, self.statics)
        self._linearization = Linearization(rollout, backend, threads, exact)
        self.tangent = self._linearization.tangent
        self.state_size, self.tangent_size = int(rollout.x0.shape[0]), self.tangent.size
        self.input_size = int(rollout.given.shape[0])
        self.weights = _input_weights(rollout)
        self.squares = all(term.kind != "cost" for term in self.terms)
        found = zip(problem.constraints, (term for term in self.terms if term.kind == "limit"), strict=True)
        parts = [_limit(each, term) for each, term in found]
        none: list[Array] = [np.zeros(0)] * 3
        columns = [np.concatenate(each) for each in zip(*parts, strict=True)] if parts else none
        self.lower, self.upper, self.penalties = columns[0], columns[1], columns[2]

    def start(self, Z: Array) -> Array:
        """(B, nx)."""
        return self._begun(Z)[0]

    def parameters(self, Z: Array) -> Array:
        """(B, np)."""
        return self._begun(Z)[1]

    def _begun(self, Z: Array) -> tuple[Array, Array]:
        """First states and parameters; those that were asked for last are kept."""
        key = Z[:, self.statics].tobytes()
        if self._known is None or self._known[0] != key:
            parts = [self._linearization.begun(z) for z in Z]
            self._known = key, (np.array([x for x, _, _ in parts]), np.array([p for _, _, p in parts]))
        return self._known[1]

    _known: tuple[bytes, tuple[Array, Array]] | None = None

    def step(self, k: int, X: Array, U: Array, Z: Array, smoothing: float) -> Array:
        """(B, nx) after step k."""
        return self._linearization.step.step(k, X, U, self.parameters(Z), smoothing)

    def roll_out(self, z: Array, smoothing: float) -> StagedMotion:
        """The motion of z."""
        return self._linearization.motion(z, smoothing)

    def linearize(self, motion: StagedMotion) -> Linearized:
        """Slopes of all steps."""
        return self._linearization.linearize(motion)

    def retract(self, X: Array, D: Array) -> Array:
        """(B, nx)."""
        return self.tangent.retract(X, D)

    def difference(self, X: Array, Y: Array) -> Array:
        """(B, n)."""
        return self._linearization.step.difference(X, Y)

    def measure(self, Z: Array, X: Array, U: Array) -> tuple[Array, Array]:
        """Objectives (B,) and limits (B, c)."""
        P, objective, limits = self.parameters(Z), np.zeros(len(Z)), [np.zeros((len(Z), 0))]
        for term in self.terms:
            values = term.values(X, U, P, Z)
            if term.kind == "limit":
                limits.append(values.reshape(len(Z), -1))
            else:
                objective += term.weight * np.sum(values**2 if term.kind == "squares" else values, axis=(1, 2))
        return objective, np.concatenate(limits, axis=1)

    def expand(self, motion: StagedMotion, multipliers: Array, penalties: Array) -> Expansion:
        """The augmented objective to second order."""
        sizes = self.steps, self.tangent_size, self.input_size, len(self.statics)
        sums, first = _Sums(*sizes), 0
        for term, found, by_state in self._along(motion):
            if term.kind == "limit":
                part = slice(first, first + found.value.size)
                first = part.stop
                shape = found.value.shape
                multiplier, penalty = multipliers[part].reshape(shape), penalties[part].reshape(shape)
                lower, upper = self.lower[part].reshape(shape), self.upper[part].reshape(shape)
                moved = found.value + multiplier / np.where(penalty > 0, penalty, 1.0)
                beyond = moved - np.clip(moved, lower, upper)
                sums.squares(term, found, by_state, beyond, penalty * (beyond != 0) / 2)
            elif term.kind == "squares":
                sums.squares(term, found, by_state, found.value, np.full(found.value.shape, term.weight))
            else:
                sums.cost(term, found, by_state, self._rows(motion, term))
        return sums.expansion()

    def limit_slopes(self, motion: StagedMotion) -> tuple[Array, Any, Any, Any]:
        """Limits, and their slopes by all states, inputs and static entries."""
        found = [(t, slopes, by_state) for t, slopes, by_state in self._along(motion) if t.kind == "limit"]
        values = np.concatenate([np.zeros(0), *(slopes.value.ravel() for _, slopes, _ in found)])
        n, m, s = self.tangent_size, self.input_size, len(self.statics)
        x = [_placed(by_state, t.states, self.steps + 1) for t, _, by_state in found]
        u = [_placed(slopes.u, t.inputs, self.steps) for t, slopes, _ in found]
        by_s = [slopes.s.reshape(-1, s) for _, slopes, _ in found]
        return (
            values,
            scipy.sparse.csr_array(scipy.sparse.vstack([scipy.sparse.csr_array((0, (self.steps + 1) * n)), *x])),
            scipy.sparse.csr_array(scipy.sparse.vstack([scipy.sparse.csr_array((0, self.steps * m)), *u])),
            scipy.sparse.csr_array(np.concatenate([np.zeros((0, s)), *by_s])),
        )

    def _along(self, motion: StagedMotion) -> list[tuple[StageTerm, Slopes, Array]]:
        """Every term with its slopes, and those by the tangents of its states (T, r, n)."""
        p = self.parameters(motion.z[None])[0]
        _, left, of_p = self._linearization.start_slopes(motion)
        found = []
        for term in self.terms:
            slopes = term.slopes(motion.x, motion.u, p, motion.z, of_p)
            if left.any():
                slopes.s[term.states == 0] += slopes.x[term.states == 0] @ left[term.columns]
            if self.tangent.shifts:
                moved = [np.array(ca.DM(self.tangent.shift(x, p)))[term.columns] for x in motion.x[term.states]]
                slopes.s[:] += slopes.x @ (np.array(moved) @ of_p)
            found.append((term, slopes, slopes.x @ self._rows(motion, term)))
        return found

    def _rows(self, motion: StagedMotion, term: StageTerm) -> Array:
        """(T, q, n): the term's columns of the state by the tangent, at its ticks."""
        columns = tuple(term.columns.tolist())
        if columns not in self._bases:
            x, p = ca.SX.sym("x", self.state_size), ca.SX.sym("p", int(self.rollout.p.shape[0]))
            rows = ca.densify(self.tangent.basis(x, p)[list(columns), :])
            self._bases[columns] = ByColumns(ca.Function("rows", [x, p], [ca.cse(rows)]))
        ticks, p = len(term.states), self.parameters(motion.z[None])[0]
        (found,) = self._bases[columns](motion.x[term.states].T, np.tile(p[:, None], ticks))
        array = found.reshape(len(columns), len(term.states), self.tangent_size)
        return np.ascontiguousarray(array.transpose(1, 0, 2))

    @cached_property
    def _bases(self) -> dict[tuple[int, ...], ByColumns]:
        return {}


def _input_weights(rollout: Rollout) -> Any:
    """(N * m, len(z)) scipy.sparse: u = weights @ z."""
    u = ca.vec(rollout.given)
    slope = ca.DM(ca.Function("u", [rollout.z], [ca.jacobian(u, rollout.z)])(0))
    rows, columns = slope.sparsity().get_triplet()
    shape = (int(slope.shape[0]), int(slope.shape[1]))
    return scipy.sparse.csr_array((np.array(slope.nonzeros()), (rows, columns)), shape=shape)


def _limit(limit: Constraint, term: StageTerm) -> tuple[Array, Array, Array]:
    """(T * r,) each: bounds and weights of squared violations, tick after tick."""
    ticks = len(term.states)
    lower, upper = (np.tile(np.broadcast_to(end, (term.size,)), ticks) for end in (limit.lower, limit.upper))
    return lower, upper, np.full(len(lower), term.weight)


def _placed(blocks: Array, ticks: Indices, count: int) -> Any:
    """(T * r, count * n) sparse: block t in the columns of its tick."""
    _, r, n = blocks.shape
    t, i, j = np.meshgrid(np.arange(len(ticks)), np.arange(r), np.arange(n), indexing="ij")
    place = ((t * r + i).ravel(), (ticks[t] * n + j).ravel())
    return scipy.sparse.csr_array((blocks.ravel(), place), shape=(len(ticks) * r, count * n))


class _Sums:
    """An expansion that is being added up."""

    def __init__(self, steps: int, n: int, m: int, s: int) -> None:
        self.value = 0.0
        self.x, self.xx = np.zeros((steps + 1, n)), np.zeros((steps + 1, n, n))
        self.u, self.uu = np.zeros((steps, m)), np.zeros((steps, m, m))
        self.ux, self.uy = np.zeros((steps, m, n)), np.zeros((steps, m, n))
        self.s, self.ss = np.zeros(s), np.zeros((s, s))
        self.sx, self.su = np.zeros((steps + 1, s, n)), np.zeros((steps, s, m))

    def squares(self, term: StageTerm, found: Slopes, by_state: Array, value: Array, weight: Array) -> None:
        """Add weight * value^2, value (T, r), with the slopes of the term."""
        self.value += float(np.sum(weight * value**2))
        slope = 2 * weight * value
        self._first(term, found, by_state, slope)
        share = 2 * weight[:, :, None]
        by_x, by_u, by_s = (each.transpose(0, 2, 1) for each in (by_state, found.u, found.s))
        self._second(term, by_x @ (share * by_state), by_u @ (share * by_state), by_u @ (share * found.u))
        if self.s.size:
            self.ss += np.sum(by_s @ (share * found.s), axis=0)
            self.sx[term.states] += by_s @ (share * by_state)
            self.su[term.inputs] += by_s @ (share * found.u)

    def cost(self, term: StageTerm, found: Slopes, by_state: Array, rows: Array) -> None:
        """Add weight * the sum of values; ``rows`` (T, q, n): the term's columns by the tangent."""
        self.value += term.weight * float(np.sum(found.value))
        self._first(term, found, by_state, np.full(found.value.shape, term.weight))
        if found.curved is not None:
            q = rows.shape[1]
            curved = term.weight * found.curved
            back = rows.transpose(0, 2, 1)
            self._second(
                term, back @ curved[:, :q, :q] @ rows, curved[:, q:, :q] @ rows, np.ascontiguousarray(curved[:, q:, q:])
            )

    def _first(self, term: StageTerm, found: Slopes, by_state: Array, slope: Array) -> None:
        self.x[term.states] += np.einsum("tr,trn->tn", slope, by_state)
        self.u[term.inputs] += np.einsum("tr,trm->tm", slope, found.u)
        self.s += np.einsum("tr,trs->s", slope, found.s)

    def _second(self, term: StageTerm, xx: Array, ux: Array, uu: Array) -> None:
        self.xx[term.states] += xx
        self.uu[term.inputs] += uu
        cross = self.ux if np.array_equal(term.states, term.inputs) else self.uy
        cross[term.inputs] += ux

    def expansion(self) -> Expansion:
        """The sums."""
        return Expansion(
            self.value, self.x, self.xx, self.u, self.uu, self.ux, self.uy, self.s, self.ss, self.sx, self.su
        )
