"""A rollout and the objective of a problem as casadi functions of (z, smoothing)."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import casadi as ca

from symphys.transcription.objective import Terms, rollout_terms
from symphys.transcription.rollout import Rollout


class ExpressionFunctions:
    """Functions of a rollout, made on demand; see ``symphys.codegen.backends.interface.ProblemFunctions``."""

    def __init__(self, rollout: Rollout, asked: Terms | None = None) -> None:
        """Prepare the functions; ``asked``: terms of the rollout, built on demand where None."""
        self._rollout, self._asked = rollout, asked

    @cached_property
    def terms(self) -> Terms:
        """The terms of the problem as expressions."""
        return rollout_terms(self._rollout) if self._asked is None else self._asked

    @property
    def _merit(self) -> Any:
        return self.terms.objective + self.terms.penalties

    @property
    def _common(self) -> list[Any]:
        return [self.terms.objective, self.terms.errors]

    @property
    def squares(self) -> Any:
        """The residuals (m,) as an expression; None without any, or if a cost is no sum of squares."""
        r = self.terms.residuals
        return r if r is not None and r.shape[0] else None

    @cached_property
    def value(self) -> ca.Function:
        """(z, smoothing) -> (merit, objective, errors, outputs)."""
        return self._function("value", [self._merit, *self._common, self.terms.outputs])

    @cached_property
    def gradient(self) -> ca.Function:
        """(z, smoothing) -> (merit, objective, errors, d merit / dz (n,), outputs)."""
        slopes = ca.gradient(self._merit, self._rollout.z)
        return self._function("gradient", [self._merit, *self._common, slopes, self.terms.outputs])

    @cached_property
    def residuals(self) -> ca.Function | None:
        """(z, smoothing) -> (r, objective, errors, outputs)."""
        if self.squares is None:
            return None
        return self._function("residuals", [self.squares, *self._common, self.terms.outputs])

    @cached_property
    def jacobian(self) -> ca.Function | None:
        """(z, smoothing) -> (r, objective, errors, dr/dz (m, n), outputs)."""
        if self.squares is None:
            return None
        slopes = ca.jacobian(self.squares, self._rollout.z)
        return self._function("jacobian", [self.squares, *self._common, slopes, self.terms.outputs])

    @cached_property
    def nlp(self) -> ca.Function:
        """(z, smoothing) -> (objective, constraints)."""
        return self._function("nlp", [self.terms.objective, self.terms.constraints])

    @cached_property
    def constraint_jacobian(self) -> ca.Function:
        """(z, smoothing) -> (constraints, their derivative (m, n))."""
        constraints = self.terms.constraints
        return self._function("constraint_jacobian", [constraints, ca.jacobian(constraints, self._rollout.z)])

    @cached_property
    def hessian(self) -> ca.Function:
        """(z, smoothing) -> the second derivative of the objective (n, n)."""
        return self._function("hessian", [ca.hessian(self.terms.objective, self._rollout.z)[0]])

    def _function(self, name: str, outputs: list[Any]) -> ca.Function:
        return function_of(self._rollout, name, outputs)


def function_of(rollout: Rollout, name: str, outputs: list[Any]) -> ca.Function:
    """Return outputs of a rollout as a function of (z, smoothing) with dense results."""
    return ca.Function(name, [rollout.z, rollout.smoothing], [ca.densify(output) for output in outputs])
