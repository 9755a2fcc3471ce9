"""Functions written in C give what casadi gives, to the bit, and their adjoints what casadi's reverse mode gives."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from symphys.kernel import Cache, Call, Layout, Program, compile_program
from symphys.kernel.instructions import graph_of

ARGUMENTS = (3, 2)
SMOOTH = [
    ca.sin, ca.cos, ca.tanh, ca.atan, ca.erf, ca.asinh, ca.fabs, ca.sign, ca.floor, ca.ceil,
    lambda a: a**2, lambda a: -a, lambda a: 2 * a, lambda a: ca.exp(ca.tanh(a)), lambda a: ca.log(1 + ca.fabs(a)),
    lambda a: ca.sqrt(1 + a * a), lambda a: 1 / (1 + a * a), lambda a: (1 + ca.fabs(a)) ** 1.5,
    lambda a: ca.log1p(ca.fabs(a)), lambda a: ca.expm1(ca.tanh(a)), lambda a: ca.tan(ca.sin(a)),
    lambda a: ca.asin(ca.tanh(a)), lambda a: ca.acos(ca.tanh(a)), lambda a: ca.cosh(ca.sin(a)),
    lambda a: ca.sinh(ca.cos(a)), lambda a: ca.acosh(1.5 + a * a), lambda a: ca.atanh(0.9 * ca.sin(a)),
]  # fmt: skip
PAIRS = [
    lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / (1 + b * b), ca.fmin, ca.fmax,
    ca.atan2, ca.hypot, ca.copysign, lambda a, b: ca.fmod(a, 1 + b * b), lambda a, b: ca.remainder(a, 1 + b * b),
    lambda a, b: (1 + a * a) ** ca.tanh(b), lambda a, b: ca.if_else(a < b, a, b * b), lambda a, b: a <= b,
    lambda a, b: ca.if_else(ca.logic_and(a > 0, ca.logic_not(b > 0)), a, 0), lambda a, b: ca.logic_or(a, b < 0),
    lambda a, b: ca.if_else(a == b, 1, b), lambda a, b: (a != b) + 3 * a, lambda a, b: ca.fmin(a, 0.5) + b,
    lambda a, b: ca.fmax(0.25, b) - a, lambda a, b: ca.if_else(a, b, 1.5),
]  # fmt: skip
step = st.tuples(st.integers(0, len(SMOOTH) + len(PAIRS) - 1), st.integers(0, 10**6), st.integers(0, 10**6))


def build(steps: list[tuple[int, int, int]]) -> Any:
    """A function of two arguments from random operations on what there is so far; all values are results."""
    x, y = (ca.SX.sym(name, size) for name, size in zip("xy", ARGUMENTS, strict=True))
    values = [*ca.vertsplit(x), *ca.vertsplit(y), ca.SX(0.5)]
    for op, i, j in steps:
        a, b = values[i % len(values)], values[j % len(values)]
        values.append(SMOOTH[op](a) if op < len(SMOOTH) else PAIRS[op - len(SMOOTH)](a, b))
    return ca.Function("random", [x, y], [ca.vertcat(*values[6:]), values[-1] + x])


def alone(functions: list[Any]) -> Program:
    """Each function once, on z."""
    at = Layout()
    x, y = (at.take(size) for size in ARGUMENTS)
    calls = [Call(f, (x, y), tuple(at.take(f.numel_out(i)) for i in range(f.n_out()))) for f in functions]
    results = {f"f{i}r{j}": place for i, call in enumerate(calls) for j, place in enumerate(call.outputs)}
    z = type(x)(x.offset, sum(ARGUMENTS))
    return Program(at.size, z, type(x)(0, 0), 0, results, prologue=tuple(calls))


def compare(functions: list[Any], cache: Cache, z: Any, precision: Any = "double") -> None:
    kernel = compile_program(alone(functions), cache=cache, threads=1, precision=precision)
    seed = np.random.default_rng(3).normal(size=sum(p.size for p in kernel.program.outputs.values()))
    outputs, gradient = kernel.gradient(z, seed)
    symbol = ca.SX.sym("z", sum(ARGUMENTS))
    values = ca.vertcat(*(v for f in functions for v in f.call([symbol[:3], symbol[3:]], True, False)))
    wanted = ca.Function("wanted", [symbol], [values, ca.jtimes(values, symbol, ca.DM(seed), True)])
    close = {"rtol": 1e-9, "atol": 1e-9} if precision == "double" else {"rtol": 1e-3, "atol": 1e-3}
    for i, row in enumerate(z):
        exact, slope = (value.full().ravel() for value in wanted(row))
        mine = np.concatenate([block[i] for block in outputs.values()])
        if precision == "double":
            np.testing.assert_array_equal(mine, exact)
        else:
            np.testing.assert_allclose(mine, exact, **close)
        np.testing.assert_allclose(gradient[i], slope, **close)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.lists(step, min_size=1, max_size=25), min_size=4, max_size=4),
    st.lists(st.lists(st.floats(-3, 3, width=16), min_size=5, max_size=5), min_size=3, max_size=3),
)
def test_random_functions(cache: Cache, steps: list[list[tuple[int, int, int]]], z: list[list[float]]) -> None:
    compare([build(s) for s in steps], cache, np.array(z))


def test_every_operation_alone(cache: Cache) -> None:
    ops = range(len(SMOOTH) + len(PAIRS))
    functions = [build([(op, 0, 4)]) for op in ops] + [build([(op, 2, 2)]) for op in ops]
    z = np.array([[-1.5, 0.3, 0.0, 1.0, 0.7], [0.7, -0.3, 2.0, 1.0, 0.7], [0.2, 0.0, -2.0, 0.5, -3.0]])
    compare(functions, cache, z)


def test_every_operation_alone_in_single_precision(cache: Cache) -> None:
    ops = range(len(SMOOTH) + len(PAIRS))
    compare([build([(op, 0, 4)]) for op in ops], cache, np.array([[-1.3, 0.3, 0.1, 1.0, 0.7]]), "single")


def test_a_long_function_is_cut(cache: Cache) -> None:
    random = np.random.default_rng(5)
    smooth = [0, 1, 2, 15, 16]  # no growth
    steps = [(int(random.choice(smooth)), *map(int, random.integers(0, 10**6, 2))) for _ in range(900)]
    steps += [(len(SMOOTH) + k % 3, *map(int, random.integers(0, 900, 2))) for k in range(300)]
    compare([build(steps)], cache, np.array([[0.1, -0.2, 0.3, 0.4, -0.5]]))


@pytest.mark.parametrize("pair", [(0, 1), (1, 0)])
def test_nan_passes_fmin_and_fmax(cache: Cache, pair: tuple[int, int]) -> None:
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    i, j = pair
    extremes = [ca.fmin(x[i], 1), ca.fmin(1, x[i]), ca.fmax(x[i], 1), ca.fmin(x[i], x[j]), ca.fmax(x[i], x[j])]
    kernel = compile_program(alone([ca.Function("extremes", [x, y], [ca.vertcat(*extremes)])]), cache=cache)
    z = np.array([[np.nan, 0, 0, 0, 0], [0, np.nan, 0, 0, 0], [2, 3, 0, 0, 0]], dtype=float)
    values = kernel.forward(z)["f0r0"]
    assert np.isnan(values[:2, 3:]).all()
    assert np.isnan(values[i, :3]).all()
    np.testing.assert_array_equal(values[2], [1, 1, (2, 3)[i], 2, 3])


def test_equal_values_are_computed_once() -> None:
    x = ca.SX.sym("x")
    doubled = graph_of(ca.Function("f", [x], [ca.sin(x) * ca.cos(x) + ca.cos(x) * ca.sin(x)]))
    assert [node.op for node in doubled.nodes] == ["input", "sin", "cos", "mul", "add"]


def test_a_branch_becomes_one_select() -> None:
    x = ca.SX.sym("x")
    branch = graph_of(ca.Function("f", [x], [ca.if_else(x > 0, x, 2 * x)]))
    assert [branch.nodes[i].op for i in branch.needed()] == ["const", "input", "lt", "add", "select"]
