"""Adjoints of functions, by rows and by tables of slopes, are casadi's, and finite where casadi's are not."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.graphs import evaluated
from worlds.operations import ARGUMENTS, PAIRS, SMOOTH, build

from symphys.codegen.graph.instructions import instructions_of


def slopes(function: ca.Function, z: np.ndarray, seed: np.ndarray, tabled: bool) -> np.ndarray:
    adjoint = instructions_of(function).adjoint((True, True), (True,), tabled)
    return evaluated(adjoint, [z[:3], z[3:], seed])


@few("tabled", [False, True], 2)
def test_adjoints_are_those_of_casadi(tabled: bool) -> None:
    """Of random functions of all operations, with as many results as arguments, fewer and more."""
    rng, numbers = np.random.default_rng(5), len(SMOOTH) + len(PAIRS)
    symbol = ca.SX.sym("z", sum(ARGUMENTS))
    for _ in range(30):
        steps = [(int(rng.integers(numbers)), int(rng.integers(99)), int(rng.integers(99))) for _ in range(12)]
        function = joined(build(steps))
        values = function.call([symbol[:3], symbol[3:]], True, False)[0]
        z, seed = rng.uniform(0.2, 0.9, 5), rng.normal(size=values.numel())
        expected = ca.Function("wanted", [symbol], [ca.jtimes(values, symbol, ca.DM(seed), True)])(z).full().ravel()
        np.testing.assert_allclose(slopes(function, z, seed, tabled), expected, rtol=1e-9, atol=1e-9)


def joined(function: ca.Function) -> ca.Function:
    """Return the function with its results as one."""
    arguments = [ca.SX.sym("a", size) for size in ARGUMENTS]
    return ca.Function("joined", arguments, [ca.densify(ca.vertcat(*function.call(arguments, True, False)))])


@few("tabled", [False, True], 2)
def test_minima_of_equal_numbers_share_their_slope(tabled: bool) -> None:
    x, y = (ca.SX.sym("a", size) for size in ARGUMENTS)
    function = ca.Function("f", [x, y], [ca.fmin(x[0], y[0]) + 3 * ca.fmax(x[1], y[1])])
    found = slopes(function, np.array([2.0, 4.0, 0.0, 2.0, 4.0]), np.ones(1), tabled)
    np.testing.assert_array_equal(found, [0.5, 1.5, 0, 0.5, 1.5])


@few("tabled", [False, True], 2)
def test_a_branch_that_is_not_taken_adds_nothing(tabled: bool) -> None:
    """Though its root and its quotient have no finite slope there."""
    x, y = (ca.SX.sym("a", size) for size in ARGUMENTS)
    branch = ca.if_else(x[0] > 0, ca.sqrt(x[0]) * y[0] + x[1] / x[0], y[1])
    found = slopes(ca.Function("f", [x, y], [2 * branch]), np.array([0.0, 1.0, 0.0, 1.0, 1.0]), np.ones(1), tabled)
    np.testing.assert_array_equal(found, [0, 0, 0, 0, 2])


def test_an_unwanted_argument_has_no_slope() -> None:
    x, y = (ca.SX.sym("a", size) for size in ARGUMENTS)
    function = ca.Function("f", [x, y], [x[0] * y[0], ca.sin(x[1])])
    adjoint = instructions_of(function).adjoint((True, False), (True, False))
    assert (adjoint.sizes, adjoint.result_sizes) == ((3, 2, 1), (3,))
    assert evaluated(adjoint, [np.array([1.0, 2, 3]), np.array([5.0, 7]), np.array([2.0])]) == pytest.approx([10, 0, 0])
