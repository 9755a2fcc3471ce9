"""A pole that bounces off a soft wall, against the equations of cart and pole, integrated on their own."""

from __future__ import annotations

import numpy as np
from data.shipped import Array, seeds, shipped, solve
from scipy.integrate import solve_ivp

from symphys import problems
from symphys.problem import load_problem
from symphys.transcription import transcribe

CART, POINT, ROD, WALL, STIFFNESS, GRAVITY = 1.0, 0.1, 0.8, 1.0, 200.0, 9.81
KNOTS = np.linspace(0, 2, 41)
COST = 0.4702
"""Of the catch after one bounce."""


def fallen(push: Array) -> Array:
    """(n, 4): place of the cart, angle of the pole from upright, and their rates, every 0.01 s."""

    def rate(time: float, state: Array) -> Array:
        cart, angle, _, turn = state
        tip = cart + ROD * np.sin(angle)
        wall = STIFFNESS * (max(-WALL - tip, 0) - max(tip - WALL, 0))
        masses = np.array([[CART + POINT, POINT * ROD * np.cos(angle)], [np.cos(angle), ROD]])
        forces = np.array(
            [
                np.interp(time, KNOTS, push) + wall + POINT * ROD * turn**2 * np.sin(angle),
                GRAVITY * np.sin(angle) + wall * np.cos(angle) / POINT,
            ]
        )
        return np.concatenate([state[2:], np.linalg.solve(masses, forces)])

    times = np.linspace(0, 2, 201)
    return np.asarray(
        solve_ivp(rate, [0, 2], [0.35, 0.5, 0, 0], t_eval=times, rtol=1e-9, atol=1e-11, max_step=0.01).y.T
    )


@seeds(3)
def test_the_pole_is_caught_after_one_bounce(seed: int) -> None:
    """The motions agree through the bounce, and until what differs has grown for a second in an unstable motion."""
    made = shipped("cart_pole_walls")
    found = solve("ilqr", made, seed)
    verdict = made.judge(found.z)
    assert verdict.solved
    assert verdict.objective < COST * 1.001
    motion, other = made.simulate(found.z), fallen(found.z)
    places = np.stack([motion["cart.position"][:, 0], motion["pivot.angle"]], axis=1)
    np.testing.assert_allclose(places[:60], other[:60, :2], atol=4e-3)
    np.testing.assert_allclose(places[:120], other[:120, :2], atol=4e-2)
    touching = motion["pole.position"][:, 0] > WALL
    assert np.count_nonzero(np.diff(touching.astype(int)) == 1) == 1
    assert np.max(np.abs(other[:, 1])) < 1


def test_without_walls_the_guess_falls() -> None:
    """The motor alone cannot hold it: a pole that leans by more than atan(F / (M + m) g) is out of its reach."""
    problem = load_problem(problems.find("cart_pole_walls"), {"force.walls.numbers.k": 0})
    made = transcribe(problem, backend="casadi")
    pushed = made.simulate(np.full(41, 3.0))
    assert np.abs(pushed["pivot.angle"]).max() > 2
    assert np.tan(0.5) > 3 / ((CART + POINT) * GRAVITY)
