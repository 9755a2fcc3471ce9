"""A shot with topspin, against scipy's integration of the same flights and a bounce in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
MASS, RADIUS = 0.0027, 0.02
DRAG = 0.4 * 0.6 * np.pi * RADIUS**2
LIFT = 0.6 * RADIUS * 0.6 * np.pi * RADIUS**2
TABLE, NET = 0.76, 0.1525
RESTITUTION, FRICTION = 0.876, 0.2
UP = np.array([0.0, 0.0, 1.0])


def flight(start: Array, spin: Array, duration: float) -> Any:
    """From a place and a velocity until the ball touches the table, or for so long."""

    def slope(_: float, y: Array) -> Array:
        v = y[3:]
        force = -DRAG * np.linalg.norm(v) * v + LIFT * np.cross(spin, v)
        return np.concatenate([v, force / MASS - 9.81 * UP])

    def touch(_: float, y: Array) -> float:
        return float(y[2] - TABLE - RADIUS)

    touch.terminal, touch.direction = True, -1  # type: ignore[attr-defined]
    return solve_ivp(slope, (0, duration), start, rtol=1e-10, atol=1e-10, events=touch, dense_output=True)


def bounced(velocity: Array, spin: Array) -> tuple[Array, Array]:
    """After an instant impact of a hollow ball: it slides through it, or grips."""
    arm, down = -RADIUS * UP, velocity @ UP
    slip = velocity - down * UP + np.cross(spin, arm)
    grip = -0.4 * slip  # m v_t + I: 1 / (1 + m r^2 / I), I = 2/3 m r^2
    most = FRICTION * (1 + RESTITUTION) * abs(down)
    kick = grip * min(1.0, most / float(np.linalg.norm(grip)))
    return velocity - (1 + RESTITUTION) * down * UP + kick, spin + np.cross(arm, kick) / (2 / 3 * RADIUS**2)


@seeds(3)
def test_the_shot_that_is_found_lands_there_and_kicks_on(seed: int) -> None:
    found = solve("least_squares", shipped("table_tennis"), seed)
    velocity, spin = found.z[:3], found.z[3:]
    first = flight(np.array([-1.6, -0.2, 0.9, *velocity]), spin, 0.6)
    landed = first.y[:, -1]
    assert first.t[-1] == pytest.approx(0.34, abs=2e-3)
    assert landed[:2] == pytest.approx([0.85, 0.3], abs=0.02)
    over = next(y for y in first.sol(np.linspace(0, first.t[-1], 2000)).T if y[0] > -RADIUS)
    assert over[2] > TABLE + NET + RADIUS
    velocity, spin = bounced(landed[3:], spin)
    second = flight(np.concatenate([landed[:3], velocity]), spin, 0.6 - first.t[-1])
    assert second.y[:3, -1] == pytest.approx([2.25, 0.75, 0.91], abs=0.01)
    plain = flight(np.array([-1.6, -0.2, 0.9, *found.z[:3]]), np.zeros(3), 1.0).y[:, -1]
    assert plain[0] > 2.74 / 2, "without spin the same shot misses the table"
