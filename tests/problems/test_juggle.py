"""A bat and a ball, against a motion made of parabolas and hits."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve, work
from scipy.integrate import solve_ivp

BAT, BALL, GRAVITY, RESTITUTION, TOUCH = 1.0, 0.1, 9.81, 0.8, 0.02 + 0.05
KNOTS = np.linspace(0, 0.6, 7)
MEETS = (1 + 2 * BALL / BAT - RESTITUTION) * 0.3 * GRAVITY / (1 + RESTITUTION)
"""[m/s] Speed of the bat before a hit that sends a ball back with the speed of a fall of 0.3 s."""


def flown(lift: Array) -> tuple[Array, list[float]]:
    """Heights of bat and ball and their speeds (4,) at the end, and the bat's speeds before its hits."""

    def rate(time: float, state: Array) -> Array:
        return np.array([state[2], state[3], np.interp(time, KNOTS, lift) / BAT - GRAVITY, -GRAVITY])

    def gap(_: float, state: Array) -> float:
        return float(state[1] - state[0] - TOUCH)

    gap.terminal, gap.direction = True, -1  # type: ignore[attr-defined]
    time, state, speeds = 0.0, np.array([0.5, 1.0, 0, 0]), []
    while time < KNOTS[-1]:
        part = solve_ivp(rate, [time, KNOTS[-1]], state, events=gap, rtol=1e-9, atol=1e-11, max_step=0.05)
        time, state = part.t[-1], part.y[:, -1].copy()
        if part.status == 1:
            speeds.append(float(state[2]))
            impulse = (1 + RESTITUTION) * (state[2] - state[3]) / (1 / BAT + 1 / BALL)
            state[2:] += [-impulse / BAT, impulse / BALL]
    return state, speeds


@pytest.mark.parametrize(("name", "most"), [("gradient", 60), ("least_squares", 6), ("ipopt", 30), ("cma", 1500)])
@seeds(2)
def test_the_forces_bring_bat_and_ball_back(name: str, most: int, seed: int) -> None:
    """Judged by the other motion, whatever the forces are; and its bat has the speed of the formula."""
    made = shipped("juggle", "casadi")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert work(found) <= most
    (bat, ball, rise, speed), before = flown(found.z)
    assert np.hypot(ball - 1, 0.1 * speed) < 0.012
    assert np.hypot(bat - 0.5, 0.1 * rise) < 0.012
    assert before == [pytest.approx(MEETS, abs=0.1)]


def test_the_bat_meets_the_ball_with_the_speed_of_the_formula() -> None:
    """m 2 v = M (V - V') and v - V' = e (v + V), for a ball that comes and goes with v."""
    assert pytest.approx(0.654, abs=1e-3) == MEETS
    made = shipped("juggle", "casadi")
    found = solve("least_squares", made, polish=True)
    end, before = flown(found.z)
    assert np.allclose(end, [0.5, 1, 0, 0], rtol=0, atol=1e-3)
    assert before == [pytest.approx(MEETS, abs=2e-3)]
