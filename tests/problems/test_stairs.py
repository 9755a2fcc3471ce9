"""Stairs: the steady bounce has one height and one restitution, both by formula."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve, work

RISER, PERIOD, GRAVITY, LYING = 0.17, 0.5, 9.81, 0.68 + 0.03
FALL = sqrt(2 * RISER / GRAVITY)  # [s] from one step to the next, without a bounce
RESTITUTION = (PERIOD**2 - FALL**2) / (PERIOD**2 + FALL**2)
APEX = RESTITUTION**2 * RISER / (1 - RESTITUTION**2)  # [m] above a step


def test_the_formula() -> None:
    """Down from one apex and up to the next takes the period."""
    fall, rise = sqrt(2 * (APEX + RISER) / GRAVITY), sqrt(2 * APEX / GRAVITY)
    assert fall + rise == pytest.approx(PERIOD, rel=1e-12)
    assert np.allclose([RESTITUTION, APEX], [0.7565, 0.2275], rtol=0, atol=5e-5)


def test_least_squares_finds_both_to_rounding() -> None:
    made = shipped("stairs", "casadi")
    found = solve("least_squares", made, polish=True)
    assert np.allclose(found.z, [LYING + APEX, RESTITUTION], rtol=0, atol=1e-9)
    assert found.counts.jacobians <= 7


@pytest.mark.parametrize(("name", "most"), [("gradient", 12), ("ipopt", 12), ("cma", 250)])
@seeds(2)
def test_every_solver_comes_near(name: str, most: int, seed: int) -> None:
    made = shipped("stairs", "casadi")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert np.allclose(found.z, [LYING + APEX, RESTITUTION], rtol=0, atol=2e-3)
    assert work(found) <= most
