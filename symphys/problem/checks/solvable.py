"""Whether there is anything to solve: a file may also hold a world alone, which can be simulated and rendered."""

from __future__ import annotations

from symphys.errors import Issue, ProblemError
from symphys.problem.model import Problem


def require_solvable(problem: Problem) -> None:
    """ProblemError if nothing may vary, or if there is no objective, with what to add."""
    body = next(iter(problem.initial)).split(".")[0]
    issues = []
    if not problem.variables:
        example = f'[[variable]] with name = "start", sets = "{body}.velocity"'
        issues.append(
            Issue("variable", f"there is none, so a solver has nothing to choose; add, for instance, {example}")
        )
    if not (problem.costs or problem.targets or problem.constraints):
        example = f'[[target]] with name = "there", value = "{body}.position - [1, 0, 0]", tolerance = 0.01'
        issues.append(
            Issue(
                "target", f"there is none, and no cost or constraint: nothing to aim at; add, for instance, {example}"
            )
        )
    if issues:
        raise ProblemError(problem.file, issues)
