"""The first number that is not finite is named: where, in which step, of what, by which operation."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.trajectory import NotFinite
from symphys.transcription import first_non_finite, first_non_finite_derivative
from symphys.transcription.nan_tracing import non_finite_operation
from symphys.verification import examine

THROW = """
title = "A throw"
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 0]
{more}
"""
MASS = """
[[variable]]
name = "weight"
sets = "ball.mass"
guess = 1
[[variable]]
name = "push"
sets = "ball.force"
guess = [0, 0, 1]
[[target]]
name = "there"
value = "ball.position[0] - 1"
tolerance = 0.01
"""
TURN = """
[[variable]]
name = "turn"
sets = "ball.orientation"
guess = [1, 0, 0, 0]
[[target]]
name = "there"
value = "ball.position[0] - 1"
tolerance = 0.01
"""


def test_a_formula_that_is_not_finite(make):
    """z = 1 - g t^2 / 2 falls below 0.9 between 0.14 s and 0.16 s."""
    text = '[[constraint]]\nname = "low"\nvalue = "sqrt(ball.position[2] - 0.9)"\nat = "always"\nupper = 9'
    throw = make(THROW.format(more=text))
    z = throw.shooting.start(0)
    fault = examine(throw, z)["fault"]
    assert fault == "constraint 'low' is not finite at t = 0.16 s: sqrt(-0.025568), made from ball.position"
    assert not throw.judge(z).solved
    assert np.isnan(throw.judge(z).worst)


@pytest.mark.parametrize("kind", ["target", "cost"])
def test_every_kind_of_formula_is_looked_at(make, kind):
    rest = 'value = "1 / ball.velocity[1]"\nat = 0.1' + ("\ntolerance = 1" if kind == "target" else "")
    throw = make(THROW.format(more=f'[[{kind}]]\nname = "steep"\n{rest}'))
    fault = examine(throw, throw.shooting.start(0))["fault"]
    assert fault == f"{kind} 'steep' is not finite at t = 0.1 s: 1 / 0, made from ball.velocity"


def test_a_derivative_of_a_formula_that_is_not_finite(make):
    text = '[[target]]\nname = "root"\nvalue = "sqrt(ball.velocity[1])"\ntolerance = 1'
    throw = make(THROW.format(more=text))
    found = examine(throw, throw.shooting.start(0))
    assert found["fault"].startswith("the derivative of target 'root' is not finite at t = 0.2 s: ")
    assert np.isnan(found["gradient"][0]["error"])


def test_a_step_that_is_not_finite(make):
    throw = make(THROW.format(more=MASS))
    z = np.array([1.0, 0, 0, 0.0, 0, 0, 1])
    with pytest.raises(NotFinite, match=r"step 1 \(t = 0.02 s\).*'ball'.*t = 0 s: 0 / 0.*ball.mass"):
        throw.record(z)


def test_a_start_that_is_not_finite(make):
    throw = make(THROW.format(more=TURN))
    z = np.array([1.0, 0, 0, 0, 0, 0, 0])
    with pytest.raises(NotFinite, match=r"step 0 .*ball.orientation"):
        throw.record(z)


def test_a_derivative_of_a_step_that_is_not_finite(make):
    """A step that adds sqrt(y): nothing at y = 0, but with an infinite slope; the last such step is named."""
    throw = make(THROW.format(more=MASS))
    record = throw.record(throw.shooting.start(0))
    step = throw.rollout.step
    x, u, p, smoothing = (ca.SX.sym(name, step.size1_in(i)) for i, name in enumerate("xups"))
    bent = step(x, u, p, smoothing) + ca.sqrt(x[1])
    throw.rollout.__dict__["step"] = ca.Function("step", [x, u, p, smoothing], [bent])
    assert first_non_finite(throw.rollout, record.arrays) == ""
    fault = first_non_finite_derivative(throw.rollout, record.arrays)
    assert fault.startswith("the derivative of the step from t = 0.18 s to 0.2 s is not finite: ")
    assert "ball.position" in fault


def test_blame_follows_the_number_that_reaches_the_result():
    """A division by zero in a branch that is not taken spoils nothing."""
    x = ca.SX.sym("x", 2)
    taken = ca.if_else(x[0] > 0, x[1] + 1, 1 / x[0])
    f = ca.Function("f", [x], [taken, ca.log(x[1] - 2) * x[0]])
    assert non_finite_operation(f, [np.array([1.0, 3.0])]) is None
    found = non_finite_operation(f, [np.array([0.0, 3.0])])
    assert (found.operation, found.arguments, found.result) == ("1 / 0", ((0, 0),), (0, 0))
    found = non_finite_operation(f, [np.array([1.0, 1.0])])
    assert (found.operation, found.arguments, found.result) == ("log(-1)", ((0, 1),), (1, 0))


def test_blame_of_an_argument():
    x = ca.SX.sym("x", 2)
    found = non_finite_operation(ca.Function("f", [x], [x[0] * 2 + x[1]]), [np.array([1.0, np.nan])])
    assert (found.operation, found.arguments) == ("", ((0, 1),))
