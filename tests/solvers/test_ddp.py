"""Differential dynamic programming on linear systems with quadratic costs, where one step is the whole way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import scipy.sparse
from numpy.typing import NDArray
from tools.single_steps import SingleSteps

from symphys.shooting import Expansion, Linearized, StagedMotion
from symphys.solvers.ddp.backward_pass import Bounds, backward_pass
from symphys.solvers.ddp.box_qp import solve_box_qp
from symphys.solvers.ddp.forward_pass import forward_pass
from symphys.solvers.ddp.knots import PaddedKnots, knot_steps
from symphys.types import Array


@dataclass
class LinearChain(SingleSteps):
    """x' = A x + B u + C s and x0 = offset + S s, with a quadratic cost of (x, u) and of (x', u) in every step."""

    weights: Any
    statics: NDArray[np.int64]
    steps: int = 7
    state_size: int = 3
    tangent_size: int = 3
    input_size: int = 2
    squares: bool = True
    lower: Array = field(default_factory=lambda: np.zeros(0))
    upper: Array = field(default_factory=lambda: np.zeros(0))
    penalties: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Draw the numbers."""
        rng, n, m, s = np.random.default_rng(1), self.tangent_size, self.input_size, len(self.statics)
        self.A, self.B = rng.normal(size=(n, n)) / 2, rng.normal(size=(n, m))
        self.C, self.S = rng.normal(size=(n, s)), rng.normal(size=(n, s))
        whole = rng.normal(size=(n + m, n + m))
        self.H = whole.T @ whole + np.eye(n + m)
        self.Y = rng.normal(size=(m, n)) / 10
        self.offset = rng.normal(size=n)

    def start(self, Z: Array) -> Array:
        """First states."""
        return np.asarray(self.offset + Z[:, self.statics] @ self.S.T)

    def step(self, k: int, X: Array, U: Array, Z: Array, smoothing: float) -> Array:
        """States after step k."""
        return np.asarray(X @ self.A.T + U @ self.B.T + Z[:, self.statics] @ self.C.T)

    def roll_out(self, z: Array, smoothing: float) -> StagedMotion:
        """The motion of z."""
        u = (self.weights @ z).reshape(self.steps, -1)
        x = [self.start(z[None])]
        for k in range(self.steps):
            x.append(self.step(k, x[-1], u[None, k], z[None], 0.0))
        return StagedMotion(z, np.concatenate(x), u, smoothing)

    def difference(self, X: Array, Y: Array) -> Array:
        """Of flat states."""
        return Y - X

    def objective(self, z: Array) -> float:
        """Of a whole motion."""
        motion = self.roll_out(z, 0.0)
        both = np.concatenate([motion.x[:-1], motion.u], axis=1)
        cross = np.einsum("km,mn,kn->", motion.u, self.Y, motion.x[1:])
        end = motion.x[-1] @ self.H[:3, :3] @ motion.x[-1] / 2
        return float(np.einsum("ki,ij,kj->", both, self.H, both) / 2 + cross + end + z[self.statics] @ z[self.statics])

    def linearize(self, motion: StagedMotion) -> Linearized:
        """The matrices, at every step."""
        return Linearized(*(np.repeat(each[None], self.steps, axis=0) for each in (self.A, self.B, self.C)), self.S)

    def expand(self, motion: StagedMotion) -> Expansion:
        """The cost is its own expansion."""
        n, m, s, N = self.tangent_size, self.input_size, len(self.statics), self.steps
        q, r, cross = self.H[:n, :n], self.H[n:, n:], self.H[n:, :n]
        x = motion.x @ q
        x[:-1] += motion.u @ cross
        x[1:] += motion.u @ self.Y
        u = motion.u @ r + motion.x[:-1] @ cross.T + motion.x[1:] @ self.Y.T
        static = motion.z[self.statics]
        many = [np.repeat(each[None], N, axis=0) for each in (r, cross, self.Y)]
        return Expansion(
            self.objective(motion.z), x, np.repeat(q[None], N + 1, axis=0), u, *many, 2 * static, 2 * np.eye(s),
            np.zeros((N + 1, s, n)), np.zeros((N, s, m)),
        )  # fmt: skip


def chain(kind: str) -> LinearChain:
    """A chain whose knots act one a step, over several steps, or are interpolated; the last entries are static."""
    steps, m = 7, 2
    rows = {
        "each": np.eye(steps),
        "held": np.repeat(np.eye(3), [3, 3, 1], axis=0),
        "linear": np.array([[1, 0, 0], [2, 1, 0], [1, 2, 0], [0, 3, 0], [0, 2, 1], [0, 1, 2], [0, 0, 3]]) / 3,
        "idle": np.repeat(np.eye(4)[:, :3], [2, 2, 1, 2], axis=0),
    }[kind]
    weights = np.kron(rows, np.eye(m))
    whole = np.concatenate([weights, np.zeros((len(weights), 2))], axis=1)
    statics = np.arange(weights.shape[1], whole.shape[1])
    return LinearChain(scipy.sparse.csr_array(whole), statics)


@pytest.mark.parametrize("kind", ["each", "held", "linear", "idle"])
def test_one_step_reaches_the_minimum_of_a_linear_chain(kind: str) -> None:
    problem = chain(kind)
    size = problem.weights.shape[1]
    z = np.random.default_rng(2).normal(size=size)
    free = Bounds(np.full(size, -np.inf), np.full(size, np.inf), np.ones(size))
    motion, knots = problem.roll_out(z, 0.0), knot_steps(problem)
    arguments = problem.linearize_from_end(motion), problem.expand(motion), knots, problem.statics, free
    policy = backward_pass(*arguments, 0.0)
    assert policy is not None
    eye, h = np.eye(size), 1.0
    values = [[problem.objective(z + h * (a + b)) for b in (*eye, -eye[0] * 0)] for a in (*eye, -eye[0] * 0)]
    table, here = np.array(values), problem.objective(z)
    hessian = (table[:-1, :-1] - table[:-1, -1:] - table[-1:, :-1] + here) / h**2
    slope = np.array([(problem.objective(z + e) - problem.objective(z - e)) / 2 for e in eye])
    np.testing.assert_allclose(policy.gradient, slope, rtol=1e-9, atol=1e-9)
    padded = PaddedKnots.of(knots, z + free.down, z + free.up)
    best = z - np.linalg.solve(hessian, slope)
    found = forward_pass(problem, motion, policy, padded, np.array([1.0, 0.5]))
    np.testing.assert_allclose(found.z[0], best, rtol=1e-7, atol=1e-8)
    fall = here - problem.objective(found.z[0])
    assert fall == pytest.approx(-(policy.first + policy.second), rel=1e-9)
    half = here - problem.objective(found.z[1])
    assert half == pytest.approx(-(policy.first / 2 + policy.second / 4), rel=1e-9)


def test_bounds_hold_and_their_knots_do_not_answer() -> None:
    problem = chain("each")
    size = problem.weights.shape[1]
    z = np.zeros(size)
    lower, upper = np.full(size, -0.05), np.full(size, 0.05)
    motion, knots = problem.roll_out(z, 0.0), knot_steps(problem)
    bounds, padded = Bounds(lower, upper, np.ones(size)), PaddedKnots.of(knots, lower, upper)
    for _ in range(30):
        arguments = problem.linearize_from_end(motion), problem.expand(motion), knots, problem.statics
        policy = backward_pass(*arguments, Bounds(lower - motion.z, upper - motion.z, bounds.scale), 1e-9)
        assert policy is not None
        motion = forward_pass(problem, motion, policy, padded, np.ones(1)).motion(0, 0.0)
    assert np.all(motion.z >= lower) and np.all(motion.z <= upper)
    pushed = np.clip(motion.z - policy.gradient, lower, upper) - motion.z
    np.testing.assert_allclose(pushed, 0.0, atol=1e-8)
    assert np.sum((motion.z == lower) | (motion.z == upper)) > 3


def test_a_box_qp_meets_its_conditions() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        root = rng.normal(size=(6, 6))
        hessian, gradient = root.T @ root + 0.01 * np.eye(6), rng.normal(size=6)
        lower, upper = -rng.uniform(0.01, 0.5, 6), rng.uniform(0.01, 0.5, 6)
        found = solve_box_qp(hessian, gradient, lower, upper, np.zeros(6))
        assert found is not None
        slope = gradient + hessian @ found.step
        pushed = np.clip(found.step - slope, lower, upper) - found.step
        np.testing.assert_allclose(pushed, 0.0, atol=1e-8)
        assert np.all(np.abs(slope[found.free]) < 1e-8)
    assert solve_box_qp(-np.eye(2), np.ones(2), -np.ones(2), np.ones(2), np.zeros(2)) is None
