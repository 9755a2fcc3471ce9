"""A function that is put in place gives what it gives as it is written, for every casadi type and for zeros."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.maths.inlined import inlined


def written(a: Any, t: Any) -> Any:
    """Some arithmetic of a vector and a number."""
    return ca.vertcat(a[0] * t + ca.sin(a[1]), a[2] / (1 + t * t))


put = inlined(3, 1)(written)
A, T = np.array([0.3, -1.2, 2.0]), 0.7


def test_numbers() -> None:
    assert np.array_equal(np.array(put(A, T)), np.array(written(ca.DM(A), ca.DM(T))))


def test_symbols() -> None:
    for kind in (ca.SX, ca.MX):
        a, t = kind.sym("a", 3), kind.sym("t")
        here, there = (ca.Function("f", [a, t], [each(a, t)]) for each in (put, written))
        assert np.array_equal(np.array(here(A, T)), np.array(there(A, T)))


def test_constants_are_folded() -> None:
    """What is multiplied by zero is gone, as it would be if it were written out."""
    t = ca.SX.sym("t")
    a = ca.vertcat(0, 0, t)
    assert put(a, t).nnz() == written(a, t).nnz()
    assert ca.Function("f", [t], [put(a, t)]).n_nodes() == ca.Function("f", [t], [written(a, t)]).n_nodes()
    assert ca.Function("f", [t], [put(ca.SX(3, 1), t)]).n_nodes() < ca.Function("f", [t], [put(a, t)]).n_nodes()
