"""A row of balls: gradients go through four impacts to the masses, and all solvers find Huygens' geometric row."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve, work

MASSES = [1.6, 0.8, 0.4, 0.2, 0.1]


def kept(masses: list[float]) -> tuple[float, float]:
    """Speed of the last ball and energy of the others, after elastic hits from first to last; the first has 1 m/s."""
    speed, energy = 1.0, 0.0
    for mass, other in pairwise(masses):
        left = (mass - other) / (mass + other) * speed
        energy += mass * left**2 / 2
        speed *= 2 * mass / (mass + other)
    return speed, energy


def test_the_formula() -> None:
    assert kept(MASSES) == (pytest.approx((4 / 3) ** 4), pytest.approx(0.300564, abs=1e-6))
    assert kept([1.6, 0.1])[0] == pytest.approx(1.882, abs=1e-3)


@pytest.mark.parametrize(("name", "most"), [("gradient", 45), ("least_squares", 25), ("ipopt", 35), ("cma", 1000)])
@seeds(2)
def test_each_mass_is_the_geometric_mean_of_its_neighbours(name: str, most: int, seed: int) -> None:
    made = shipped("row_of_balls")
    found = solve(name, made, seed)
    assert made.judge(found.z).objective == pytest.approx(kept(MASSES)[1], rel=1e-6)
    assert np.allclose(found.z, MASSES[1:-1], rtol=5e-3)
    assert work(found) <= most


def test_the_last_ball_flies_off_with_the_speed_of_the_formula() -> None:
    made = shipped("row_of_balls")
    motion = made.simulate(np.array(MASSES[1:-1]))
    assert motion.velocity[-1, -1, 0] == pytest.approx((4 / 3) ** 4, rel=1e-12)
    guess = made.simulate(made.shooting.start(0))
    assert guess.velocity[-1, -1, 0] == pytest.approx(kept([1.6, 0.5, 0.5, 0.5, 0.1])[0], rel=1e-12)
