"""Arrow-shaped normal equations, and their solution by the Schur complement of the own blocks.

In scaled numbers y = x / scale, with H = J' C J and g = J' psi of the merit sum rho(r),

    [ A    B_1   B_2  ... ] [ shared ]     [ g  ]
    [ B_1' D_1            ] [ own_1  ] = - [ g_1]
    [ B_2'      D_2       ] [ own_2  ]     [ g_2]

S = A - sum B_k D_k^-1 B_k' has the size of the shared numbers. Time and memory are linear in the recordings (Golub and
Pereyra 1973; in bundle adjustment: Triggs et al. 2000, section 6.1). Blocks are eliminated by their square roots
(``square_root``): the own columns of each recording are projected out of its shared ones, and S is never formed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.fitting.square_root import EPS, eliminate, pseudo_root, stacked, triangle
from symphys.identification.interface import FitParameters, RecordedResiduals, Rows
from symphys.records import dataclass
from symphys.types import Array, Bools, Ints

Weighting = Callable[[Array], Array]
"""Residuals (m,) -> weights (m,) of the rows of the Jacobian in a square matrix."""


@dataclass(frozen=True, eq=False)
class ArrowSystem:
    """The merit about a point, in scaled numbers; K recordings, n = s + o columns, the shared ones first.

    Attributes:
        costs: (K,) sum of rho of each recording, with the priors of its own numbers.
        roots: (K, n, n) rows F of each recording, F'F = J' C J; blocks: (K, n, n) these squares.
        gradients: (K, n) J' psi of each recording: half the derivative of its cost.
        prior_cost, prior_block, prior_gradient: of the priors of the shared numbers: a number, (s,) diagonal, (s,).
    """

    costs: Array
    roots: Array
    blocks: Array
    gradients: Array
    prior_cost: float
    prior_block: Array
    prior_gradient: Array

    @property
    def s(self) -> int:
        """Return the number of shared numbers."""
        return len(self.prior_block)

    @property
    def cost(self) -> float:
        """Return the cost of all recordings and priors."""
        return float(self.costs.sum()) + self.prior_cost

    @property
    def finite(self) -> bool:
        """Whether every number of the system is finite."""
        return all(bool(np.isfinite(each).all()) for each in (self.costs, self.blocks, self.gradients))

    @property
    def reference(self) -> Array:
        """Return (s,) the diagonal of A: what rounding in the Schur complement S is small against."""
        return np.asarray(np.einsum("kii->i", self.blocks[:, : self.s, : self.s]) + self.prior_block)

    @property
    def shared_gradient(self) -> Array:
        """Return (s,) half the derivative of the cost by the shared numbers."""
        return np.asarray(self.gradients[:, : self.s].sum(axis=0) + self.prior_gradient)

    @property
    def own_gradient(self) -> Array:
        """Return (K, o) half the derivative of the cost by the own numbers."""
        return self.gradients[:, self.s :]

    def step(self, damping: float, free_shared: Bools, free_own: Bools) -> tuple[Array, Array]:
        """Return -(H + damping I)^-1 g over the free numbers: (s,) and (K, o), zero where not free."""
        # Rows of each recording with its damping; a floor keeps the own blocks invertible.
        s, count = self.s, self.roots.shape[2]
        rows = self.roots * np.concatenate([np.ones((len(free_own), s)), free_own], axis=1)[:, None]
        floor = (EPS * count) ** 2 * np.sum(rows[:, :, s:] ** 2, axis=(1, 2))
        added = np.sqrt(np.maximum(damping, floor)[:, None] * free_own)
        damper = np.zeros((len(rows), count - s, count))
        damper[:, :, s:] = added[:, :, None] * np.eye(count - s)
        # Eliminate the own numbers: Schur complement by orthogonal factors.
        found = eliminate(np.concatenate([rows, damper], axis=1), s)
        own_side = self.own_gradient * free_own
        side = self.shared_gradient + np.einsum("kos,ko->s", found.gain, own_side)
        shared = np.zeros(s)
        # Shared step from the stacked remainders, priors and damping; then own steps by substitution.
        whole = np.concatenate([stacked(found.left), np.diag(np.sqrt(self.prior_block)), damping**0.5 * np.eye(s)])
        root = pseudo_root(triangle(whole[:, free_shared]))
        shared[free_shared] = -root.square @ side[free_shared]
        own = found.gain @ shared - np.einsum("kij,kj->ki", found.own.square, own_side)
        return shared, own * free_own

    def own_step(self, shared: Array, damping: Array, free_own: Bools) -> Array:
        """Compute (K, o) the own step for a shared step (s,), with a damping (K,) of each."""
        s, mask = self.s, free_own.astype(float)
        square = self.blocks[:, s:, s:] * mask[:, :, None] * mask[:, None, :]
        side = (self.own_gradient + np.einsum("ksi,s->ki", self.blocks[:, :s, s:], shared)) * mask
        added = np.where(free_own, damping[:, None], 1.0)
        square = square + added[:, :, None] * np.eye(square.shape[1])
        return -np.asarray(np.linalg.solve(square, side[:, :, None])[:, :, 0])

    def expected_falls(self, shared: Array, own: Array) -> Array:
        """Return (K,) the decrease of each recording's cost predicted for a step (s,), (K, o)."""
        both = np.concatenate([np.broadcast_to(shared, (len(own), self.s)), own], axis=1)
        bent = np.einsum("ki,kij,kj->k", both, self.blocks, both)
        return np.asarray(-2 * np.sum(both * self.gradients, axis=1) - bent)

    def expected_fall(self, shared: Array, own: Array) -> float:
        """Return the decrease of the cost predicted for a step (s,), (K, o)."""
        priors = 2 * float(shared @ self.prior_gradient) + float(shared**2 @ self.prior_block)
        return float(self.expected_falls(shared, own).sum()) - priors


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
    """Return the system at shared (s,), own (K, o) of the recordings in ``which``, whose costs count ``weights`` times.

    ``evaluated`` is their Jacobian there, ``curvature`` the weights C of its rows in the blocks, by default the loss's.
    """
    s, n = len(shared), len(shared) + own.shape[1]
    costs, roots, gradients = np.zeros(len(which)), np.zeros((len(which), n, n)), np.zeros((len(which), n))
    plain, prior = curvature is None and not loss.robust, np.zeros((n - s, n))
    square, slope, cost = prior_terms(problem.own, own)
    weighting = curvature or loss.weight
    for k, (r, by_shared, by_own) in enumerate(evaluated):
        if not (np.isfinite(r).all() and np.isfinite(by_shared).all() and np.isfinite(by_own).all()):
            costs[k] = np.inf
            continue
        scale = np.concatenate([problem.shared.scale, problem.own.scale[which[k]]])
        rows = np.concatenate([by_shared, by_own], axis=1) * scale
        costs[k] = weights[k] * loss.value(r)
        # Triangular factor of the weighted rows and the own priors, and the gradient.
        weighted = rows if plain else rows * np.sqrt(weighting(r))[:, None]
        prior[:, s:] = np.diag(np.sqrt(square[which[k]]))
        roots[k] = triangle(np.concatenate([np.sqrt(weights[k]) * weighted, prior]))
        gradients[k] = weights[k] * (rows.T @ loss.influence(r))
    gradients[:, s:] += slope[which]
    costs += cost[which].sum(axis=1)
    square, slope, cost = prior_terms(problem.shared, shared)
    blocks = roots.transpose(0, 2, 1) @ roots
    return ArrowSystem(costs, roots, blocks, gradients, float(cost.sum()), square, slope)


def prior_terms(parameters: FitParameters, values: Array) -> tuple[Array, Array, Array]:
    """Return square, half derivative and value of ((x - mean) / deviation)^2, elementwise, in scaled numbers."""
    missed = (values - parameters.prior_mean) / parameters.prior_deviation
    slope = parameters.scale / parameters.prior_deviation
    return slope**2, slope * missed, missed**2


def costs(
    problem: RecordedResiduals, shared: Array, own: Array, which: Ints, loss: RobustLoss, weights: Array
) -> tuple[Array, float]:
    """Compute (K,) costs of recordings with own priors, inf where not finite; and the cost of the shared priors."""
    evaluated = problem.residuals(shared, own, which)
    found = np.array([loss.value(r) if np.isfinite(r).all() else np.inf for r in evaluated])
    own_priors = prior_terms(problem.own, own)[2][which].sum(axis=1)
    return weights * found + own_priors, float(prior_terms(problem.shared, shared)[2].sum())
