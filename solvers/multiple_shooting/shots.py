"""All intervals of a horizon simulated from their nodes, and derivatives of the results by the local vectors.

The states of an interval follow from its node by the problem's own steps; the slopes of step after step are products of
the problem's step Jacobians A, B, C. A defect is measured in the tangent of the reference of the next node:
d[j + 1] - F[j], with F[j] = difference(reference[j + 1], end of interval j). So its slope by d[j + 1] is exactly 1.
Differences of angles lie within half a turn, and nodes go further than that from their references. So where the two
are turns apart, F[j] is measured from the node itself: d[j + 1] + difference(node j + 1, end of interval j). Entries of
rotations are left out, since these get new references.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from symphys.records import dataclass
from symphys.shooting import Expansion, Linearized, StagedMotion, StagedProblem
from symphys.shooting.staged_problem import Sparse
from symphys.solvers.multiple_shooting.chart import pulled, transported
from symphys.solvers.multiple_shooting.grid import IntervalGrid
from symphys.types import Array, Ints

SAME_STEP_TOLERANCE = 1e-10
"""Relative or absolute difference of results below which steps are the same function."""


class IntervalSteps:
    """Simulates several intervals at once, in one batch where all steps are the same function."""

    def __init__(self, problem: StagedProblem, motion: StagedMotion) -> None:
        """Compare, along a motion, step k with step 0: steps that depend on time differ."""
        self.problem, self.alike = problem, True
        together = self(np.arange(problem.steps), motion.x[:-1], motion.u, motion.z, motion.smoothing)
        self.alike = False
        alone = self(np.arange(problem.steps), motion.x[:-1], motion.u, motion.z, motion.smoothing)
        self.alike = np.allclose(together, alone, rtol=SAME_STEP_TOLERANCE, atol=SAME_STEP_TOLERANCE, equal_nan=True)

    def __call__(self, steps: Ints, X: Array, U: Array, z: Array, smoothing: float) -> Array:
        """Return the states (B, nx) after steps (B,) from X (B, nx) with U (B, m) and z (len(z),)."""
        Z = np.broadcast_to(z, (len(X), len(z)))
        if self.alike:
            return self.problem.step(0, X, U, Z, smoothing)
        each = zip(steps.tolist(), X, U, strict=True)
        return np.concatenate([self.problem.step(k, x[None], u[None], Z[:1], smoothing) for k, x, u in each])


@dataclass(frozen=True)
class ShootingPlan:
    """The part that all evaluations share.

    Attributes:
        problem: the problem step by step.
        grid: its intervals.
        steps: of several intervals.
        reference: (M, nx) states at which the tangents of nodes 1 to M begin.
        smoothing: of the steps.
        curved: entries of tangents, see ``curved_columns``.
    """

    problem: StagedProblem
    grid: IntervalGrid
    steps: IntervalSteps
    reference: Array
    smoothing: float
    curved: Ints


class Shots:
    """One evaluation: of z, inputs u (N, m) and tangents d (M, n) of the nodes; slopes on demand."""

    def __init__(self, plan: ShootingPlan, z: Array, u: Array, d: Array) -> None:
        """Simulate all intervals."""
        self.plan, self.d = plan, d
        problem, starts = plan.problem, plan.grid.starts
        self.nodes = problem.retract(plan.reference, d)
        first = np.concatenate([problem.start(z[None]), self.nodes])
        x = np.empty((problem.steps + 1, problem.state_size))
        x[starts] = first
        ends, lengths = first[:-1].copy(), np.diff(starts)
        for ahead in range(int(lengths.max())):
            going = np.flatnonzero(lengths > ahead)
            at = starts[going] + ahead
            ends[going] = plan.steps(at, ends[going], u[at], z, plan.smoothing)
            inside = going[lengths[going] > ahead + 1]
            x[starts[inside] + ahead + 1] = ends[inside]
        self.ends = ends
        self.motion = StagedMotion(z, x, u, plan.smoothing)
        self.reached = problem.difference(plan.reference, ends)
        from_nodes = d + problem.difference(self.nodes, ends)
        from_nodes[:, plan.curved] = self.reached[:, plan.curved]
        turns = ~(np.abs(from_nodes - self.reached) < 1)
        self.reached[turns] = from_nodes[turns]
        """(M, n): F, where the intervals end in the tangents of the references."""

    @property
    def defects(self) -> Array:
        """Return the defects (M, n): d[j + 1] - F[j]."""
        return self.d - self.reached

    @cached_property
    def measured(self) -> tuple[float, Array]:
        """Return the objective and the limits (c,)."""
        motion = self.motion
        objective, limits = self.plan.problem.measure(motion.z[None], motion.x[None], motion.u[None])
        return float(objective[0]), limits[0]

    @cached_property
    def expansion(self) -> Expansion:
        """Return the value of the objective."""
        none = np.zeros(len(self.plan.problem.lower))
        return self.plan.problem.expand(self.motion, none, none)

    @cached_property
    def turns(self) -> Array:
        """Return (M, n, n): the nodes in their own tangents by d."""
        return pulled(self.plan.problem, self.plan.reference, self.nodes, self.d, self.plan.curved)

    @cached_property
    def slopes(self) -> list[StageSlopes]:
        """Return the slopes of all stages."""
        linearized = self.plan.problem.linearize(self.motion)
        transport = transported(self.plan.problem, self.plan.reference, self.ends, self.plan.curved)
        return [
            stage_slopes(self.plan.grid, stage, linearized, self.turns, transport)
            for stage in range(self.plan.grid.intervals + 1)
        ]

    @cached_property
    def gradients(self) -> list[Array]:
        """Return the gradient of the objective by the local vector of each stage."""
        e, grid, found = self.expansion, self.plan.grid, []
        for stage, slopes in enumerate(self.slopes):
            states, steps = list(grid.states(stage)), slice(grid.starts[stage], grid.starts[stage] + len(slopes.inputs))
            gradient = np.einsum("ki,kiv->v", e.x[states], slopes.states)
            gradient += np.einsum("ki,kiv->v", e.u[steps], slopes.inputs)
            if stage == 0:
                gradient[grid.static_part(0)] += e.s
            found.append(gradient)
        return found

    def limit_slopes(self, rows: list[Ints]) -> list[Array]:
        """Return slopes of the limits ``rows`` of each stage by its local vector; statics in a row's first stage.

        RuntimeError where a limit depends on a stage that ``rows`` does not give it.
        """
        grid, n, m = self.plan.grid, self.plan.problem.tangent_size, self.plan.problem.input_size
        _, by_state, by_input, by_static = self.plan.problem.limit_slopes(self.motion)
        stages = range(grid.intervals + 1)
        firsts = [int(grid.states(stage).start) for stage in stages]
        x = dense_blocks(by_state, rows, [(f * n, grid.states(j).stop * n) for j, f in enumerate(firsts)])
        u = dense_blocks(by_input, rows, [(f * m, (f + len(self.slopes[j].inputs)) * m) for j, f in enumerate(firsts)])
        static, found, seen = by_static.toarray(), [], np.zeros(by_static.shape[0], bool)
        for stage, (slopes, here) in enumerate(zip(self.slopes, rows, strict=True)):
            size = grid.local_size(stage)
            block = x[stage] @ slopes.states.reshape(-1, size) + u[stage] @ slopes.inputs.reshape(-1, size)
            fresh = ~seen[here]
            block[fresh, grid.static_part(stage)] += static[here[fresh]]
            seen[here] = True
            found.append(block)
        return found

    def gauss_newton(self) -> Iterator[Array]:
        """Return the Gauss-Newton Hessian of the objective by the local vector of each stage."""
        e, grid = self.expansion, self.plan.grid
        for stage, slopes in enumerate(self.slopes):
            states, count = list(grid.states(stage)), len(slopes.inputs)
            steps = slice(grid.starts[stage], grid.starts[stage] + count)
            x, u, statics = slopes.states, slopes.inputs, grid.static_part(stage)
            total = np.einsum("kiv,kiw->vw", x, e.xx[states] @ x) + np.einsum("kiv,kiw->vw", u, e.uu[steps] @ u)
            mixed = np.einsum("kiv,kiw->vw", u, e.ux[steps] @ x[:count])
            mixed[statics] += np.einsum("ksi,kiw->sw", e.sx[states], x) + np.einsum("ksi,kiw->sw", e.su[steps], u)
            total += mixed + mixed.T
            if stage == 0:
                total[statics, statics] += e.ss
            yield total


def dense_blocks(matrix: Sparse, rows: list[Ints], spans: list[tuple[int, int]]) -> list[Array]:
    """Return rows and columns (first, one past the last) of each block; spans ascend without gaps.

    RuntimeError where the matrix has an entry in a column of a block, but not in its rows.
    """
    entries = matrix.tocoo()
    (row, column), value = entries.coords, entries.data
    owner = np.searchsorted([last for _, last in spans], column, side="right")
    order = np.argsort(owner, kind="stable")
    ends = np.searchsorted(owner[order], np.arange(len(spans) + 1))
    rank = np.full(matrix.shape[0], -1)
    found = []
    for block, (here, (first, last)) in enumerate(zip(rows, spans, strict=True)):
        own = order[ends[block] : ends[block + 1]]
        rank[here] = np.arange(len(here))
        if np.any(rank[row[own]] < 0):
            raise RuntimeError("a constraint depends on other steps than it did at the guess")
        dense = np.zeros((len(here), last - first))
        dense[rank[row[own]], column[own] - first] = value[own]
        rank[here] = -1
        found.append(dense)
    return found


@dataclass(frozen=True)
class StageSlopes:
    """Slopes of a stage by its local vector (v,).

    Attributes:
        states: (k, n, v) each state in its own tangent.
        inputs: (k, m, v) the inputs; of the last stage none.
        reached: (n, v) F; of the last stage none.
    """

    states: Array
    inputs: Array
    reached: Array


def stage_slopes(grid: IntervalGrid, stage: int, linearized: Linearized, turns: Array, transport: Array) -> StageSlopes:
    """Chain the slopes of an interval's steps."""
    n, v = grid.tangent_size, grid.local_size(stage)
    statics, now = grid.static_part(stage), np.zeros((n, v))
    if stage:
        now[:, :n] = turns[stage - 1]
    else:
        now[:, statics] = linearized.start
    m = linearized.b.shape[2]
    if stage == grid.intervals:
        return StageSlopes(now[None], np.zeros((0, m, v)), np.zeros((0, v)))
    steps = grid.steps(stage)
    states, inputs = np.zeros((len(steps), n, v)), np.zeros((len(steps), m, v))
    inputs[:, :, grid.knot_part(stage)] = grid.shares[stage]
    for ahead, k in enumerate(steps):
        states[ahead] = now
        now = linearized.a[k] @ now + linearized.b[k] @ inputs[ahead]
        now[:, statics] += linearized.c[k]
    return StageSlopes(states, inputs, transport[stage] @ now)
