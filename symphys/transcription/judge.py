"""The judge: the assessment of a candidate by the exact rollout."""

from __future__ import annotations

from math import inf, isfinite, isnan, nan

from symphys.problem import Problem
from symphys.records import dataclass
from symphys.transcription.objective import goal_error
from symphys.types import Array


@dataclass(frozen=True)
class Criterion:
    """A target, constraint or goal with its error.

    Attributes:
        kind: "target", "constraint" or "goal".
        name: as in the file.
        error: norm of a target's value, largest violation of a constraint, the objective for a goal.
        tolerance: largest error that counts as met.
        ratio: 1 at the tolerance, smaller is better.
        unit: of error and tolerance; empty where it is not known.
    """

    kind: str
    name: str
    error: float
    tolerance: float
    ratio: float
    unit: str = ""

    @property
    def met(self) -> bool:
        """Whether the error is within the tolerance; NaN never is."""
        return isfinite(self.ratio) and self.ratio <= 1


@dataclass(frozen=True)
class Assessment:
    """Objective, costs, checks and outputs of one candidate, by name."""

    objective: float
    costs: dict[str, float]
    checks: tuple[Criterion, ...]
    outputs: dict[str, float]

    @property
    def solved(self) -> bool:
        """Whether all checks are met, true also when there are none; a result that is not finite never is."""
        return isfinite(self.objective) and all(check.met for check in self.checks)

    @property
    def worst(self) -> float:
        """The largest ratio; NaN where one is NaN, and without checks."""
        ratios = (check.ratio for check in self.checks)
        return max(ratios, key=lambda ratio: inf if isnan(ratio) else ratio, default=nan)


def assessment(problem: Problem, objective: float, costs: Array, errors: Array, outputs: Array) -> Assessment:
    """Return the assessment from the numbers of the exact rollout; the arrays as in ``Terms``."""
    checks = []
    held = [("target", t.name, t.tolerance, t.unit) for t in problem.targets]
    held += [("constraint", c.name, c.tolerance, c.unit) for c in problem.constraints]
    for (kind, name, tolerance, unit), ratio in zip(held, errors, strict=False):
        checks.append(Criterion(kind, name, float(ratio) * tolerance, tolerance, float(ratio), unit))
    if problem.goal is not None:
        checks.append(
            Criterion("goal", "objective", objective, problem.goal, float(goal_error(objective, problem.goal)))
        )
    named = {cost.name: float(value) for cost, value in zip(problem.costs, costs, strict=True)}
    reported = {output.label: float(value) for output, value in zip(problem.outputs, outputs, strict=True)}
    return Assessment(objective, named, tuple(checks), reported)
