"""What problems with large nets cannot have, said before anything is built."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from symphys.errors import Issue, ProblemError
from symphys.problem import Constraint, Controller, Cost, Output, Problem, Target


def refuse_large(problem: Problem, nets: Sequence[Controller], most: int, what: str) -> None:
    """ProblemError if there are any, from what cannot deal with them."""
    issues = [
        Issue(f'controller "{net.name}".net', f"has {net.law.sizes['weights']} weights; {what} takes up to {most}")
        for net in nets
    ]
    if issues:
        raise ProblemError(problem.file, issues)


def refuse_formulas(problem: Problem, names: Sequence[str]) -> None:
    """ProblemError if a formula looks at the weights of large nets, by these names of variables or numbers."""
    issues = [
        Issue(f'{kind} "{each.name}"', f"looks at {name}, the weights of a net that is too large for formulas")
        for kind, each in _formulas(problem)
        for name in names
        if name in each.formula.names
    ]
    if issues:
        raise ProblemError(problem.file, issues)


def _formulas(problem: Problem) -> Iterator[tuple[str, Cost | Target | Constraint | Output]]:
    yield from (("cost", cost) for cost in problem.costs)
    yield from (("target", target) for target in problem.targets)
    yield from (("constraint", constraint) for constraint in problem.constraints)
    yield from (("output", output) for output in problem.outputs)
