"""The number whose gradient is examined: one that depends on every formula of a problem."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from symphys.codegen import processors
from symphys.codegen.backends.calls import BufferedFunction
from symphys.shooting import Evaluator
from symphys.transcription.objective import Terms
from symphys.transcription.rollout import Rollout
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


class ExpressionProbe:
    """A ``Probe`` on casadi's virtual machine; an evaluator, if there is one, computes the values.

    A kernel's values are those of the virtual machine to the last bit, and a hundred times cheaper.
    """

    def __init__(self, rollout: Rollout, asked: Terms, evaluator: Evaluator) -> None:
        """Prepare the functions, which are built on demand."""
        self._rollout, self._number = rollout, combined(asked.means)
        self._evaluator: Evaluator | None = evaluator
        self._calls: dict[int, BufferedFunction] = {}
        self._slopes: dict[bytes, Array] = {}

    def values(self, Z: Array) -> Array:
        """Implement ``Probe.values``; the virtual machine uses all processors."""
        known = None if self._evaluator is None else self._evaluator.value(Z, 0.0).probe
        if known is not None:
            return known
        self._evaluator = None
        if len(Z) not in self._calls:
            self._calls[len(Z)] = BufferedFunction(self._value, len(Z), processors())
        return self._calls[len(Z)](Z, 0.0)[0][:, 0]

    def gradient(self, z: Array) -> Array:
        """Implement ``Probe.gradient``; the gradient at the last z is cached."""
        key = np.asarray(z, np.float64).tobytes()
        if key not in self._slopes:
            self._slopes = {key: np.array(self._gradient(z, 0.0)).ravel()}
        return self._slopes[key].copy()

    @cached_property
    def _value(self) -> ca.Function:
        return self._function("probe", self._number)

    @cached_property
    def _gradient(self) -> ca.Function:
        return self._function("probe_gradient", ca.gradient(self._number, self._rollout.z))

    def _function(self, name: str, output: Expr) -> ca.Function:
        return ca.Function(name, [self._rollout.z, self._rollout.smoothing], [ca.densify(output)])
