"""A mass matrix factored from the leaves to the root solves what the dense matrix solves."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.dynamics.articulated.factorisation import factorise

PATHS = [[0], [0, 1], [0, 1, 2], [0, 1, 3], [0, 4]]
"""Of a branched tree: the coordinates that move each."""


@pytest.mark.parametrize("symmetric", [True, False])
def test_it_solves_as_the_dense_matrix(symmetric: bool) -> None:
    rng, n = np.random.default_rng(3), len(PATHS)
    dense = np.zeros((n, n))
    for k, path in enumerate(PATHS):
        dense[path, k], dense[k, path] = rng.normal(size=len(path)), rng.normal(size=len(path))
        dense[k, k] = 10
    dense = (dense + dense.T) / 2 if symmetric else dense
    rows = [{j: ca.SX(dense[i, j]) for j in range(n) if dense[i, j]} for i in range(n)]
    right = rng.normal(size=n)
    found = factorise(rows, symmetric).solve({k: ca.SX(value) for k, value in enumerate(right)})
    assert [float(found[k]) for k in range(n)] == pytest.approx(np.linalg.solve(dense, right), rel=1e-12)


def test_its_pivots_are_not_turned_into_divisions() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b", 2)
    matrix = factorise([{0: a}])
    solutions = ca.vertcat(*(matrix.solve({0: b[k]})[0] for k in range(2)))
    function = ca.Function("f", [a, b], [solutions])
    operations = [function.instruction_id(k) for k in range(function.n_instructions())]
    assert operations.count(ca.OP_DIV) == 1
