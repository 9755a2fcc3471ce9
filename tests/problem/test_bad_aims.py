"""What can be wrong with variables, formulas and aims: where it is, and what would be valid."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from symphys.errors import ProblemError

Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]
SETS = 'sets = "ball.velocity"\nguess = [1, 2, 3]'
COST = 'at = "always"\nsquares = "marble.force"'
OUTPUT = "[[output]]\nname = 'far'\nvalue = '"
TARGET = 'value = "ball.position - [1, 0, 0.5]"'

CASES = [
    # variables
    (
        SETS,
        'sets = "ball.velocty"',
        'variable "throw".sets',
        'no quantity "ball.velocty"; did you mean "ball.velocity"',
    ),
    (SETS, 'sets = "bal.velocity"', 'variable "throw".sets', 'did you mean "ball.velocity"'),
    (SETS, 'sets = "marble.friction"', 'variable "throw".sets', "marble states no friction: give it a value"),
    (SETS, 'sets = "ball.velocity[3]"', 'variable "throw".sets', "has 3 components, 0 to 2"),
    (SETS, 'sets = "ball.velocity[0:4]"', 'variable "throw".sets', "has 3 components"),
    (SETS, 'sets = "ball.velocity[1:1]"', 'variable "throw".sets', "empty range"),
    (SETS, 'sets = "ball.velocity[]"', 'variable "throw".sets', "empty index"),
    (SETS, 'sets = "ball.velocity[x]"', 'variable "throw".sets', "is no quantity"),
    (SETS, "sets = []", 'variable "throw".sets', "a text or a list of texts"),
    (SETS, "sets = 3", 'variable "throw".sets', "a text or a list of texts"),
    (SETS, 'sets = ["ball.velocity", "ball.mass"]', 'variable "throw".sets', "different kinds .initial, parameter."),
    (SETS, 'sets = ["ball.velocity", "marble.velocity[0]"]', 'variable "throw".sets', "different numbers of comp"),
    (SETS, 'sets = ["ball.velocity[1]", "ball.velocity[1]"]', 'variable "throw".sets', "already set by variable throw"),
    (SETS, 'sets = "marble.force[1]"', 'variable "push".sets', r"marble.force\[1\] is already set by variable throw"),
    (SETS, 'sets = ["ball.position", "marble.position"]', 'variable "throw".guess', "required, .* different values"),
    (SETS, f"{SETS}\nknots = 3", 'variable "throw".knots', "only a force or a torque"),
    (SETS, f'{SETS}\ninterpolation = "linear"', 'variable "throw".interpolation', "only a force or a torque"),
    ("knots = 4", "knots = 0", 'variable "push".knots', "at least 1"),
    ("knots = 4", "knots = 101", 'variable "push".knots', "more than the 100 time steps"),
    ("knots = 4", 'knots = 1\ninterpolation = "linear"', 'variable "push".knots', "2 or more"),
    ("knots = 4", 'interpolation = "cubic"', 'variable "push".interpolation', "'constant' or 'linear'"),
    ("guess = [1, 2, 3]", "guess = [1, 2]", 'variable "throw".guess', "a number or 3 numbers; it has 2"),
    ("guess = [1, 2, 3]", 'guess = "1"', 'variable "throw".guess', "must be a number, a list"),
    ("guess = [1, 2, 3]", "guess = [1, 2, inf]", 'variable "throw".guess', "finite numbers"),
    ("guess = [1, 2, 3]", "guess = [[1, 2], 3]", 'variable "throw".guess', "must be a number, a list"),
    ("knots = 4", "knots = 4\nguess = [[1, 2]]", 'variable "push".guess', "4 lists of 2 numbers"),
    ("guess = [1, 2, 3]", "lower = nan", 'variable "throw".lower', "must be a number"),
    ("guess = [1, 2, 3]", "lower = 1\nupper = 0", 'variable "throw".lower', "exceeds upper in component 0"),
    (
        "guess = [1, 2, 3]",
        "guess = 1\nupper = [1, 0.5, 1]",
        'variable "throw".guess',
        "guess 1 .* -inf to 0.5 in comp.* 1",
    ),
    (
        "knots = 4",
        "knots = 4\nlower = 1",
        'variable "push".guess',
        "value in the file, .* 0 .* in component 0 at knot 0",
    ),
    ("guess = [1, 2, 3]", "scale = 0", 'variable "throw".scale', "must be positive"),
    ("guess = [1, 2, 3]", "spread = -1", 'variable "throw".spread', "must not be negative"),
    (SETS, 'sets = "ball.mass"\nlower = 0', 'variable "throw".lower', "ball.mass must be greater than 0"),
    (SETS, 'sets = "ball.friction"\nlower = -1', 'variable "throw".lower', "must be at least 0"),
    (SETS, 'sets = "ground.restitution"\nupper = 2', 'variable "throw".upper', "must be at most 1"),
    (SETS, 'sets = "ball.orientation"\nguess = 0', 'variable "throw".guess', "quaternion must not be zero"),
    # formulas and aims
    (TARGET, 'value = "ball.position +"', 'target "lands there".value', "cannot read the formula"),
    (TARGET, 'value = "ball.positon"', 'target "lands there".value', 'did you mean "ball.position"'),
    (TARGET, 'value = "ball.__class__"', 'target "lands there".value', "unknown name"),
    (TARGET, 'value = "exec(1)"', 'target "lands there".value', "unknown function"),
    (TARGET, 'value = "ball.position - [1, 0]"', 'target "lands there".value', "a vector of 3 and a vector of 2"),
    (TARGET, f"{TARGET}\nat = 1.5", 'target "lands there".at', "outside the simulation, .* 0 to 1 s"),
    (TARGET, f"{TARGET}\nat = -0.5", 'target "lands there".at', "outside the simulation"),
    (TARGET, f"{TARGET}\nat = 0.505", 'target "lands there".at', "between two steps; nearest: 0.5 or 0.51"),
    (TARGET, f'{TARGET}\nat = "always"', 'target "lands there".at', r"use a \[\[constraint\]\]"),
    (TARGET, f'{TARGET}\nat = "now"', 'target "lands there".at', '"end" or a time'),
    ("tolerance = 0.01", "tolerance = -0.01", 'target "lands there".tolerance', "greater than 0"),
    ("tolerance = 0.01", "tolerance = 0.01\nweight = -1", 'target "lands there".weight', "at least 0"),
    ("tolerance = 0.01", "", 'target "lands there".tolerance', "required"),
    (COST, 'value = "ball.position"', 'cost "effort".value', "must be a number, but is a vector of 3; use squares"),
    (COST, "", 'cost "effort".value', "give either value"),
    (COST, f'{COST}\nvalue = "1"', 'cost "effort".value', "give either value"),
    (COST, f"{COST}\nweight = -1", 'cost "effort".weight', "at least 0"),
    (COST, 'at = "always"\nvalue = "1 / time"', 'cost "effort".value', "not a finite number at the start"),
    (COST, 'at = "sometimes"\nvalue = "1"', 'cost "effort".at', '"end", "always" or a time'),
    ("upper = 5", "", 'constraint "stays low".lower', "give lower, upper or both, or equals"),
    ("upper = 5", "upper = 5\nequals = 4", 'constraint "stays low".equals', "instead of lower and upper"),
    ("upper = 5", "upper = 5\nlower = 6", 'constraint "stays low".lower', "exceeds upper"),
    ("upper = 5", "upper = [5, 6]", 'constraint "stays low".upper', "must be a number$"),
    ("upper = 5", "upper = [[5]]", 'constraint "stays low".upper', "must be a number$"),
    ("upper = 5", "upper = 5\npenalty = 0", 'constraint "stays low".penalty', "greater than 0"),
    (COST, f"{COST}\n{OUTPUT}ball.position'", 'output "far".value', "must be a number, but is a vector of 3"),
    (COST, f"{COST}\n{OUTPUT}ball.far'", 'output "far".value', "ball.far"),
    (COST, f"{COST}\n{OUTPUT}1'\nat = 'always'", 'output "far".at', '"end" or a time'),
    (COST, f"{COST}\n{OUTPUT}1'\n{OUTPUT}2'", "output[1].name", "already the name of another output"),
    (COST, f'{COST}\n[objective]\nstop = "now"', "objective.stop", "'met' or 'converged'"),
    (COST, f"{COST}\n[objective]\ngoal = nan", "objective.goal", "finite"),
]


@pytest.mark.parametrize(("old", "new", "where", "message"), CASES)
def test_refused(refused: Refused, names: Names, old: str, new: str, where: str, message: str) -> None:
    names(refused((old, new)), where, message)


def test_several_formulas_are_reported_together(refused: Refused) -> None:
    error = refused((TARGET, 'value = "1 +"'), ('"ball.position[2]"', '"ball.position[3]"'))
    assert len(error.issues) == 2


def test_varied_restitution_needs_rigid_contacts(refused: Refused) -> None:
    soft = "[contact]\nfrequency = 5\n[ground]\nrestitution = 0.0 #"
    error = refused(("[ground]", soft), ("restitution = 0.5", ""), (SETS, 'sets = "ground.restitution"'))
    assert error.issues[0].where == 'variable "throw".sets'
    assert "soft" in error.issues[0].message
