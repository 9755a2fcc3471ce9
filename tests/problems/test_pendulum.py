"""A pendulum swings up from rest, against its equation of motion, integrated on its own."""

from __future__ import annotations

import numpy as np
from data.shipped import Array, seeds, shipped, solve
from scipy.integrate import solve_ivp

GRAVITY, DAMPING, LENGTH, INERTIA, TIME, KNOTS = 9.81, 0.1, 0.5, 0.251, 2.0, 41
COST = 44.827183
"""Of the swing that every seed finds."""


def swung(torques: Array) -> Array:
    """(2,): angle and rate at the end, under a torque that is linear between knots."""
    times = np.linspace(0, TIME, KNOTS)

    def slope(time: float, state: Array) -> Array:
        torque = np.interp(time, times, torques) - DAMPING * state[1] - GRAVITY * LENGTH * np.sin(state[0])
        return np.array([state[1], torque / INERTIA])

    return np.asarray(solve_ivp(slope, [0, TIME], np.zeros(2), rtol=1e-9, atol=1e-11, max_step=0.05).y[:, -1])


@seeds(5)
def test_every_seed_finds_the_swing(seed: int) -> None:
    made = shipped("pendulum")
    found = solve("ilqr", made, seed)
    verdict = made.judge(found.z)
    assert verdict.solved
    assert verdict.objective < COST * (1 + 1e-3)
    motion = made.simulate(found.z)
    ends = [motion[name][-1] for name in ("hinge.angle", "hinge.rate")]
    np.testing.assert_allclose(ends, swung(found.z), atol=0.1)
