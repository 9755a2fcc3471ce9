"""An acrobot swings up from rest, against its equations of motion, integrated on their own."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shipped import Array, seeds, shipped, solve

GRAVITY, DAMPING, TIME, KNOTS = 9.81, 0.1, 2.0, 41
COST = 94.836286
"""Of the swing that every seed finds."""


def acceleration(angles: Any, rates: Any, torque: Any) -> Any:
    """(2,): by Lagrange's equations, from the energies of two links; angles from hanging, the second from the first."""
    first, both = angles[0], angles[0] + angles[1]
    elbow = ca.vertcat(ca.sin(first), -ca.cos(first))
    centres = elbow / 2, elbow + ca.vertcat(ca.sin(both), -ca.cos(both))
    speeds = [ca.jtimes(centre, angles, rates) for centre in centres]
    kinetic = sum(ca.sumsqr(speed) for speed in speeds) / 2
    kinetic += (0.083 * rates[0] ** 2 + 0.33 * (rates[0] + rates[1]) ** 2) / 2
    potential = GRAVITY * (centres[0][1] + centres[1][1])
    momenta = ca.gradient(kinetic, rates)
    forces = ca.gradient(kinetic - potential, angles) + ca.vertcat(0, torque) - DAMPING * rates
    return ca.solve(ca.jacobian(momenta, rates), forces - ca.jtimes(momenta, angles, rates))


def swung(torques: Array) -> Array:
    """(4,): angles and rates at the end, under torques that are linear between knots."""
    q, v, u = ca.SX.sym("q", 2), ca.SX.sym("v", 2), ca.SX.sym("u")
    slope, times = ca.Function("slope", [q, v, u], [ca.vertcat(v, acceleration(q, v, u))]), np.linspace(0, TIME, KNOTS)

    def at(time: float, state: Array) -> Array:
        return np.array(slope(state[:2], state[2:], np.interp(time, times, torques))).ravel()

    return np.asarray(solve_ivp(at, [0, TIME], np.zeros(4), rtol=1e-9, atol=1e-11, max_step=0.05).y[:, -1])


@seeds(20)
@pytest.mark.parametrize("solver", ["ilqr", "multiple_shooting"])
def test_every_seed_finds_the_swing(solver: str, seed: int) -> None:
    made = shipped("acrobot")
    found = solve(solver, made, seed)
    assert found.trace[-1].best < COST * (1 + 1e-5)
    assert found.trace[-1].max_violation <= 1
    motion = made.simulate(found.z)
    ends = [motion[name][-1] for name in ("shoulder.angle", "elbow.angle", "shoulder.rate", "elbow.rate")]
    np.testing.assert_allclose(ends, swung(found.z), atol=0.08)
