"""What is differentiated to examine a gradient: one number that depends on every formula that a problem asks for."""

from __future__ import annotations

from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.shooting import Evaluator
from symphys.transcription.objective import Terms
from symphys.transcription.rollout import Rollout

Array = NDArray[np.float64]
Expr = Any
"""casadi MX"""


class Probe(Protocol):
    """A fixed random combination of all formulas (``Terms.means``) along the exact rollout, and its gradient.

    The gradient of the objective itself vanishes at a solution. The weights of the combination depend on the number of
    formulas alone, not on the time grid.
    """

    def values(self, Z: Array) -> Array:
        """(batch,) at Z (batch, n)."""

    def gradient(self, z: Array) -> Array:
        """(n,) its derivative at z (n,)."""


def combined(means: Expr) -> Expr:
    """The combination of ``Terms.means``."""
    weights = np.random.default_rng(0).uniform(0.5, 1.5, means.shape[0])
    return ca.dot(ca.DM(weights), ca.densify(means))


class ExpressionProbe:
    """See ``Probe``; the gradient on casadi's virtual machine, values too where the evaluator has none.

    A kernel's values are those of the virtual machine to the last bit, and a hundred times cheaper.
    """

    def __init__(self, rollout: Rollout, asked: Terms, evaluator: Evaluator) -> None:
        """Build the functions."""
        number = combined(asked.means)
        self._evaluator = evaluator
        self._value = _exact(rollout, "probe", number)
        self._gradient = _exact(rollout, "probe_gradient", ca.gradient(number, rollout.z))

    def values(self, Z: Array) -> Array:
        """See ``Probe``."""
        known = self._evaluator.value(Z, 0.0).probe
        return np.array([float(self._value(z)) for z in Z]) if known is None else known

    def gradient(self, z: Array) -> Array:
        """See ``Probe``."""
        return np.array(self._gradient(z)).ravel()


def _exact(rollout: Rollout, name: str, output: Expr) -> ca.Function:
    z = ca.MX.sym("z", rollout.z.shape[0])
    smooth = ca.Function(name, [rollout.z, rollout.smoothing], [ca.densify(output)])
    return ca.Function(name, [z], [smooth(z, 0)])
