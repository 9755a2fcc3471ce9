"""A putt around a mound: no formula, so solvers must agree, with each other and with half the time step."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve, work

PUTT = [2.3215, -1.1838]
"""[m/s] Where the putt goes as the time step goes to 0, from 10 ms, 5 ms and 2.5 ms: their changes halve."""


def test_least_squares_finds_the_putt() -> None:
    found = solve("least_squares", shipped("putt"), polish=True)
    assert np.allclose(found.z, PUTT, rtol=0, atol=4e-3)
    assert found.counts.jacobians <= 9


@pytest.mark.parametrize(("name", "most"), [("gradient", 16), ("ipopt", 16), ("cma", 250)])
@seeds(2)
def test_every_solver_stops_at_the_cup(name: str, most: int, seed: int) -> None:
    """Across, the slope forgives: 1 cm at the cup is 3 cm/s of the putt."""
    made = shipped("putt")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert np.allclose(found.z, PUTT, rtol=0, atol=[0.012, 0.04])
    assert work(found) <= most


def test_the_ball_follows_the_green_and_rolls() -> None:
    """It never leaves the ground; when it rolls, speed is spin times radius."""
    made = shipped("putt")
    motion = made.simulate(np.array(PUTT))
    gap, rolling = motion.contact_gap[:, 0], slice(60, 300)
    assert np.abs(gap).max() < 1e-6
    speed = np.linalg.norm(motion.velocity[rolling, 0], axis=1)
    flat = np.hypot(*motion.angular_velocity[rolling, 0, :2].T)
    assert np.allclose(speed, 0.02134 * flat, rtol=0.02, atol=1e-3)
