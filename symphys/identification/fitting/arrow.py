"""Normal equations of an arrow, and their solution by the Schur complement of the own blocks.

In scaled numbers y = x / scale, with H = J' C J and g = J' psi of the merit sum rho(r),

    [ A    B_1   B_2  ... ] [ shared ]     [ g  ]
    [ B_1' D_1            ] [ own_1  ] = - [ g_1]
    [ B_2'      D_2       ] [ own_2  ]     [ g_2]

S = A - sum B_k D_k^-1 B_k' has the size of the shared numbers. Time and memory are linear in the recordings (Golub and
Pereyra 1973; in bundle adjustment: Triggs et al. 2000, section 6.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.interface import Array, Bools, FitParameters, Ints, RecordedResiduals, Rows

EPS = float(np.finfo(float).eps)
NO_INFORMATION = 1e-10
"""Share of the largest eigenvalue below which an eigenvalue of a Schur complement is rounding."""
Weighting = Callable[[Array], Array]
"""Of residuals (m,): (m,) weights of the rows of the Jacobian in a square matrix."""


@dataclass(frozen=True, eq=False)
class ArrowSystem:
    """The merit about a point, in scaled numbers; K recordings, n = s + o columns, the shared ones first.

    Attributes:
        costs: (K,) sum of rho of each recording, with the priors of its own numbers.
        blocks: (K, n, n) J' C J of each recording.
        gradients: (K, n) J' psi of each recording: half the derivative of its cost.
        prior_cost, prior_block, prior_gradient: of the priors of the shared numbers: a number, (s,) diagonal, (s,).
    """

    costs: Array
    blocks: Array
    gradients: Array
    prior_cost: float
    prior_block: Array
    prior_gradient: Array

    @property
    def s(self) -> int:
        """The number of shared numbers."""
        return len(self.prior_block)

    @property
    def cost(self) -> float:
        """Of all recordings and priors."""
        return float(self.costs.sum()) + self.prior_cost

    @property
    def finite(self) -> bool:
        """Whether every number is."""
        return all(bool(np.isfinite(each).all()) for each in (self.costs, self.blocks, self.gradients))

    @property
    def reference(self) -> Array:
        """(s,) diagonal of A: what rounding in the Schur complement S is small against."""
        return np.asarray(np.einsum("kii->i", self.blocks[:, : self.s, : self.s]) + self.prior_block)

    @property
    def shared_gradient(self) -> Array:
        """(s,) half the derivative of the cost by the shared numbers."""
        return np.asarray(self.gradients[:, : self.s].sum(axis=0) + self.prior_gradient)

    @property
    def own_gradient(self) -> Array:
        """(K, o) half the derivative by the own numbers."""
        return self.gradients[:, self.s :]

    def reduced(self, damping: float, free_own: Bools) -> tuple[Array, Array, Array]:
        """The own numbers eliminated, recording by recording.

        Returns:
            (K, s, s) share of each recording in S, (K, s) its share in the right side, and (K, o, s + 1) D^-1 [B', g],
            from which own steps follow. Numbers that are not free have zeros there.
        """
        s, o = self.s, self.blocks.shape[1] - self.s
        if not o:
            return self.blocks, self.gradients, np.zeros((len(self.costs), 0, s + 1))
        mask = free_own.astype(float)
        square = self.blocks[:, s:, s:] * mask[:, :, None] * mask[:, None, :]
        coupling = self.blocks[:, :s, s:] * mask[:, None, :]
        floor = 4 * o * EPS * np.trace(square, axis1=1, axis2=2)
        floor = np.where(floor > 0, floor, np.finfo(float).tiny)
        added = np.where(free_own, np.maximum(damping, floor)[:, None], 1.0)
        square = square + added[:, :, None] * np.eye(o)
        sides = np.concatenate([coupling.transpose(0, 2, 1), (self.own_gradient * mask)[:, :, None]], axis=2)
        solved = np.linalg.solve(square, sides)
        across = coupling @ solved
        return self.blocks[:, :s, :s] - across[:, :, :s], self.gradients[:, :s] - across[:, :, s], solved

    def step(self, damping: float, free_shared: Bools, free_own: Bools) -> tuple[Array, Array]:
        """-(H + damping I)^-1 g over the free numbers: (s,) and (K, o), zero where not free."""
        shares, sides, solved = self.reduced(damping, free_own)
        square = shares.sum(axis=0) + np.diag(self.prior_block)
        side = sides.sum(axis=0) + self.prior_gradient
        shared = np.zeros(self.s)
        if free_shared.any():
            square, side = square[np.ix_(free_shared, free_shared)], side[free_shared]
            size = np.sqrt(self.reference[free_shared])
            shared[free_shared] = -damped_solution(square, side, damping, np.ones_like(size) if damping else size)
        return shared, -(solved[:, :, self.s] + solved[:, :, : self.s] @ shared)

    def own_step(self, shared: Array, damping: Array, free_own: Bools) -> Array:
        """(K, o): the step of the own numbers beside a step (s,) of the shared ones, with a damping (K,) of each."""
        s, mask = self.s, free_own.astype(float)
        square = self.blocks[:, s:, s:] * mask[:, :, None] * mask[:, None, :]
        side = (self.own_gradient + np.einsum("ksi,s->ki", self.blocks[:, :s, s:], shared)) * mask
        added = np.where(free_own, damping[:, None], 1.0)
        square = square + added[:, :, None] * np.eye(square.shape[1])
        return -np.asarray(np.linalg.solve(square, side[:, :, None])[:, :, 0])

    def expected_falls(self, shared: Array, own: Array) -> Array:
        """(K,): by how much the quadratic models lower the costs of recordings with a step (s,), (K, o)."""
        both = np.concatenate([np.broadcast_to(shared, (len(own), self.s)), own], axis=1)
        bent = np.einsum("ki,kij,kj->k", both, self.blocks, both)
        return np.asarray(-2 * np.sum(both * self.gradients, axis=1) - bent)

    def expected_fall(self, shared: Array, own: Array) -> float:
        """By how much the quadratic model lowers the cost with a step (s,), (K, o)."""
        priors = 2 * float(shared @ self.prior_gradient) + float(shared**2 @ self.prior_block)
        return float(self.expected_falls(shared, own).sum()) - priors


def damped_solution(square: Array, side: Array, damping: float, size: Array) -> Array:
    """(n,) (S + damping I)^-1 side of a symmetric S (n, n); directions without information have no part in it.

    ``size``: (n,) units of rows and columns, in which an eigenvalue is rounding or not.
    """
    unit = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(square / np.outer(unit, unit))
    some = values > NO_INFORMATION * values[-1]
    bent = np.where(some, values, 0.0) + damping
    along = np.where(bent > 0, vectors.T @ (side / unit) / np.where(bent > 0, bent, 1.0), 0.0)
    return np.asarray((vectors @ along) / unit)


def assemble(
    problem: RecordedResiduals,
    evaluated: Rows,
    shared: Array,
    own: Array,
    which: Ints,
    loss: RobustLoss,
    weights: Array,
    curvature: Weighting | None = None,
) -> ArrowSystem:
    """The system at shared (s,), own (K, o) of the recordings in ``which``, whose costs count ``weights`` times.

    ``evaluated`` is their Jacobian there, ``curvature`` the weights C of its rows in the blocks, by default the loss's.
    """
    s, n = len(shared), len(shared) + own.shape[1]
    costs, blocks, gradients = np.zeros(len(which)), np.zeros((len(which), n, n)), np.zeros((len(which), n))
    plain = curvature is None and not loss.robust
    weighting = curvature or loss.weight
    for k, (r, by_shared, by_own) in enumerate(evaluated):
        if not (np.isfinite(r).all() and np.isfinite(by_shared).all() and np.isfinite(by_own).all()):
            costs[k] = np.inf
            continue
        scale = np.concatenate([problem.shared.scale, problem.own.scale[which[k]]])
        rows = np.concatenate([by_shared, by_own], axis=1) * scale
        costs[k] = weights[k] * loss.value(r)
        blocks[k] = weights[k] * (rows.T @ rows if plain else (rows.T * weighting(r)) @ rows)
        gradients[k] = weights[k] * (rows.T @ loss.influence(r))
    square, slope, cost = prior_terms(problem.own, own)
    inside = np.arange(s, n)
    blocks[:, inside, inside] += square[which]
    gradients[:, s:] += slope[which]
    costs += cost[which].sum(axis=1)
    square, slope, cost = prior_terms(problem.shared, shared)
    return ArrowSystem(costs, blocks, gradients, float(cost.sum()), square, slope)


def prior_terms(parameters: FitParameters, values: Array) -> tuple[Array, Array, Array]:
    """Of scaled numbers, elementwise: the square, the half derivative and the value of ((x - mean) / deviation)^2."""
    missed = (values - parameters.prior_mean) / parameters.prior_deviation
    slope = parameters.scale / parameters.prior_deviation
    return slope**2, slope * missed, missed**2


def costs(
    problem: RecordedResiduals, shared: Array, own: Array, which: Ints, loss: RobustLoss, weights: Array
) -> tuple[Array, float]:
    """(K,) costs of recordings with the priors of their own numbers, inf where not finite; cost of shared priors."""
    evaluated = problem.residuals(shared, own, which)
    found = np.array([loss.value(r) if np.isfinite(r).all() else np.inf for r in evaluated])
    own_priors = prior_terms(problem.own, own)[2][which].sum(axis=1)
    return weights * found + own_priors, float(prior_terms(problem.shared, shared)[2].sum())
