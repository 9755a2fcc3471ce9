"""A problem's steps with another objective: what it asks for first, what it costs hardly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from symphys.problem import Problem
from symphys.transcription.staged.step_evaluator import StepEvaluator
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.staged.staged_problem import RolloutStages

COST_SHARE = 0.001
"""What costs count for at most, in units of a target that misses by its tolerance: more would use tolerances up."""
LASTING = 0.1
"""Share of the motion for which a violation of what holds always lasts to count 1."""


def asking(staged: Callable[[], RolloutStages]) -> Callable[[Array], RolloutStages]:
    """Return ``ShootingProblem.asking`` of the problem of ``staged``, whose compiled step it shares."""

    @cache
    def weighted(power: int) -> RolloutStages:
        known = staged().without_forces()
        return known.weighted(weighted_by_tolerance(known.rollout.problem, 10.0**power))

    def find(z: Array) -> RolloutStages:
        known = staged()
        problem = known.rollout.problem
        values = StepEvaluator(known.rollout, lambda: known).value(z[None], 0.0)
        errors = zip(problem.targets, values.errors[0], strict=False)
        costs = float(values.objective[0]) - sum(each.weight * (error * each.tolerance) ** 2 for each, error in errors)
        return weighted(_power(abs(costs)))

    return find


def _power(costs: float) -> int:
    """Return the power of ten by which costs are scaled; they are never raised."""
    return min(0, math.floor(math.log10(COST_SHARE / costs))) if 0 < costs < math.inf else 0


def weighted_by_tolerance(problem: Problem, share: float) -> Problem:
    """Return a problem whose costs are scaled by ``share``, where what misses by its tolerance counts 1.

    What holds always counts 1 where it misses by that for a tenth of the motion.
    """
    lasting = LASTING * problem.simulation.duration
    return replace(
        problem,
        costs=tuple(replace(each, weight=share * each.weight) for each in problem.costs),
        targets=tuple(replace(each, weight=each.tolerance**-2) for each in problem.targets),
        constraints=tuple(
            replace(each, penalty=each.tolerance**-2 / (lasting if each.at == "always" else 1.0))
            for each in problem.constraints
        ),
    )
