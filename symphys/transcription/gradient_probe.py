"""The number whose gradient is examined: one that depends on every formula of a problem."""

from __future__ import annotations

from collections.abc import Callable
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


class CachedProbe:
    """A ``Probe`` from two functions; the gradient at the last z is cached."""

    def __init__(self, values: Callable[[Array], Array], gradient: Callable[[Array], Array]) -> None:
        """Take both functions."""
        self._values, self._gradient = values, gradient
        self._slopes: dict[bytes, Array] = {}

    def values(self, Z: Array) -> Array:
        """Implement ``Probe.values``."""
        return self._values(Z)

    def gradient(self, z: Array) -> Array:
        """Implement ``Probe.gradient``."""
        key = np.asarray(z, np.float64).tobytes()
        if key not in self._slopes:
            self._slopes = {key: self._gradient(z)}
        return self._slopes[key].copy()
