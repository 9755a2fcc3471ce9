"""A shooting problem evaluated step by step, by the kernels that second-order methods have already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from symphys.codegen.backends import Description
from symphys.codegen.backends.calls import row_by_row
from symphys.shooting import StagedMotion, Values, WithoutResiduals, costates
from symphys.transcription.formula_names import spans
from symphys.transcription.motion_values import motion_values
from symphys.transcription.rollout import Rollout
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.staged.staged_problem import RolloutStages


class StepEvaluator(WithoutResiduals):
    """A ``StepwiseEvaluator`` that takes the steps of a batch side by side; formulas are casadi's virtual machine's.

    A kernel of the whole rollout takes as long to build as the Jacobians of a step, and these solvers would call it
    once in an iteration.
    """

    def __init__(self, rollout: Rollout, staged: Callable[[], RolloutStages]) -> None:
        """Keep what is asked at the first evaluation."""
        self.rollout, self.staged = rollout, staged

    @property
    def backend(self) -> Description:
        """Describe the evaluator of the steps."""
        return self.staged().backend

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.along(Z, self.staged().states(Z, smoothing))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``, by the adjoint of the states in their tangents."""
        motions = [self.staged().roll_out(z, smoothing) for z in Z]
        found = self.along(Z, np.array([motion.x for motion in motions]))
        return replace(found, gradient=np.array([self._slope(motion) for motion in motions]))

    def along(self, Z: Array, X: Array) -> Values:
        """Implement ``StepwiseEvaluator.along``."""
        states, p = X[:, :, : self._formulas.size1_in(1)], self.staged().parameters(Z)[:, : self._formulas.size1_in(2)]
        merit, objective, _, errors, outputs, probe = row_by_row(self._formulas, Z, states, p)
        return Values(merit[:, 0], objective[:, 0], errors, outputs, probe=probe[:, 0])

    def _slope(self, motion: StagedMotion) -> Array:
        """Return the gradient (n,) of the merit about a motion."""
        staged = self.staged()
        slopes, penalties = staged.linearize(motion), staged.penalties
        stretched = self.rollout.problem.free_duration and staged.lasting.any()
        if stretched:  # what holds always is weighted by the time step
            penalties = penalties * np.where(staged.lasting, staged.stretch(motion.z), 1.0)
        costs = staged.expand(motion, np.zeros_like(penalties), 2 * penalties)
        after, first = costates(slopes.a, costs.x[:-1], costs.x[-1], staged.recursion)
        by_inputs = costs.u + (after[:, None] @ slopes.b)[:, 0]
        slope = np.asarray(staged.weights.T @ by_inputs.ravel())
        slope[staged.statics] += costs.s + (after[:, None] @ slopes.c)[:, 0].sum(axis=0) + slopes.start.T @ first
        if stretched:
            limits = staged.measure(motion.z[None], motion.x[None], motion.u[None])[1][0]
            beyond = limits - np.clip(limits, staged.lower, staged.upper)
            slope[self._duration] += np.sum((penalties * beyond**2)[staged.lasting]) / motion.z[self._duration]
        return slope

    @cached_property
    def _duration(self) -> int:
        """Return the entry of z that is the duration."""
        variables = self.rollout.problem.variables
        places = zip(variables, spans(variables), strict=True)
        return next(first for variable, (first, _) in places if variable.kind == "duration")

    @cached_property
    def _formulas(self) -> ca.Function:
        return motion_values(self.rollout)
