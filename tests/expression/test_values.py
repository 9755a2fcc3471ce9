"""Formulas give the values that their text says, the same for every casadi type."""

from __future__ import annotations

import math
import pickle
from typing import Any

import casadi as ca
import numpy as np
import pytest

from symphys.expression import FUNCTIONS, parse

STATE = {
    "time": 2.0,
    "ball.position": [1.0, -2.0, 3.0],
    "ball.velocity": [0.5, 0.25, -1.0],
    "ball.orientation": [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)],
    "ball.mass": 4.0,
}
HALF = math.sqrt(0.5)

CASES = [
    ("1 + 2 * 3", [7]),
    ("2 ** 3 ** 2", [512]),
    ("-2 ** 2", [-4]),
    ("+1e-3", [1e-3]),
    ("0x10 + 1_000", [1016]),
    ("pi", [math.pi]),
    ("wrap_to_pi([3, 4, -4, 20 * pi + 1, -pi / 2])", [3, 4 - 2 * math.pi, 2 * math.pi - 4, 1, -math.pi / 2]),
    ("time / 4", [0.5]),
    ("ball.position[0:2] - [10, 0]", [-9, -2]),
    ("ball.position[-1]", [3]),
    ("ball.position[::2]", [1, 3]),
    ("ball.position[::-1]", [3, -2, 1]),
    ("ball.mass[0]", [4]),
    ("[ball.position[0:2], 0.5]", [1, -2, 0.5]),
    ("2 * ball.position", [2, -4, 6]),
    ("ball.position * ball.velocity", [0.5, -0.5, -3]),
    ("ball.position ** 2", [1, 4, 9]),
    ("ball.position\n  + [1,\n 2, 3]", [2, 0, 6]),
    ("sin(time)", [math.sin(2)]),
    ("cos(time)", [math.cos(2)]),
    ("tan(time)", [math.tan(2)]),
    ("asin(0.5)", [math.asin(0.5)]),
    ("acos(0.5)", [math.acos(0.5)]),
    ("atan(time)", [math.atan(2)]),
    ("atan2(-1, time)", [math.atan2(-1, 2)]),
    ("sinh(time)", [math.sinh(2)]),
    ("cosh(time)", [math.cosh(2)]),
    ("tanh(time)", [math.tanh(2)]),
    ("sqrt(time)", [math.sqrt(2)]),
    ("exp(time)", [math.exp(2)]),
    ("log(time)", [math.log(2)]),
    ("abs(ball.position)", [1, 2, 3]),
    ("sign(ball.position)", [1, -1, 1]),
    ("min(ball.position)", [-2]),
    ("max(ball.position)", [3]),
    ("min(ball.position, 0)", [0, -2, 0]),
    ("max(1, time, ball.mass)", [4]),
    ("clip(ball.position, -1, [0, 1, 2])", [0, -1, 2]),
    ("smooth_max(time, ball.mass, 0.5)", [4 + 0.5 * math.log(1 + math.exp(-4))]),
    ("smooth_max(ball.position, 1)", [math.log(math.exp(1) + math.exp(-2) + math.exp(3))]),
    ("smooth_min(ball.position, 0, 2)", [-2 * math.log(1 + math.exp(-x / 2)) for x in (1, -2, 3)]),
    ("hypot(3, 4)", [5]),
    ("norm(ball.position)", [math.sqrt(14)]),
    ("sumsqr(ball.position)", [14]),
    ("sum(ball.position)", [2]),
    ("mean(ball.position)", [2 / 3]),
    ("dot(ball.position, ball.velocity)", [-3]),
    ("cross([1, 0, 0], [0, 1, 0])", [0, 0, 1]),
    ("rotate(ball.orientation, [1, 0, 0])", [0, 1, 0]),
]


@pytest.mark.parametrize(("text", "expected"), CASES)
def test_value(text: str, expected: list[float]) -> None:
    value = parse(text).evaluate(STATE)
    assert value.shape == (len(expected), 1)
    np.testing.assert_allclose(np.array(value).ravel(), expected, atol=1e-14)


def test_every_function_is_tried() -> None:
    assert {name for name in FUNCTIONS if any(f"{name}(" in text for text, _ in CASES)} == set(FUNCTIONS)


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
@pytest.mark.parametrize(("text", "expected"), CASES)
def test_symbols_agree_with_numbers(kind: Any, text: str, expected: list[float]) -> None:
    symbols = {name: kind.sym("s", np.size(value)) for name, value in STATE.items()}
    value = parse(text).evaluate(symbols)
    function = ca.Function("f", list(symbols.values()), [value])
    np.testing.assert_allclose(np.array(function(*STATE.values())).ravel(), expected, atol=1e-14)


def test_names_are_collected() -> None:
    assert parse("ball.mass * norm(throw) + time + pi").names == {"ball.mass", "throw", "time"}


@pytest.mark.parametrize("text", ["norm(v)", "hypot(v[0], v[1])"])
def test_lengths_have_finite_derivatives_at_zero(text: str) -> None:
    v = ca.SX.sym("v", 3)
    value = parse(text).evaluate({"v": v})
    derivatives = ca.Function("d", [v], [ca.jacobian(value, v), ca.hessian(value, v)[0]])
    slope, curvature = derivatives([0, 0, 0])
    assert np.all(np.array(slope) == 0)
    assert np.all(np.isfinite(np.array(curvature)))


@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.3, 1e6])
def test_a_smooth_maximum_has_the_slopes_and_curvature_of_a_soft_choice(gap: float) -> None:
    v, width = ca.SX.sym("v", 2), 0.1
    value = parse("smooth_max(v[0], v[1], 0.1)").evaluate({"v": v})
    slope = ca.gradient(value, v)
    slopes, curvature = ca.Function("d", [v], [slope, ca.jacobian(slope, v)])([gap, 0])
    share = 1 / (1 + math.exp(-gap / width))
    np.testing.assert_allclose(np.array(slopes).ravel(), [share, 1 - share], atol=1e-14)
    bend = share * (1 - share) / width
    np.testing.assert_allclose(np.array(curvature), [[bend, -bend], [-bend, bend]], atol=1e-12)


@pytest.mark.parametrize(
    "text",
    ["smooth_max(v, 0.1)", "smooth_min(v, 0, 0.1)", "max(v, 0)", "min(v, 0)", "max(0, v)", "min(v)", "clip(v, -1, 1)"],
)
def test_a_nan_stays_a_nan(text: str) -> None:
    v = ca.SX.sym("v", 2)
    function = ca.Function("f", [v], [parse(text).evaluate({"v": v})])
    assert np.isnan(np.array(function([math.nan, 1])).ravel()[0])


def test_a_power_has_a_finite_slope_at_zero() -> None:
    x = ca.SX.sym("x")
    slope = ca.Function("d", [x], [ca.gradient(parse("x ** 2 + x ** 3").evaluate({"x": x}), x)])
    assert float(slope(0)) == 0


def test_a_formula_survives_pickling() -> None:
    formula = parse("max(ball.position, [0, 0, pi])")
    copied = pickle.loads(pickle.dumps(formula))
    assert copied == formula
    assert np.array_equal(np.array(copied.evaluate(STATE)), np.array(formula.evaluate(STATE)))
