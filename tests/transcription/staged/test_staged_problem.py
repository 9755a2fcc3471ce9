"""A problem step by step has the numbers and slopes of the problem as a whole."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

from symphys.errors import SymphysError
from symphys.problem import Problem, load_problem
from symphys.shooting import StagedMotion, StagedProblem
from symphys.solvers.ddp.backward_pass import Bounds, backward_pass
from symphys.solvers.ddp.knots import knot_steps
from symphys.transcription import Transcription, transcribe
from symphys.transcription.staged import stage_functions
from symphys.transcription.staged.tangent import Tangent
from symphys.transcription.staged.term_slopes import TermGroups
from symphys.types import Array

CART = """
[simulation]
duration = 0.3
dt = 0.01

[[include]]
file = "robots/cart_pendulum.toml"

[[variable]]
name = "push"
sets = "rail.command"
knots = {knots}
interpolation = "{interpolation}"
guess = 5
spread = 2

[[variable]]
name = "bob"
sets = "pole.mass"
guess = 0.3
spread = 0.05

[[variable]]
name = "hinge"
sets = "pivot.anchor[2]"
guess = 0.0
spread = 0.02

[[variable]]
name = "shove"
sets = "cart.velocity[0]"
guess = 0.2
spread = 0.1

[[cost]]
name = "effort"
at = "always"
squares = "rail.command * time"
weight = 0.001

[[phase]]
name = "first"
share = 0.4

[[phase]]
name = "then"

[[cost]]
name = "power"
during = "then"
squares = "0.1 * rail.command * rail.rate"

[[cost]]
name = "early"
at = 0.1
value = "exp(pivot.angle) + pole.mass * rail.rate"

[[target]]
name = "ahead"
value = "[rail.position - 0.3, pivot.rate - pole.mass]"
tolerance = 0.1

[[constraint]]
name = "slow"
during = "then"
value = "[rail.rate, rail.command / 10]"
lower = [-1, -0.1]
upper = [0.35, 0.55]
penalty = 3

[[constraint]]
name = "there"
value = "rail.position"
lower = 0.25
upper = 0.25
"""
BALL = """
[simulation]
duration = 0.5
dt = 0.01

[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 0.5
position = [0, 0, 0.4]
velocity = [1, 0.3, 0]
angular_velocity = [0, 3, 1]

[ground]
friction = 0.4
restitution = 0.6

[[variable]]
name = "push"
sets = "ball.force"
knots = {knots}
interpolation = "{interpolation}"
guess = [0.1, 0, 0.3]
spread = 0.1

[[variable]]
name = "grip"
sets = "ground.friction"
guess = 0.4
lower = 0.1

[[cost]]
name = "effort"
at = "always"
squares = "ball.force"

[[target]]
name = "there"
value = "ball.position - [0.6, 0.2, 0.3]"
tolerance = 0.1
"""
WHOLE = """
[simulation]
duration = 0.3
dt = 0.01

[[include]]
file = "robots/cart_pendulum.toml"

[[variable]]
name = "T"
sets = "simulation.duration"
guess = 0.33
spread = 0.02

[[variable]]
name = "push"
sets = "rail.command"
knots = {knots}
interpolation = "{interpolation}"
guess = 5
spread = 2

[[variable]]
name = "shove"
sets = "cart.velocity[0]"
guess = 0.2
spread = 0.1

[[variable]]
name = "gain"
sets = "hold.k"
guess = 3
spread = 1

[[force]]
name = "hold"
on = "rail.command"
value = "-hold.k * rail.position * cos(3 * time)"
numbers = {{ k = 3 }}

[[force]]
name = "wind"
on = "pole.force[0]"
value = "0.2 * sin(20 * time) - 0.05 * pole.velocity[0]"

[[phase]]
name = "first"
share = 0.4

[[phase]]
name = "then"

[[cost]]
name = "effort"
at = "always"
squares = "[rail.command * time, rail.command * rail.rate]"
weight = 0.001

[[cost]]
name = "power"
during = "then"
value = "0.1 * (rail.command * rail.rate)**2 + duration * push[1]**2"

[[cost]]
name = "knots"
squares = "[push, shove]"
weight = 1e-3

[[cost]]
name = "all knots at every instant"
at = "always"
squares = "sum(push) * rail.rate"
weight = 1e-3

[[cost]]
name = "cost of transport"
value = "integral(rail.command**2 + 5 * gain) / (end.rail.position - start.rail.position + start.cart.velocity[0])"

[[cost]]
name = "soon"
value = "duration + 0.1 * end.time * average(rail.rate)"

[[target]]
name = "as it was, shifted"
value = "[end.pivot.angle - start.pivot.angle, end.rail.position - start.rail.position - 0.3, start.rail.command / 10]"
tolerance = 0.1

[[target]]
name = "halfway"
at = "end of first"
value = "[rail.position - end.rail.position / 2, rail.command * 0.01 - average(pivot.rate), duration - time]"
tolerance = 0.1

[[target]]
name = "faster than at the start"
at = "end of first"
value = "rail.rate - 2 * start.cart.velocity[0]"
tolerance = 0.1

[[constraint]]
name = "slow"
during = "then"
value = "[rail.rate, rail.command / 10 + pivot.angle]"
lower = [-1, -0.1]
upper = [0.35, 0.3]
penalty = 3

[[constraint]]
name = "cheap"
value = "integral(rail.command**2) + 0.01 * sumsqr(push)"
upper = 5
"""
CASES = [
    (BALL, 10, "constant"),
    (CART, 5, "linear"),
    (CART, 30, "constant"),
    (CART, 4, "constant"),
    (WHOLE, 30, "constant"),
    (WHOLE, 4, "linear"),
]


def read(text: str) -> Problem:
    """The problem of a text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.toml"
        file.write_text(text, encoding="utf-8")
        return load_problem(file)


@cache
def made(text: str, knots: int, interpolation: str) -> tuple[Transcription, StagedProblem, StagedMotion]:
    """A problem, its steps, and a motion off the guess."""
    problem = read(text.format(knots=knots, interpolation=interpolation))
    transcription = transcribe(problem, backend="casadi")
    assert transcription.shooting.staged is not None
    staged = transcription.shooting.staged()
    return transcription, staged, staged.roll_out(transcription.shooting.start(3), 0.0)


@few("case", CASES, 1)
def test_measures_are_those_of_the_whole(case: tuple[str, int, str]) -> None:
    transcription, staged, motion = made(*case)
    Z = np.stack([motion.z, transcription.shooting.start(4)])
    motions = [motion, staged.roll_out(Z[1], 0.0)]
    objective, limits = staged.measure(Z, np.stack([m.x for m in motions]), np.stack([m.u for m in motions]))
    found = transcription.shooting.evaluator.value(Z, 0.0)
    np.testing.assert_allclose(objective, found.objective, rtol=1e-12)
    for z, row in zip(Z, limits, strict=True):
        np.testing.assert_allclose(row, np.array(transcription.shooting.nlp.expression(z, 0.0)[1]).ravel(), atol=1e-12)
    shooting = transcription.shooting
    np.testing.assert_array_equal(staged.lower, shooting.constraint_lower)
    np.testing.assert_array_equal(staged.upper, shooting.constraint_upper)


@few("case", CASES, 1)
def test_the_gradient_along_the_steps_is_that_of_the_whole(case: tuple[str, int, str]) -> None:
    transcription, staged, motion = made(*case)
    size, rollout, terms = len(motion.z), transcription.rollout, transcription.terms
    free = Bounds(np.full(size, -np.inf), np.full(size, np.inf), np.ones(size))
    merits = [(np.zeros(len(staged.lower)), terms.objective)]
    if not transcription.problem.free_duration:  # it is part of the penalties in the merit
        merits.append((2 * staged.penalties, terms.objective + terms.penalties))
    for penalties, merit in merits:
        whole = ca.Function("merit", [rollout.z, rollout.smoothing], [merit, ca.gradient(merit, rollout.z)])
        value, gradient = (np.array(part).ravel() for part in whole(motion.z, 0.0))
        costs = staged.expand(motion, np.zeros(len(staged.lower)), penalties)
        policy = backward_pass(staged.linearize_from_end(motion), costs, knot_steps(staged), staged.statics, free, 1.0)
        assert policy is not None
        assert costs.value == pytest.approx(value[0], rel=1e-12)
        np.testing.assert_allclose(policy.gradient, gradient, atol=1e-10 * np.abs(gradient).max())


@pytest.mark.slow
@few("case", CASES[4:], 1)
def test_compiled_terms_are_those_of_the_virtual_machine(
    case: tuple[str, int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    transcription, staged, motion = made(*case)
    monkeypatch.setattr(stage_functions, "MIN_COMPILED_OPERATIONS", 0)
    groups = TermGroups(transcription.rollout, Tangent(transcription.rollout), "simd", 1)
    monkeypatch.setattr(staged, "_groups", groups)
    Z, X, U = motion.z[None], motion.x[None], motion.u[None]
    slopes, costs = staged.limit_slopes(motion), staged.expand(motion, np.ones(len(staged.lower)), staged.penalties)
    objective, limits = staged.measure(Z, X, U)
    sloped = [functions for group in groups._sloped.values() for _, functions in group]
    assert sloped and all(functions._kernel is not None for functions in groups._values + sloped)
    _, plain, _ = made.__wrapped__(*case)
    expected, same = plain.limit_slopes(motion), plain.measure(Z, X, U)
    np.testing.assert_allclose(objective, same[0], rtol=1e-13)
    np.testing.assert_allclose(limits, same[1], rtol=1e-13)
    for found, wanted in zip(slopes[1:], expected[1:], strict=True):
        np.testing.assert_allclose(found.toarray(), wanted.toarray(), rtol=1e-12, atol=1e-13)
    other = plain.expand(motion, np.ones(len(staged.lower)), staged.penalties)
    for name, found in vars(costs).items():
        np.testing.assert_allclose(found, getattr(other, name), rtol=1e-11, atol=1e-12)


def state_slopes(staged: StagedProblem, motion: StagedMotion) -> Array:
    """(N + 1, n, len(z)): tangents of all states by z."""
    found = staged.linearize(motion)
    weights = staged.weights.toarray().reshape(staged.steps, staged.input_size, -1)
    slopes = np.zeros((staged.steps + 1, staged.tangent_size, len(motion.z)))
    slopes[0][:, staged.statics] = found.start
    for k in range(staged.steps):
        slopes[k + 1] = found.a[k] @ slopes[k] + found.b[k] @ weights[k]
        slopes[k + 1][:, staged.statics] += found.c[k]
    return slopes


@few("case", CASES, 1)
def test_slopes_of_limits_are_those_of_the_whole(case: tuple[str, int, str]) -> None:
    transcription, staged, motion = made(*case)
    values, by_x, by_u, by_s = staged.limit_slopes(motion)
    total = by_x @ state_slopes(staged, motion).reshape(-1, len(motion.z)) + by_u @ staged.weights.toarray()
    total[:, staged.statics] += by_s.toarray()
    expected, slopes = transcription.functions.constraint_jacobian(motion.z, 0.0)
    np.testing.assert_allclose(values, np.array(expected).ravel(), atol=1e-12)
    np.testing.assert_allclose(total, np.array(slopes), atol=1e-9)


def test_second_derivatives_are_those_of_gauss_and_newton() -> None:
    transcription, staged, motion = made(BALL, 10, "constant")
    costs = staged.expand(motion, np.zeros(0), np.zeros(0))
    slopes, weights = state_slopes(staged, motion), staged.weights.toarray().reshape(staged.steps, 3, -1)
    one = np.eye(len(motion.z))[staged.statics]
    total = one.T @ costs.ss @ one
    for k in range(staged.steps + 1):
        x = slopes[k]
        total += x.T @ costs.xx[k] @ x
        cross = one.T @ costs.sx[k] @ x
        if k < staged.steps:
            u = weights[k]
            total += u.T @ costs.uu[k] @ u
            cross += u.T @ costs.ux[k] @ x + u.T @ costs.uy[k] @ slopes[k + 1] + one.T @ costs.su[k] @ u
        total += cross + cross.T
    jacobian = transcription.shooting.evaluator.jacobian(motion.z[None], 0.0).jacobian
    assert jacobian is not None
    np.testing.assert_allclose(total, 2 * jacobian[0].T @ jacobian[0], atol=1e-9)


def test_an_integral_of_knots_is_refused_by_name() -> None:
    problem = read(
        WHOLE.format(knots=5, interpolation="constant").replace(
            "integral(rail.command**2) +", "integral(sumsqr(push)) +"
        )
    )
    staged = transcribe(problem, backend="casadi").shooting.staged
    assert staged is not None
    with pytest.raises(SymphysError, match=r"cheap: .*rail.command"):
        staged()
