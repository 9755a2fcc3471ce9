"""Which solvers a problem gets where none is named, and why: the first of ``SITUATIONS`` that it is in.

The choice follows from what the file asks for alone; nothing is built or evaluated for it. docs/results/profiles.md has
the measurements behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from symphys.problem import Constraint, Cost, Problem, Target

FEW = 300
"""Numbers up to which a search without gradients, or a Jacobian, is worth its evaluations."""
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
    """What problems have in common that get the same solvers.

    Attributes:
        name: in a few words.
        holds: whether a problem is in it, given that it is in none before it.
        solvers: the one that fits best first.
    """

    name: str
    holds: Callable[[Problem], bool]
    solvers: tuple[ChosenSolver, ...]


def chosen(problem: Problem) -> tuple[ChosenSolver, ...]:
    """The solvers of a problem that names none."""
    return situation(problem).solvers


def situation(problem: Problem) -> Situation:
    """The first that a problem is in."""
    return next(each for each in SITUATIONS if each.holds(problem))


def chosen_lines(problem: Problem, named: Sequence[str] | None = None) -> list[str]:
    """A line for each solver that is chosen for a problem; none where ``named`` or the file names some."""
    return [] if named or problem.solvers else [f"{problem.name}: {each}" for each in chosen(problem)]


def numbers(problem: Problem) -> int:
    """The length of z."""
    return sum(variable.guess.size for variable in problem.variables)


def few_scenarios(problem: Problem) -> bool:
    """Whether samples of scenarios differ, and values alone can tell where to go."""
    return problem.scenarios is not None and numbers(problem) <= FEW


def staged(problem: Problem) -> bool:
    """Whether controls act over time, and everything that is asked for is of one state and one input each."""
    asked: tuple[Cost | Target | Constraint, ...] = (*problem.costs, *problem.targets, *problem.constraints)
    return controls(problem) and not problem.free_duration and not any(each.formula.parts for each in asked)


def controls(problem: Problem) -> bool:
    """Whether a variable acts over time."""
    return any(variable.kind == "control" and variable.knots > 1 for variable in problem.variables)


def squares(problem: Problem) -> bool:
    """Whether everything that is minimised is a square."""
    return all(cost.squares for cost in problem.costs)


def along(problem: Problem) -> bool:
    """Whether something is asked for along the way, not at a few instants only."""
    asked: tuple[Cost | Constraint, ...] = (*problem.costs, *problem.constraints)
    return any(each.at == ALWAYS for each in asked)


def limited(problem: Problem) -> bool:
    """Whether states are constrained along the way, or the file has a guess of them."""
    return problem.guess is not None or any(each.at == ALWAYS for each in problem.constraints)


SITUATIONS = (
    Situation(
        "scenarios, few numbers",
        few_scenarios,
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
        lambda problem: staged(problem) and squares(problem) and not along(problem) and numbers(problem) <= FEW,
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
        lambda problem: squares(problem) and numbers(problem) <= FEW,
        (
            ChosenSolver("least_squares", "a few numbers set what is squared"),
            ChosenSolver("cma", "among few numbers a search needs no gradient, and passes kinks and plateaus"),
        ),
    ),
    Situation(
        "few numbers, other costs",
        lambda problem: numbers(problem) <= FEW,
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
"""In the order in which they are asked."""
