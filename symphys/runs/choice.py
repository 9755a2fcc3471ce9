"""Automatic solver choice for problems that name no solver: the first of ``SITUATIONS`` that holds decides.

The choice follows from the problem file alone; nothing is built or evaluated for it. docs/results/solvers.md has
the measurements behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from symphys.problem import Problem
from symphys.records import dataclass

MAX_SMALL = 300
"""Length of z up to which a derivative-free search, or a Jacobian, is worth its evaluations."""


@dataclass(frozen=True)
class ChosenSolver:
    """A solver, and why it is taken, as a clause that begins with "since" in mind."""

    solver: str
    reason: str

    def __str__(self) -> str:
        """Return the line that people read."""
        return f"{self.solver}, since {self.reason}"


@dataclass(frozen=True)
class Situation:
    """A class of problems that get the same solvers.

    Attributes:
        name: a short description.
        holds: whether a problem is in it, given that no earlier situation holds.
        solvers: the best fit first.
    """

    name: str
    holds: Callable[[Problem], bool]
    solvers: tuple[ChosenSolver, ...]


def chosen(problem: Problem) -> tuple[ChosenSolver, ...]:
    """Return the solvers of a problem that names none, the best fit first."""
    return situation(problem).solvers


def situation(problem: Problem) -> Situation:
    """Return the first situation that holds for a problem."""
    return next(each for each in SITUATIONS if each.holds(problem))


def chosen_lines(problem: Problem, named: Sequence[str] | None = None) -> list[str]:
    """Return a line for each solver that is chosen for a problem; none where ``named`` or the file names some."""
    return [] if named or problem.solvers else [f"{problem.name}: {each}" for each in chosen(problem)]


def is_small(problem: Problem) -> bool:
    """Whether z has at most ``MAX_SMALL`` components."""
    return sum(variable.guess.size for variable in problem.variables) <= MAX_SMALL


def controls(problem: Problem) -> bool:
    """Whether a variable acts over time, beside no more other numbers than a search is for."""
    over_time = [variable.kind == "control" and variable.knots > 1 for variable in problem.variables]
    sizes = [variable.guess.size for variable in problem.variables]
    others = sum(size for size, control in zip(sizes, over_time, strict=True) if not control)
    return any(over_time) and others <= MAX_SMALL


SITUATIONS = (
    Situation(
        "scenarios, few numbers",
        lambda problem: problem.scenarios is not None and is_small(problem),
        (
            ChosenSolver("stochastic", "samples of its scenarios differ, and it follows the mean of their gradients"),
            ChosenSolver("evolution", "values show where a motion ends early, and gradients do not"),
        ),
    ),
    Situation(
        "scenarios, many numbers",
        lambda problem: problem.scenarios is not None,
        (ChosenSolver("stochastic", "samples of its scenarios differ, and it has too many numbers to search in"),),
    ),
    Situation(
        "controls over time",
        controls,
        (ChosenSolver("race", "a search sees where a guess misses, and a method that follows derivatives finishes"),),
    ),
    Situation(
        "few numbers",
        is_small,
        (ChosenSolver("race", "a search passes kinks and plateaus, and a method that follows derivatives finishes"),),
    ),
    Situation(
        "many numbers",
        lambda problem: True,
        (ChosenSolver("gradient", "a gradient costs the same for any number of them"),),
    ),
)
"""In order of precedence: the first that holds decides."""
