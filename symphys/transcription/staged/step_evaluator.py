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
from symphys.problem import Problem
from symphys.shooting import StagedMotion, Values, WithoutResiduals, costates
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
        states = X[:, :, : self._formulas.size1_in(1)]
        merit, objective, _, errors, outputs, probe = row_by_row(self._formulas, Z, states)
        return Values(merit[:, 0], objective[:, 0], errors, outputs, probe=probe[:, 0])

    def _slope(self, motion: StagedMotion) -> Array:
        """Return the gradient (n,) of the merit about a motion."""
        staged = self.staged()
        slopes = staged.linearize(motion)
        costs = staged.expand(motion, np.zeros_like(staged.penalties), 2 * staged.penalties)
        after, first = costates(slopes.a, costs.x[:-1], costs.x[-1], staged.recursion)
        by_inputs = costs.u + (after[:, None] @ slopes.b)[:, 0]
        slope = np.asarray(staged.weights.T @ by_inputs.ravel())
        slope[staged.statics] += costs.s + (after[:, None] @ slopes.c)[:, 0].sum(axis=0) + slopes.start.T @ first
        return slope

    @cached_property
    def _formulas(self) -> ca.Function:
        return motion_values(self.rollout)


def evaluated_by_steps(problem: Problem) -> bool:
    """Whether merits are those of the staged problem.

    There penalties of what holds always are weighted by the time step of the file, not by that of a free duration.
    """
    return not (problem.free_duration and any(limit.at == "always" for limit in problem.constraints))
