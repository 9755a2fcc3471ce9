"""A hook: what four solvers find against the formula of a ball that slides until it rolls."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, tan

import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve, work
from scipy.optimize import fsolve

RADIUS, BRAKE, FORWARD, TIME = 0.1085, 0.08 * 9.81, 30.0, 2.4


def bowled(z: Sequence[float] | Array) -> tuple[Array, Array, float]:
    """Place and velocity (2,) at the end, and when it began to roll."""
    velocity, surface = np.array(z[:2]), np.array([FORWARD, -z[2]]) * RADIUS
    slip = velocity - surface
    grip = float(2 / 7 * np.hypot(*slip) / BRAKE)
    force = -BRAKE * slip / np.hypot(*slip)
    sliding = min(grip, TIME)
    end = velocity + force * sliding
    place = velocity * sliding + force * sliding**2 / 2 + end * (TIME - sliding)
    return place, end, grip


def missed(z: Sequence[float] | Array) -> list[float]:
    """What the targets ask to be zero."""
    place, velocity, _ = bowled(z)
    return [place[0] - 18.13, place[1] + 0.07, velocity[1] - tan(4 * pi / 180) * velocity[0]]


def test_the_formula() -> None:
    z = fsolve(missed, [8, 0, -20], xtol=1e-12)
    _, velocity, grip = bowled(z)
    assert np.allclose(z, [8.310, -0.588, -29.03], rtol=0, atol=5e-3)
    assert grip == pytest.approx(2.289, abs=1e-3)
    surface = np.array([FORWARD, -z[2]]) * RADIUS
    assert np.allclose(velocity, (5 * z[:2] + 2 * surface) / 7)


def test_least_squares_finds_what_the_formula_gives() -> None:
    """Rolling begins within a step, so the last digits are those of the time step."""
    found = solve("least_squares", shipped("bowling"), polish=True)
    assert np.allclose(found.z, fsolve(missed, [8, 0, -20], xtol=1e-12), rtol=0, atol=1e-4)
    assert found.counts.jacobians <= 7


@pytest.mark.parametrize(("name", "most"), [("gradient", 100), ("ipopt", 40), ("cma", 700)])
@seeds(2)
def test_every_solver_finds_the_pocket(name: str, most: int, seed: int) -> None:
    made = shipped("bowling")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert np.abs(missed(found.z)).max() < 0.0101
    assert work(found) <= most


def test_it_stays_on_the_lane() -> None:
    """A lane is 1.054 m wide."""
    made = shipped("bowling")
    side = made.simulate(solve("least_squares", made).z).position[:, 0, 1]
    assert np.abs(side).max() + RADIUS < 1.054 / 2
