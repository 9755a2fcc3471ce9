"""Whatever is typed, either a formula or a FormulaError comes out; valid formulas mean what Python's floats mean."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import casadi as ca
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys.expression import FUNCTIONS, FormulaError, parse

Meaning = Callable[[float, float], float]
Pair = tuple[str, Meaning]

PIECES = [
    *("+", "-", "*", "**", "/", "//", "(", ")", "[", "]", ",", ".", ":", " ", "\n", "=", "<", "^", "'", "#", "@"),
    *("1", "0", "2.5", "1e9", "9" * 30, "x", "ball", "ball.position", "lambda", "if", "else", "for", "in", "not"),
    *FUNCTIONS,
]
NAMES = {"x": 1.5, "ball.position": [1.0, 2.0, 3.0]}


def read_and_evaluate(text: str) -> None:
    with contextlib.suppress(FormulaError):
        value = parse(text).evaluate(NAMES)
        assert isinstance(value, ca.DM)
        assert value.shape[1] == 1


@settings(deadline=None)
@given(st.text(max_size=200))
def test_any_text(text: str) -> None:
    read_and_evaluate(text)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from(PIECES), max_size=30))
def test_any_mixture_of_pieces(pieces: list[str]) -> None:
    read_and_evaluate("".join(pieces))


def number(value: float) -> Pair:
    return repr(value), lambda x, y: value


def binary(a: Pair, b: Pair, symbol: str) -> Pair:
    operations: dict[str, Callable[[float, float], float]] = {
        "+": lambda p, q: p + q,
        "-": lambda p, q: p - q,
        "*": lambda p, q: p * q,
    }
    return f"({a[0]} {symbol} {b[0]})", lambda x, y: operations[symbol](a[1](x, y), b[1](x, y))


def called(a: Pair, name: str) -> Pair:
    functions: dict[str, Callable[[float], float]] = {
        "sin": math.sin,
        "cos": math.cos,
        "tanh": math.tanh,
        "atan": math.atan,
        "abs": abs,
    }
    return f"{name}({a[0]})", lambda x, y: functions[name](a[1](x, y))


def chosen(a: Pair, b: Pair, name: str) -> Pair:
    choose = max if name == "max" else min
    return f"{name}({a[0]}, {b[0]})", lambda x, y: choose(a[1](x, y), b[1](x, y))


LEAVES = st.one_of(
    st.floats(-10, 10).map(number),
    st.just(("x", lambda x, y: x)),
    st.just(("ball.speed", lambda x, y: y)),
)
FORMULAS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.builds(binary, inner, inner, st.sampled_from("+-*")),
        st.builds(called, inner, st.sampled_from(["sin", "cos", "tanh", "atan", "abs"])),
        st.builds(chosen, inner, inner, st.sampled_from(["min", "max"])),
        inner.map(lambda a: (f"-{a[0]}", lambda x, y: -a[1](x, y))),
    ),
    max_leaves=8,
)


@settings(deadline=None)
@given(FORMULAS, st.floats(-10, 10), st.floats(-10, 10))
def test_agrees_with_floats(formula: Pair, x: float, y: float) -> None:
    text, meaning = formula
    value = float(parse(text).evaluate({"x": x, "ball.speed": y}))
    assert value == pytest.approx(meaning(x, y), rel=1e-9, abs=1e-9)
