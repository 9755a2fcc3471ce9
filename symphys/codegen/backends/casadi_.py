"""Casadi's virtual machine: it needs no compiler, and evaluates whatever casadi can."""

from __future__ import annotations

import numpy as np

from symphys.codegen.backends.calls import BufferedFunction
from symphys.codegen.backends.interface import Backend, BackendSource, Description, ProblemFunctions
from symphys.shooting import LaterNlp, Nlp, Values
from symphys.types import Array


class FunctionEvaluator:
    """Evaluates casadi functions, a batch in one call; see ``Evaluator``."""

    def __init__(self, functions: ProblemFunctions, threads: int = 1) -> None:
        """Prepare the functions, which are built on demand."""
        self.functions, self.threads = functions, threads
        self._calls: dict[tuple[str, int], BufferedFunction] = {}

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        merit, objective, errors, outputs = self._call("value", Z, smoothing)
        return Values(merit[:, 0], objective[:, 0], errors, outputs)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        merit, objective, errors, gradient, outputs = self._call("gradient", Z, smoothing)
        return Values(merit[:, 0], objective[:, 0], errors, outputs, gradient=gradient)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        r, objective, errors, outputs = self._call("residuals", Z, smoothing)
        return Values(squared(r), objective[:, 0], errors, outputs, residuals=r)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        r, objective, errors, jacobian, outputs = self._call("jacobian", Z, smoothing)
        jacobian = jacobian.reshape(*r.shape, Z.shape[1])
        return Values(squared(r), objective[:, 0], errors, outputs, residuals=r, jacobian=jacobian)

    def _call(self, name: str, Z: Array, smoothing: float) -> list[Array]:
        key = (name, len(Z))
        if key not in self._calls:
            self._calls[key] = BufferedFunction(getattr(self.functions, name), len(Z), self.threads)
        return self._calls[key](Z, smoothing)


def squared(r: Array) -> Array:
    """Return r . r (batch,), each row by itself, so that it does not depend on the others."""
    with np.errstate(all="ignore"):  # a rollout that is not finite is no fault here
        return np.array([row @ row for row in r])


def casadi(source: BackendSource, threads: int) -> Backend:
    """Make the backend of the virtual machine; ``threads`` share a batch."""
    evaluator = FunctionEvaluator(source.functions, threads)
    return Backend(Description("casadi", threads=threads), evaluator, LaterNlp(lambda: Nlp(source.functions.nlp)))
