"""A small problem, and its solution."""

from __future__ import annotations

import pytest
from worlds.thrown import TABLES

import symphys


@pytest.fixture(scope="session")
def problem() -> symphys.Problem:
    """A ball that is thrown and pushed."""
    return symphys.load(TABLES)


@pytest.fixture(scope="session")
def solution(problem: symphys.Problem) -> symphys.Solution:
    """What least squares found."""
    return symphys.solve(problem, "least_squares", backend="casadi")
