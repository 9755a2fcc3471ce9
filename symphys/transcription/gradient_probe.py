"""The number whose gradient is examined: one that depends on every formula of a problem."""

from __future__ import annotations

from typing import Protocol

import casadi as ca
import numpy as np

from symphys.types import Array, Expr


class Probe(Protocol):
    """A fixed random combination of all formulas (``Terms.means``) along the exact rollout, and its gradient.

    The gradient of the objective itself vanishes at a solution. The weights of the combination depend on the number of
    formulas alone, not on the time grid.
    """

    def values(self, Z: Array) -> Array:
        """Return the values (batch,) at Z (batch, n)."""

    def gradient(self, z: Array) -> Array:
        """Return the derivative (n,) at z (n,)."""


def combined(means: Expr) -> Expr:
    """Return the combination of ``Terms.means``."""
    weights = np.random.default_rng(0).uniform(0.5, 1.5, means.shape[0])
    return ca.dot(ca.DM(weights), ca.densify(means))
