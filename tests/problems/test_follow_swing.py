"""An arm that follows a swing: its torque is that of inverse dynamics."""

from __future__ import annotations

import numpy as np
from data.shipped import shipped, solve
from tools.repeats import first


@first("solver", ["ilqr", "multiple_shooting", "least_squares"])
def test_the_torque_is_that_of_inverse_dynamics(solver: str) -> None:
    made = shipped("follow_swing")
    found = solve(solver, made)
    (bar,) = made.problem.world().bodies
    distance = 0.3
    inertia = float(bar.inertia[0]) + distance**2
    t = np.linspace(0, 2, 41)
    swing = (1 - np.cos(np.pi * t)) / 2
    torque = inertia * np.pi**2 * np.cos(np.pi * t) / 2 + 9.81 * distance * np.sin(swing)
    assert np.sqrt(np.mean((found.z - torque)[2:-2] ** 2)) < 0.01 * np.abs(torque).max()
    motion = made.simulate(found.z)
    swing = (1 - np.cos(np.pi * motion.time)) / 2
    assert np.abs(motion.joint_value[:, 0, 0] - swing).max() < 1e-3
