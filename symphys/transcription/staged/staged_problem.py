"""A problem step by step: the implementation of ``symphys.shooting.StagedProblem``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symphys.codegen.backends import BEST, PRECISIONS, Description
from symphys.dynamics.observation import SensedState, joint_turn, named_sensors, sensor_readings
from symphys.model.state_layout import Layout
from symphys.problem import STEP_LENGTH, GuessedMotion, Problem
from symphys.problem.guess import ball_joints, guessable, is_orientation, rate_of, turn_between
from symphys.shooting import AffinePolicy, CompiledRecursion, Expansion, Followed, Linearized, StagedMotion
from symphys.transcription.objective import bounds
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.expansion import ExpansionSums, SquareStack, square_stacks
from symphys.transcription.staged.linearization import Linearization, statics_of
from symphys.transcription.staged.policy_rollout import PolicyRollout, PolicySizes, running_costs, running_sums
from symphys.transcription.staged.stage_functions import ByColumns, StepRows
from symphys.transcription.staged.stage_terms import Kind, StageTerm
from symphys.transcription.staged.tangent import Tangent
from symphys.transcription.staged.term_slopes import Blocks, TermGroups, TermSlopes
from symphys.types import Array, Ints

SUMS: frozenset[Kind] = frozenset({"sum"})
COSTS: frozenset[Kind] = frozenset({"cost"})
LIMITS: frozenset[Kind] = frozenset({"limit"})
TERMS: frozenset[Kind] = frozenset({"cost", "squares", "limit"})


class SlopedTerm(NamedTuple):
    """A term along a motion.

    Attributes:
        term: the term.
        value: (T, r).
        blocks: its slopes.
        by_s: (T, r, s) its slopes by the static entries of z.
        slopes, found: the data of its curvature.
    """

    term: StageTerm
    value: Array
    blocks: Blocks
    by_s: Array
    slopes: TermSlopes
    found: list[Array]


class RolloutStages:
    """The compiled steps of a rollout; ``symphys.shooting.StagedProblem`` describes the public methods.

    A state is that of the rollout, then the sums that formulas take of a whole motion. Inputs are those of the rollout,
    then control knots that formulas name, each at the first step in which it acts.
    """

    def __init__(
        self,
        rollout: Rollout,
        backend: str = BEST,
        threads: int | None = None,
        exact: bool = False,
        priced: bool = False,
        linearization: Linearization | None = None,
    ) -> None:
        """Compile the step.

        Args:
            rollout: of a problem.
            linearization: of this rollout, with the same options; None: it is made.
            backend: the evaluator of the step.
            threads: their number for a batch; None: one for each processor.
            exact: whether it is for smoothing 0 only.
            priced: whether motions under a policy come with their merits, and an iteration shall take least time.
        """
        self.rollout, self.steps = rollout, rollout.steps
        self.statics = statics_of(rollout)
        self._linearization = linearization or Linearization(rollout, backend, threads, exact, wait=priced)
        self.tangent = self._linearization.tangent
        self._evaluated, self._priced = (backend, 1, 0) if priced else (backend, threads, None), priced
        self._groups = TermGroups(rollout, self.tangent, backend, threads)
        self.terms = self._groups.terms
        self._sums = len(self._groups.symbols.sums.sums)
        self._given = rollout.controls
        self.state_size, self.tangent_size = int(rollout.x0.shape[0]) + self._sums, self.tangent.size + self._sums
        self.weights, (which, places) = _input_weights(rollout, self._groups.symbols.named, self.statics)
        self._knots = int(rollout.p.shape[0]) + which, places
        self.input_size = self.weights.shape[0] // self.steps
        self.squares = all(term.kind != "cost" for term in self.terms)
        _, self.lower, self.upper = bounds(rollout)
        self.penalties = self._of_limits([term.weight for term in self.terms if term.kind == "limit"], float)
        self.lasting = self._of_limits([each.at == "always" for each in rollout.problem.constraints], bool)

    def _of_limits(self, values: Sequence[float], kind: type) -> np.ndarray:
        """Return one value for each number that is limited, from those of the terms."""
        counts = [len(term.steps) * term.size for term in self.terms if term.kind == "limit"]
        return np.repeat(np.array(values, kind), counts)

    def weighted(self, problem: Problem) -> RolloutStages:
        """Return the stages of a problem that differs in weights only; all functions are shared."""
        assert not self._priced, "merits along the motion have weights in them"
        found = copy(self)
        found.rollout = replace(self.rollout, problem=problem)
        found._groups = self._groups.weighted(found.rollout)
        found.terms = found._groups.terms
        found.penalties = found._of_limits([term.weight for term in found.terms if term.kind == "limit"], float)
        found._reduced = None
        vars(found).pop("_stacks", None)
        return found

    def without_forces(self) -> RolloutStages:
        """Implement ``StagedProblem.without_forces``; the steps are made once."""
        if self._reduced is None:
            own, other = self._linearization.step, self._linearization.without_forces()
            if other.tangent.size == self.tangent.size:
                return self
            self._reduced = RolloutStages(self.rollout, own.backend, own.threads, own.exact, self._priced, other)
            self._reduced._whole = self.tangent
        return self._reduced

    _reduced: RolloutStages | None = None
    _whole: Tangent | None = None

    def whole_gains(self, motion: StagedMotion, steps: Ints, by_state: Array) -> Array:
        """Implement ``StagedProblem.whole_gains``, to first order about the states."""
        if self._whole is None:
            return by_state
        n, p, states = self.tangent.size, self.parameters(motion.z[None])[0], self._plain(motion).x
        found = np.zeros((len(by_state), self._whole.size + self._sums))
        for into, step, row in zip(found, steps.tolist(), by_state, strict=True):
            x = states[step]
            reduced = np.array(ca.DM(self.tangent.projection(x, p))) @ np.array(ca.DM(self._whole.basis(x, p)))
            into[:] = np.concatenate([row[:n] @ reduced, row[n:]])
        return found

    def begin(self, x: Array, time: float) -> None:
        """Let motions begin at a state (nx,) and time [s]; requires a fixed duration and no sums."""
        assert not self._sums and not self.rollout.problem.free_duration
        self._first, self._linearization.step.clock = x, time
        self._groups.clock = time / self.rollout.dt

    _first: Array | None = None

    @property
    def description(self) -> str:
        """Describe the evaluator of the derivatives."""
        return self._linearization.step.description

    @property
    def backend(self) -> Description:
        """Describe the evaluator of the steps."""
        return self._linearization.step.evaluator

    def start(self, Z: Array) -> Array:
        """Return first states (B, nx)."""
        return self._begun(Z)[0]

    def parameters(self, Z: Array) -> Array:
        """Return parameters (B, np)."""
        return self._begun(Z)[1]

    def _begun(self, Z: Array) -> tuple[Array, Array, Array]:
        """Return first states, parameters, and starts of formulas, a row for each z."""
        states, p, starts = self._distinct(Z)
        if len(p) == len(Z) == len(states):
            return states, p, starts
        return np.repeat(states[:1], len(Z), axis=0), np.repeat(p, len(Z), axis=0), np.repeat(starts, len(Z), axis=0)

    def _distinct(self, Z: Array) -> tuple[Array, Array, Array]:
        """Return ``_begun`` of distinct rows, one without static entries; the last result is cached."""
        single = not len(self.statics)  # then they are the same for all z
        key = 0 if single else len(Z), Z[:, self.statics].tobytes()
        if self._known is None or self._known[0] != key:
            rows = Z[:1] if single else Z
            parts = [self._linearization.start(z) for z in rows]
            states = np.array([np.append(x, np.zeros(self._sums)) for x, _, _ in parts])
            starts = np.array([np.array(self._groups.symbols.sums.started(z)).ravel() for z in rows])
            self._known = key, (states, np.array([p for _, _, p in parts]), starts)
        states, p, starts = self._known[1]
        return (states if self._first is None else self._first[None]), p, starts

    _known: tuple[tuple[int, bytes], tuple[Array, Array, Array]] | None = None

    def _constants(self, Z: Array, U: Array) -> Array:
        """Return (B, c) the numbers of terms that are constant along each motion; knots are those of U."""
        if self._groups.symbols.plain:
            return self._begun(Z)[1]
        _, p, starts = self._begun(Z)
        named = Z[:, self._groups.symbols.named]
        which, places = self._knots
        named[:, which - p.shape[1]] = U[:, places[:, 0], places[:, 1]]
        return np.concatenate([p, named, starts], axis=1)

    def step(self, k: int, X: Array, U: Array, Z: Array, smoothing: float) -> Array:
        """Return states (B, nx) after step k."""
        plain = X[:, : X.shape[1] - self._sums]
        after = self._linearization.step.step(k, plain, U[:, : self._given], self.parameters(Z), smoothing)
        if not self._sums:
            return after
        after = np.concatenate([after, X[:, plain.shape[1] :]], axis=1)
        ticks = np.broadcast_to(np.asarray(k), (len(X),))
        return self._groups.summed(StepRows(X, after, U[:, : self._given], self._constants_of_steps(Z), ticks))

    def _constants_of_steps(self, Z: Array) -> Array:
        """Return (B, c) the numbers of terms that are constant along each motion."""
        _, p, starts = self._begun(Z)
        return np.concatenate([p, Z[:, self._groups.symbols.named], starts], axis=1)

    def states(self, Z: Array, smoothing: float) -> Array:
        """Return the states (B, N + 1, nx) of Z (B, len(z)), without sums."""
        return self._linearization.states(Z, smoothing)

    def roll_out(self, z: Array, smoothing: float) -> StagedMotion:
        """Return the motion of z."""
        motion = self._linearization.motion(z, smoothing, self._first)
        u = np.asarray(self.weights @ z).reshape(self.steps, self.input_size)
        if not self._sums:
            return StagedMotion(motion.z, motion.x, u, smoothing, gapless=True)
        x = np.concatenate([motion.x, np.zeros((self.steps + 1, self._sums))], axis=1)
        rows = StepRows(x[:-1], x[1:], motion.u, self._constants(z[None], u[None]), np.arange(self.steps))
        x[1:, motion.x.shape[1] :] = np.cumsum(self._groups.summed(rows)[:, motion.x.shape[1] :], axis=0)
        return StagedMotion(motion.z, x, u, smoothing, gapless=True)

    def follow(
        self,
        policy: AffinePolicy,
        about: Array,
        Z: Array,
        lengths: Array,
        smoothing: float,
        shares: Array | float = 1.0,
    ) -> Followed | None:
        """Return the motions of step lengths (B,); None without a compiler."""
        x, constants, _ = self._distinct(Z)
        if self._sums:
            constants = self._constants_of_steps(Z)
        more = constants.shape[1] - int(self.rollout.p.shape[0])
        sizes = PolicySizes(policy.old.shape[1], policy.new.shape[1], self.input_size, len(self.statics), more)
        if self._rolled is None or self._rolled.sizes != sizes:
            costs = running_costs(self._groups.symbols, self.terms) if self._priced else None
            threads = 1 if self._priced else self._linearization.step.threads
            sums = running_sums(self._groups.symbols, self.terms)
            self._rolled = PolicyRollout(self._linearization.step, sizes, costs, threads, sums)
        if self._rolled.kernel is None:
            return None
        off = Z[:, self.statics] - about[self.statics]
        clock = self._linearization.step.clock
        motions = self._rolled(x, constants, policy, lengths, smoothing, clock, off, shares)
        return motions.x, motions.u, motions.new, motions.cost if self._rolled.costs else None

    _rolled: PolicyRollout | None = None

    def stretch(self, z: Array) -> float:
        """Return the duration of the motion of z divided by that in the file."""
        problem, columns = self.rollout.problem, self.rollout.parameters.columns
        if not problem.free_duration:
            return 1.0
        return float(self.parameters(z[None])[0][columns[STEP_LENGTH]][0]) / problem.simulation.dt

    def prepare(self, slopes: bool) -> None:
        """Implement ``StagedProblem.prepare``."""
        self._linearization.step.prepare(slopes)

    def linearize(self, motion: StagedMotion) -> Linearized:
        """Return the derivatives of all steps."""
        found = self._with_knots(self._linearization.linearize(self._plain(motion)))
        return self._with_sums(found, motion) if self._sums else found

    def linearize_from_end(self, motion: StagedMotion) -> Iterator[Linearized]:
        """Yield linearisations of runs of steps, the last run first; with sums all steps are one run."""
        if self._sums:
            return iter([self.linearize(motion)])
        return map(self._with_knots, self._linearization.linearize_from_end(self._plain(motion)))

    def _with_knots(self, found: Linearized) -> Linearized:
        """Append a zero column for each named knot, on which no step depends."""
        more = self.input_size - self._given
        if not more:
            return found
        b = np.concatenate([found.b, np.zeros((*found.b.shape[:2], more))], axis=2)
        return Linearized(found.a, b, found.c, found.start)

    def _with_sums(self, found: Linearized, motion: StagedMotion) -> Linearized:
        """Append the rows of the sums, which depend on the states before and after each step."""
        n, total, count = self.tangent.size, self.tangent_size, self.steps
        a = np.tile(np.eye(total), (count, 1, 1))
        b, c = (np.zeros((count, total, each.shape[2])) for each in (found.b, found.c))
        a[:, :n, :n], b[:, :n], c[:, :n] = found.a, found.b, found.c
        plain = self._plain(motion)
        p = self.parameters(motion.z[None])[0]
        after = self._linearization.step.step(np.arange(count), plain.x[:-1], plain.u, p, motion.smoothing)
        after = np.concatenate([after, np.zeros((count, self._sums))], axis=1)
        for each in self._sloped(motion, after, SUMS):
            row, steps, weight = n + each.term.number, each.term.steps, each.term.weight
            blocks = each.blocks
            before = blocks.first if each.term.after else blocks.x
            a[steps[:, None], row, before.columns] += weight * before.slopes[:, 0]
            b[steps[:, None], row, blocks.u.columns] += weight * blocks.u.slopes[:, 0]
            c[steps, row] += weight * each.by_s[:, 0]
            if each.term.after:
                x, columns = weight * blocks.x.slopes, blocks.x.columns
                a[steps, row, :n] += (x @ found.a[steps][:, columns])[:, 0]
                b[steps, row] += (x @ found.b[steps][:, columns])[:, 0]
                c[steps, row] += (x @ found.c[steps][:, columns])[:, 0]
        start = np.concatenate([found.start, np.zeros((self._sums, found.start.shape[1]))])
        return Linearized(a, b, c, start)

    def retract(self, X: Array, D: Array) -> Array:
        """Return states (B, nx)."""
        if not self._sums:
            return self.tangent.retract(X, D)
        moved = self.tangent.retract(X[:, : -self._sums], D[:, : -self._sums])
        return np.concatenate([moved, X[:, -self._sums :] + D[:, -self._sums :]], axis=1)

    def difference(self, X: Array, Y: Array) -> Array:
        """Return tangents (B, n)."""
        if not self._sums:
            return self._linearization.step.difference(X, Y)
        apart = self._linearization.step.difference(X[:, : -self._sums], Y[:, : -self._sums])
        return np.concatenate([apart, Y[:, -self._sums :] - X[:, -self._sums :]], axis=1)

    def measure(self, Z: Array, X: Array, U: Array) -> tuple[Array, Array]:
        """Return objectives (B,) and limits (B, c)."""
        objective, limits = np.zeros(len(Z)), [np.zeros((len(Z), 0))]
        values = self._groups.values(X, U[:, :, : self._given], self._constants(Z, U))
        for term, each in values:
            if term.kind == "limit":
                limits.append(each.reshape(len(Z), -1))
                continue
            with np.errstate(over="ignore"):  # a motion that blows up costs inf
                total = np.einsum("btr,btr->b", each, each) if term.kind == "squares" else each.sum(axis=(1, 2))
                objective += term.weight * total
        return objective, np.concatenate(limits, axis=1)

    def expand(self, motion: StagedMotion, multipliers: Array, penalties: Array) -> Expansion:
        """Return the augmented objective to second order."""
        sizes = self.steps, self.tangent_size, self.input_size, len(self.statics)
        sums, first = ExpansionSums(sizes, self._of_constants(motion), self._knots), 0
        stacked = not len(self._knots[0]) and not self._off_tangent_slopes(motion).any()
        if stacked:
            constants, u = self._constants(motion.z[None], motion.u[None]), motion.u[:, : self._given]
            for stack in self._stacks:
                stack.add(sums, motion.x, u, constants, self._groups.clock, multipliers, penalties)
        for each in self._sloped(motion, motion.x[1:], COSTS if stacked else TERMS):
            term, value = each.term, each.value
            if term.kind == "cost":
                sums.value += term.weight * float(np.sum(value))
                sums.slope(term, each.blocks, each.by_s, np.full(value.shape, term.weight))
                self._curve(sums, each, np.full(len(value), term.weight))
                continue
            weight = np.full(value.shape, term.weight)
            if term.kind == "limit":
                part = slice(first, first + value.size)
                first = part.stop
                multiplier, penalty = multipliers[part].reshape(value.shape), penalties[part].reshape(value.shape)
                lower, upper = self.lower[part].reshape(value.shape), self.upper[part].reshape(value.shape)
                moved = value + multiplier / np.where(penalty > 0, penalty, 1.0)
                value = moved - np.clip(moved, lower, upper)
                weight = penalty * (value != 0) / 2
            if weight.any():
                sums.value += float(np.sum(weight * value**2))
                sums.slope(term, each.blocks, each.by_s, 2 * weight * value)
                sums.curvature(term, each.blocks, each.by_s, 2 * weight)
        if self._sums:
            worth = sums.x[-1, -self._sums :].copy()
            for each in self._sloped(motion, motion.x[1:], SUMS):
                self._curve(sums, each, np.full(len(each.value), each.term.weight * worth[each.term.number]))
        return sums.expansion()

    @cached_property
    def _stacks(self) -> list[SquareStack]:
        bounds, static = (self.lower, self.upper), bool(len(self.statics))
        return square_stacks(self._groups.symbols, self.terms, bounds, static, self._evaluated)

    def _curve(self, sums: ExpansionSums, each: SlopedTerm, weight: Array) -> None:
        """Add the positive part of the second derivative of weight (T,) times a number."""
        rows = each.slopes.curvature(each.found, np.sign(weight))
        if rows is not None:
            share = np.broadcast_to(np.abs(weight)[:, None], rows.x.slopes.shape[:2])
            sums.curvature(each.term, rows, sums.by_statics(rows), share)

    @property
    def recursion(self) -> CompiledRecursion | None:
        """Implement ``StagedProblem.recursion``."""
        from symphys.codegen.runtime.riccati import compiled_riccati  # late: it needs what writes C

        return compiled_riccati() if self._linearization.step.backend in PRECISIONS else None

    def limit_slopes(self, motion: StagedMotion) -> tuple[Array, Any, Any, Any]:
        """Return limits, and their derivatives by all states, inputs and static entries."""
        n, m, s, first = self.tangent_size, self.input_size, len(self.statics), 0
        values, by_s = [np.zeros(0)], [np.zeros((0, s))]
        x, u = (_Entries(), _Entries())
        sums = ExpansionSums((0, 0, 0, 0), np.zeros((0, 0)), self._knots)
        for each in self._sloped(motion, motion.x[1:], LIMITS):
            term, blocks = each.term, each.blocks
            rows = first + np.arange(each.value.size).reshape(each.value.shape)
            first += each.value.size
            values.append(each.value.ravel())
            by_s.append(each.by_s.reshape(each.value.size, s))
            x.add(rows, term.states[:, None, None] * n + blocks.x.columns, blocks.x.slopes)
            x.add(rows, term.steps[:, None, None] * n + blocks.first.columns, blocks.first.slopes)
            u.add(rows, term.steps[:, None, None] * m + blocks.u.columns, blocks.u.slopes)
            knots, places = sums.knots_of(blocks.constants)
            u.add(rows, (places[:, 0] * m + places[:, 1])[None, None], knots)
        by_state, by_input = x.matrix(first, (self.steps + 1) * n), u.matrix(first, self.steps * m)
        from scipy.sparse import csr_array  # late: most solvers take no problem step by step

        return np.concatenate(values), by_state, by_input, csr_array(np.concatenate(by_s))

    def _off_tangent_slopes(self, motion: StagedMotion) -> Array:
        """Return (nx, s) the derivatives of the first state by static entries, off its tangent."""
        return self._linearization.start_slopes(self._plain(motion))[1] if len(self.statics) else np.zeros((0, 0))

    def _sloped(self, motion: StagedMotion, after: Array, kinds: frozenset[Kind]) -> list[SlopedTerm]:
        """Return terms of some kinds with slopes, from a motion to the states ``after`` (N, nx)."""
        if not any(term.kind in kinds for term in self.terms):
            return []
        constants = self._constants(motion.z[None], motion.u[None])
        u, ticks = motion.u[:, : self._given], np.arange(self.steps)
        rows = StepRows(motion.x[:-1], after, u, constants, ticks, self._groups.clock)
        of_constants, left = self._of_constants(motion), self._off_tangent_slopes(motion)
        result = []
        for term, slopes, found in self._groups.slopes(rows, kinds):
            value, blocks = slopes.values(found)
            by_s = blocks.constants.slopes @ of_constants[blocks.constants.columns]
            if left.any() and term.steps[0] == 0:
                by_s[0] += self._groups.full_state_slopes(term, rows) @ left
            result.append(SlopedTerm(term, value, blocks, by_s, slopes, found))
        return result

    def _plain(self, motion: StagedMotion) -> StagedMotion:
        """Return the motion without sums and knots."""
        size = motion.x.shape[1] - self._sums
        u = motion.u[:, : self._given]
        return StagedMotion(motion.z, motion.x[:, :size], u, motion.smoothing, motion.gapless)

    def _of_constants(self, motion: StagedMotion) -> Array:
        """Return (c, s) derivatives of the constants of terms by the static entries of z."""
        if not len(self.statics):
            return np.zeros((int(self._groups.symbols.constants.shape[0]), 0))
        of_p = self._linearization.start_slopes(self._plain(motion))[2]
        named = (self._groups.symbols.named[:, None] == self.statics[None, :]).astype(float)
        starts = self._groups.symbols.sums.started_slopes(motion.z, self.statics.tolist())
        return np.concatenate([of_p, named, starts])


class _Entries:
    """Collects the entries of a sparse matrix."""

    def __init__(self) -> None:
        self.rows, self.columns, self.values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]

    def add(self, rows: Ints, columns: Ints, values: Array) -> None:
        """Add blocks (T, r, c) at rows (T, r) and columns (T or 1, 1, c)."""
        self.rows.append(np.broadcast_to(rows[:, :, None], values.shape).ravel())
        self.columns.append(np.broadcast_to(columns, values.shape).ravel())
        self.values.append(values.ravel())

    def matrix(self, rows: int, columns: int) -> Any:
        """Return a scipy.sparse.csr_array (rows, columns)."""
        from scipy.sparse import csr_array

        places = np.concatenate(self.rows), np.concatenate(self.columns)
        return csr_array((np.concatenate(self.values), places), shape=(rows, columns))


def _input_weights(rollout: Rollout, named: Ints, statics: Ints) -> tuple[Any, tuple[Ints, Ints]]:
    """Return (N * m, len(z)) sparse: u = weights @ z; and which of ``named`` are knots, with step and input.

    The inputs of a step are those of the rollout, then the named knots that begin to act there.
    """
    from scipy.sparse import csr_array

    m, steps = rollout.controls, rollout.steps
    u = ca.vec(rollout.given[:m, :])
    slope = ca.DM(ca.Function("u", [rollout.z], [ca.jacobian(u, rollout.z)])(0))
    rows, columns = (np.array(each, np.int64) for each in slope.sparsity().get_triplet())
    begins = np.full(int(slope.shape[1]), steps - 1)
    np.minimum.at(begins, columns, rows // max(m, 1))
    which = np.flatnonzero(~np.isin(named, statics))
    first, taken = begins[named[which]], dict[int, int]()
    places = []
    for step in first.tolist():
        places.append((step, m + taken.get(step, 0)))
        taken[step] = taken.get(step, 0) + 1
    inputs = m + max(taken.values(), default=0)
    at = np.array(places, np.int64).reshape(-1, 2)
    rows = np.concatenate([rows // max(m, 1) * inputs + rows % max(m, 1), at[:, 0] * inputs + at[:, 1]])
    columns = np.concatenate([columns, named[which]])
    values = np.concatenate([np.array(slope.nonzeros()), np.ones(len(which))])
    return csr_array((values, (rows, columns)), shape=(steps * inputs, int(slope.shape[1]))), (which, at)


def guessed_states(stages: RolloutStages, guess: GuessedMotion, z: Array, ticks: Ints, smoothing: float) -> Array:
    """Return states (M, nx) at the ticks (M,), each at least 1.

    What is named, and its rate, is moved along the tangent, so that joints stay closed; all else is that of the rollout
    of z (n,), of its first step from where on it is not finite.
    """
    moved, dt = stages.roll_out(z, smoothing).x, stages.rollout.dt
    states, times = moved[ticks], np.asarray(ticks * dt, float)
    states[~np.isfinite(states).all(axis=1)] = moved[1]
    off, names = np.zeros((len(ticks), stages.tangent_size)), list(stages.tangent.names)
    now, stretch = _quantities(stages, guess, states, z), stages.stretch(z)

    def move(name: str, ahead: Array) -> None:
        for entry, column in zip(_entries(name, names), ahead.T, strict=True):
            off[:, entry] = column

    sizes = guessable(stages.rollout.world)
    for name in guess.columns:
        there = guess.at(name, times)
        move(name, turn_between(now[name], there) if is_orientation(name) else there - now[name])
        rate = rate_of(name, sizes)
        if rate and rate not in guess.columns:
            move(rate, guess.rate(name, times, dt) / stretch - now[rate])
    return stages.retract(states, off)


def _entries(name: str, names: list[str]) -> Iterator[int]:
    """Return the columns of a quantity in the tangent, where all joints have coordinates and rates."""
    owner, _, field = name.rpartition(".")
    jointed = f"{owner}.coordinate[0]" in names
    words = {"angle": "coordinate", "position": "coordinate", "orientation": "coordinate", "angular_velocity": "rate"}
    field = words.get(field, field) if jointed else "turn" if field == "orientation" else field
    count = sum(each.startswith(f"{owner}.{field}[") for each in names)
    return (names.index(f"{owner}.{field}[{k}]") for k in range(count))


def _quantities(stages: RolloutStages, guess: GuessedMotion, states: Array, z: Array) -> dict[str, Array]:
    """Return (M, components) of all quantities of the owners of the guessed ones."""
    rollout = stages.rollout
    world, layout = rollout.world, Layout(rollout.world)
    x, p = ca.SX.sym("x", layout.size), ca.SX.sym("p", int(rollout.p.shape[0]))
    owners = {name.rpartition(".")[0] for name in guess.columns}
    found = {name: x[layout[name]] for name in layout.names() if name.rpartition(".")[0] in owners}
    of_joints = (n for n, s in named_sensors(world).items() if s.kind.owner == "joint" and s.owner.name in owners)
    found |= sensor_readings(SensedState(world, x), frozenset(of_joints))
    for joint in ball_joints(world):
        if joint.name in owners:
            bodies = [world.bodies[i].name for i in joint.bodies]
            fields = ("orientation", "angular_velocity")
            parts = (tuple(x[layout[f"{body}.{field}"]] for body in bodies) for field in fields)
            found |= dict(zip((f"{joint.name}.{field}" for field in fields), joint_turn(joint, *parts), strict=True))
    symbols = ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)
    values = [ca.densify(ca.substitute(ca.SX(value), symbols, p)) for value in found.values()]
    function = ByColumns(ca.Function("named", [x, p], values))
    parameters = np.tile(stages.parameters(z[None]), (len(states), 1))
    rows = function(states[:, : layout.size].T, parameters.T)
    return {name: row.T for name, row in zip(found, rows, strict=True)}
