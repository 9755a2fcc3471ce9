"""A crate knocked by a ball: the impact by its formula, the slide against a plate with linear loads."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve, work
from worlds.plate import Plate

KICK = [4.8767, 1.7477, -0.1312]
"""As the time step goes to 0, from 10 ms, 5 ms and 2.5 ms."""
BALL, CRATE, RADIUS, RESTITUTION = 0.5, 1.0, 0.1, 0.5
INERTIA = CRATE * (0.3**2 + 0.4**2) / 12


def hit(velocity: Array, side: float) -> Array:
    """(3,): velocity and rate of turn of the crate after an impact in which the ball does not slip."""
    arms = {"crate": np.array([-0.15, side]), "ball": np.array([RADIUS, 0.0])}
    inverse = np.zeros((2, 2))
    for name, mass, inertia in (("crate", CRATE, INERTIA), ("ball", BALL, 0.4 * BALL * RADIUS**2)):
        across = np.array([-arms[name][1], arms[name][0]])
        inverse += np.eye(2) / mass + np.outer(across, across) / inertia
    impulse = np.linalg.solve(inverse, velocity * [1 + RESTITUTION, 1])
    assert abs(impulse[1]) < 0.2 * impulse[0]  # friction holds
    across = np.array([-arms["crate"][1], arms["crate"][0]])
    return np.array([*impulse / CRATE, across @ impulse / INERTIA])


def test_the_impact_is_that_of_the_formula() -> None:
    """The crate stands on the floor all the time, and the floor has one step of 10 ms at most to brake it."""
    made = shipped("knock", "casadi")
    motion = made.simulate(np.array(KICK))
    after = hit(np.array(KICK[:2]), KICK[2] + KICK[1] * 0.25 / KICK[0])
    assert np.allclose(after, [2.3990, 0.2716, 2.8353], rtol=0, atol=1e-3)
    k = int(np.argmax(motion.velocity[:, 0, 0] > 1))
    brake = 0.3 * 9.81 * 0.01
    assert np.allclose(motion.velocity[k, 0, :2], after[:2], rtol=0, atol=brake)
    assert motion.velocity[k, 0, 0] < after[0]
    assert motion.angular_velocity[k, 0, 2] == pytest.approx(after[2], abs=0.05)


def test_impact_and_slide_end_where_the_formulas_do() -> None:
    last = shipped("knock", "casadi").simulate(np.array(KICK))
    after = hit(np.array(KICK[:2]), KICK[2] + KICK[1] * 0.25 / KICK[0])
    x, y, angle = Plate((0.3, 0.4), 0.1, 0.3).slid(after)
    q = last.orientation[-1, 0]
    assert np.allclose(last.position[-1, 0, :2], [x, y], rtol=0, atol=1e-4)
    assert 2 * np.arctan2(q[3], q[0]) == pytest.approx(angle, abs=2e-3)


def test_least_squares_finds_the_kick() -> None:
    found = solve("least_squares", shipped("knock", "casadi"), polish=True)
    assert np.allclose(found.z, KICK, rtol=0, atol=[1e-4, 2e-3, 1e-4])
    assert found.counts.jacobians <= 7


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "most"), [("gradient", 40), ("ipopt", 18), ("cma", 350)])
@seeds(2)
def test_every_solver_knocks_it_into_place(name: str, most: int, seed: int) -> None:
    """The way of the kick across and its place trade off against each other; its way along does not."""
    made = shipped("knock")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert found.z[0] == pytest.approx(KICK[0], abs=0.02)
    assert work(found) <= most
