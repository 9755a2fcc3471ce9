"""Functions written in C give what casadi gives, to the bit, and their adjoints what casadi's reverse mode gives."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tools.repeats import few
from worlds.operations import ARGUMENTS, PAIRS, SMOOTH, alone, build, every_operation, long_function

from symphys.codegen import Cache, compile_program
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.writer import write
from symphys.codegen.graph.graph import taped
from symphys.codegen.graph.instructions import graph_of, instructions_of

step = st.tuples(st.integers(0, len(SMOOTH) + len(PAIRS) - 1), st.integers(0, 10**6), st.integers(0, 10**6))


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


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.lists(step, min_size=1, max_size=25), min_size=4, max_size=4),
    st.lists(st.lists(st.floats(-3, 3, width=16).filter(bool), min_size=5, max_size=5), min_size=3, max_size=3),
)
def test_random_functions(cache: Cache, steps: list[list[tuple[int, int, int]]], z: list[list[float]]) -> None:
    """Not of zeros, whose sign may differ: casadi's selection is a sum, which loses it, and atan2 makes pi of it."""
    compare([build(s) for s in steps], cache, np.array(z))


@pytest.mark.slow
def test_every_operation_alone(cache: Cache) -> None:
    z = np.array([[-1.5, 0.3, 0.0, 1.0, 0.7], [0.7, -0.3, 2.0, 1.0, 0.7], [0.2, 0.0, -2.0, 0.5, -3.0]])
    compare(every_operation(), cache, z)


@pytest.mark.slow
def test_every_operation_alone_in_single_precision(cache: Cache) -> None:
    ops = range(len(SMOOTH) + len(PAIRS))
    compare([build([(op, 0, 4)]) for op in ops], cache, np.array([[-1.3, 0.3, 0.1, 1.0, 0.7]]), "single")


def test_constants_in_a_row_are_written_by_a_loop(cache: Cache) -> None:
    """Zeros and others, beside and between what is computed; a thousand more of them make no longer text."""

    def function(count: int) -> ca.Function:
        a, b = (ca.SX.sym(name, size) for name, size in zip("ab", ARGUMENTS, strict=True))
        rows = [ca.DM.zeros(count), a, 2.5 * ca.DM.ones(count), b * a[0], ca.DM.zeros(3), ca.DM.zeros(count)]
        return ca.Function("rows", [a, b], [ca.densify(ca.vertcat(*rows))])

    def lines(count: int) -> list[str]:
        return write("f", graph_of(function(count)), Form(primal=2, adds=False)).splitlines()

    compare([function(20)], cache, np.array([[0.3, -0.2, 1.0, 0.5, 2.0], [0.1, 0.7, -2.0, 0.5, -3.0]]))
    assert len(lines(1020)) == len(lines(20)) and sum("for (" in line for line in lines(20)) == 3


@pytest.mark.slow
def test_a_long_function_is_cut(cache: Cache) -> None:
    compare([long_function()], cache, np.array([[0.1, -0.2, 0.3, 0.4, -0.5]]))


def test_sines_and_cosines_are_found_together(cache: Cache) -> None:
    """In numbers of all sizes they are casadi's to the bit, which finds one after the other."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    turned = ca.Function("turned", [x, y], [ca.cos(x[0]) + x[1] * ca.sin(x[0]), ca.sin(y[0]) * ca.sin(x[0])])
    text = write("f", graph_of(turned), Form(2, adds=False))
    assert text.count("sincos_(") == 1 and text.count(" sin_(") == 1 and " cos_(" not in text
    sizes = np.random.default_rng(0).normal(size=(400, 5)) * np.logspace(-9, 6, 400)[:, None]
    compare([turned], cache, sizes)


@few("pair", [(0, 1), (1, 0)], 1)
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


def test_divisions_by_powers_of_two_are_products_to_the_last_bit() -> None:
    """Others are not: 1/3 is rounded, and 2^-1074 has no reciprocal."""
    x = ca.SX.sym("x")
    for divisor, op in ((4.0, "mul"), (-0.5, "mul"), (3.0, "div"), (2.0**-1074, "div")):
        quotient = graph_of(ca.Function("f", [x], [x / divisor]))
        assert quotient.nodes[quotient.results[0][0]].op == op, divisor


def test_adjoints_find_what_the_call_has_computed() -> None:
    """Of x y / (y + x) the sum and the quotient, though written the other way round; what is new is one reciprocal."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [x * y / (y + x)])
    instructions = instructions_of(function)
    pair = taped(instructions.graph(), instructions.adjoint((True, True), (True,)))
    assert pair is not None
    operations = [pair.forward.nodes[k].op for k in pair.forward.needed()]
    assert (operations.count("add"), operations.count("div")) == (1, 2)


def test_a_branch_becomes_one_select() -> None:
    x = ca.SX.sym("x")
    branch = graph_of(ca.Function("f", [x], [ca.if_else(x > 0, x, 2 * x)]))
    assert [branch.nodes[i].op for i in branch.needed()] == ["const", "input", "lt", "add", "select"]
