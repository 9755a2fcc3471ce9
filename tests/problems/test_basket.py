"""A shot off the backboard against three formulas: flight, an impact with friction, flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve, work
from scipy.optimize import fsolve

GRAVITY = np.array([0, 0, -9.81])
START, RING, TIME = np.array([-2.2, 1.8, 2.1]), np.array([0, 0, 3.05]), 1.3
FACE, RADIUS, RESTITUTION, FRICTION = 0.3936 - 0.015, 0.12, 0.75, 0.6


def missed(throw: Sequence[float] | Array) -> Array:
    """(3,) [m]: from the ring to where a throw off the board is at the time; the board is a wall."""
    velocity = np.asarray(throw, float)
    touch = (FACE - RADIUS - START[0]) / velocity[0]
    place = START + velocity * touch + GRAVITY * touch**2 / 2
    velocity = velocity + GRAVITY * touch
    along = velocity[1:]
    grip = 0.4 * np.hypot(*along)  # of a shell without spin: 1 / (1/m + r^2 / I), with I = 2/3 m r^2, is 2/5 m
    share = min(1.0, FRICTION * (1 + RESTITUTION) * velocity[0] / grip)
    velocity = np.array([-RESTITUTION * velocity[0], *(along * (1 - 0.4 * share))])
    rest = TIME - touch
    return np.asarray(place + velocity * rest + GRAVITY * rest**2 / 2 - RING)


def test_least_squares_finds_the_throw_of_the_formulas() -> None:
    made = shipped("basket", "casadi")
    throw = fsolve(missed, made.shooting.start(0), xtol=1e-12)
    assert np.allclose(throw, [2.156, -1.456, 6.896], rtol=0, atol=5e-4)
    found = solve("least_squares", made, polish=True)
    assert np.allclose(found.z, throw, rtol=0, atol=1e-7)
    assert found.counts.jacobians <= 5


@pytest.mark.parametrize(("name", "most"), [("gradient", 12), ("ipopt", 16), ("cma", 300)])
@seeds(2)
def test_every_solver_scores_off_the_board(name: str, most: int, seed: int) -> None:
    made = shipped("basket", "casadi")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert np.linalg.norm(missed(found.z)) < 0.0101
    assert work(found) <= most
    motion = made.simulate(found.z)
    assert motion.velocity[motion.time > TIME, 0, 2].max() < 0
    assert motion.position[-1, 0, 2] < RING[2] - RADIUS


def test_there_is_a_way_without_the_board() -> None:
    """A parabola straight into the ring: nothing touches the ball on its way."""
    throw = (RING - START - GRAVITY * TIME**2 / 2) / TIME
    assert np.allclose(throw, [1.692, -1.385, 7.107], rtol=0, atol=5e-4)
    made = shipped("basket", "casadi")
    assert made.judge(throw).solved
    motion = made.simulate(throw)
    assert motion.contact_gap[motion.time <= TIME].min() > 0
