"""Kernels that the problems of a sweep share: the numbers that differ are inputs, after the decision variables.

A kernel has all other numbers of its problem as constants, so each problem would need one of its own, and compiling
takes longer than many a solve. Programs of problems that differ in inputs alone are equal, and compiled once.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends import Backend, BackendSource, choose
from symphys.problem import Problem, Variable
from symphys.shooting import Evaluator, Nlp, Values
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.objective import Terms, rollout_terms
from symphys.transcription.program import rollout_program
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.types import Array

LATEST_BACKEND: dict[tuple[object, ...], Backend] = {}
"""The backend of the last problem of a sweep, by everything that determines it."""


def shared_backend(
    problem: Problem, inputs: tuple[Variable, ...], nlp: Any, exact: bool, backend: str, threads: int | None
) -> Backend:
    """Return the backend of a problem by a kernel that takes some of its numbers as inputs.

    Args:
        problem: of a sweep.
        inputs: see ``swept_inputs``.
        nlp: of the problem itself, see ``Nlp.expression``.
        exact: as for ``transcribe``.
        backend: likewise.
        threads: likewise.
    """
    rollout = symbolic_rollout(replace(problem, variables=(*problem.variables, *inputs)))
    asked = rollout_terms(rollout)
    key = (whole(rollout, asked), exact, backend, threads)
    if key in LATEST_BACKEND:
        made = LATEST_BACKEND[key].description
        here = replace(made, seconds=0.0, cached=None if made.cached is None else True)
        chosen = replace(LATEST_BACKEND[key], description=here)
    else:
        source = BackendSource(ExpressionFunctions(rollout, asked), lambda: rollout_program(rollout, exact), exact)
        LATEST_BACKEND.clear()
        chosen = LATEST_BACKEND[key] = choose(backend, source, threads)
    numbers = np.concatenate([variable.guess for variable in inputs])
    return replace(chosen, evaluator=BoundEvaluator(chosen.evaluator, numbers), nlp=bound_nlp(chosen.nlp, nlp, numbers))


def whole(rollout: Rollout, asked: Terms) -> str:
    """Return a text of everything that determines a backend: equal for problems that differ only in inputs."""
    parts = [getattr(asked, name) for name in ("costs", "objective", "penalties", "errors", "constraints", "outputs")]
    parts += [asked.means, *([] if asked.residuals is None else [asked.residuals])]
    text = ca.Function("whole", [rollout.z, rollout.smoothing], parts).serialize()
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()


class BoundEvaluator:
    """An ``Evaluator`` that appends the same numbers to every point."""

    def __init__(self, evaluator: Evaluator, numbers: Array) -> None:
        """Append ``numbers`` (s,) to z."""
        self.evaluator, self.numbers = evaluator, numbers

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.evaluator.value(self.joined(Z), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.cut(self.evaluator.gradient(self.joined(Z), smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        return self.evaluator.residuals(self.joined(Z), smoothing)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        return self.cut(self.evaluator.jacobian(self.joined(Z), smoothing))

    def joined(self, Z: Array) -> Array:
        """Return points (batch, n + s)."""
        return np.hstack([Z, np.broadcast_to(self.numbers, (len(Z), self.numbers.size))])

    def cut(self, found: Values) -> Values:
        """Return the values with derivatives by z alone."""
        count = self.numbers.size
        slopes = {name: getattr(found, name) for name in ("gradient", "jacobian")}
        return replace(
            found, **{name: np.ascontiguousarray(d[..., :-count]) for name, d in slopes.items() if d is not None}
        )


def bound_nlp(shared: Nlp, expression: Any, numbers: Array) -> Nlp:
    """Return objective and constraints with these numbers after z; ``expression``: of the problem itself."""
    if shared.value is None:
        return Nlp(expression)
    z, smoothing = ca.MX.sym("z", expression.size1_in(0)), ca.MX.sym("smoothing")
    joined, count = ca.vertcat(z, ca.DM(numbers)), expression.size1_in(0)

    def bound(name: str, function: Any, columns: bool | None) -> Any:
        if function is None:
            return None
        first, second = function(joined, smoothing)
        if columns is not None:
            second = second[:, :count] if columns else second[:count]
        return ca.Function(name, [z, smoothing], [first, second])

    return Nlp(
        expression,
        bound("value", shared.value, None),
        bound("gradient", shared.gradient, False),
        bound("jacobian", shared.jacobian, True),
        keep=shared.keep,
    )
