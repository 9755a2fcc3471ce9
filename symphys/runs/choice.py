"""Automatic solver choice for problems that name no solver: the first of ``SITUATIONS`` that holds decides.

The choice follows from the problem file alone; nothing is built or evaluated for it. docs/results/profiles.md has
the measurements behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from symphys.problem import Constraint, Cost, Problem, Target
from symphys.records import dataclass

MAX_SMALL = 300
"""Length of z up to which a derivative-free search, or a Jacobian, is worth its evaluations."""
ALWAYS = "always"


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


def staged(problem: Problem) -> bool:
    """Whether controls act over time, and every term depends on one state and one input."""
    asked: tuple[Cost | Target | Constraint, ...] = (*problem.costs, *problem.targets, *problem.constraints)
    return controls(problem) and not problem.free_duration and not any(each.formula.parts for each in asked)


def controls(problem: Problem) -> bool:
    """Whether a variable acts over time."""
    return any(variable.kind == "control" and variable.knots > 1 for variable in problem.variables)


def squares(problem: Problem) -> bool:
    """Whether every minimised term is a square."""
    return all(cost.squares for cost in problem.costs)


def along(problem: Problem) -> bool:
    """Whether something is evaluated over time, not only at a few instants."""
    asked: tuple[Cost | Constraint, ...] = (*problem.costs, *problem.constraints)
    return any(each.at == ALWAYS for each in asked)


def limited(problem: Problem) -> bool:
    """Whether states are constrained over time, or the file has a guess of them."""
    return problem.guess is not None or any(each.at == ALWAYS for each in problem.constraints)


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
        "controls over time, states limited or guessed",
        lambda problem: staged(problem) and limited(problem),
        (
            ChosenSolver("ilqr", "its controls act over time, and what it asks for is summed step by step"),
            ChosenSolver("multiple_shooting", "its states are limited along the way, or guessed"),
        ),
    ),
    Situation(
        "controls over time, squares at instants",
        lambda problem: staged(problem) and squares(problem) and not along(problem) and is_small(problem),
        (
            ChosenSolver("least_squares", "squares at a few instants make a Jacobian of few rows"),
            ChosenSolver("ilqr", "its controls act over time, and feedback leads steps around kinks"),
        ),
    ),
    Situation(
        "controls over time, step by step",
        staged,
        (
            ChosenSolver("ilqr", "its controls act over time, and what it asks for is summed step by step"),
            ChosenSolver("ipopt", "it sees the motion as a whole, where kinks stop what goes step by step"),
        ),
    ),
    Situation(
        "controls over time, seen as a whole",
        controls,
        (
            ChosenSolver("ipopt", "what it asks for is of the whole motion, and constraints may bind"),
            ChosenSolver("gradient", "a gradient costs the same for any number of knots"),
        ),
    ),
    Situation(
        "few numbers, squares",
        lambda problem: squares(problem) and is_small(problem),
        (
            ChosenSolver("least_squares", "a few numbers set what is squared"),
            ChosenSolver("cma", "among few numbers a search needs no gradient, and passes kinks and plateaus"),
        ),
    ),
    Situation(
        "few numbers, other costs",
        is_small,
        (
            ChosenSolver("ipopt", "its costs are no squares, and a few numbers set them"),
            ChosenSolver("cma", "among few numbers a search needs no gradient, and passes kinks and plateaus"),
        ),
    ),
    Situation(
        "many numbers",
        lambda problem: True,
        (ChosenSolver("gradient", "a gradient costs the same for any number of them"),),
    ),
)
"""In order of precedence: the first that holds decides."""
