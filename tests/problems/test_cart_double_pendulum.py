"""A cart swings up two links, against its equations of motion, integrated on their own."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.shipped import Array, shipped, solve
from scipy.integrate import solve_ivp

GRAVITY, DAMPING, LENGTH, MASS, CART, TIME, KNOTS = 9.81, 0.002, 0.5, 0.3, 1.0, 3.0, 61


def acceleration(q: Any, v: Any, force: Any) -> Any:
    """(3,): of the cart and of both angles, the second from the first, by Lagrange's equations of two uniform rods."""
    along = [ca.vertcat(-ca.sin(angle), -ca.cos(angle)) for angle in (q[1], q[1] + q[2])]
    cart = ca.vertcat(q[0], 0)
    centres = cart + LENGTH / 2 * along[0], cart + LENGTH * along[0] + LENGTH / 2 * along[1]
    speeds = [ca.jtimes(centre, q, v) for centre in centres]
    kinetic = CART * v[0] ** 2 / 2 + MASS * sum(ca.sumsqr(speed) for speed in speeds) / 2
    kinetic += MASS * LENGTH**2 / 12 * (v[1] ** 2 + (v[1] + v[2]) ** 2) / 2
    potential = MASS * GRAVITY * (centres[0][1] + centres[1][1])
    momenta = ca.gradient(kinetic, v)
    forces = ca.gradient(kinetic - potential, q) + ca.vertcat(force, -DAMPING * v[1], -DAMPING * v[2])
    return ca.solve(ca.jacobian(momenta, v), forces - ca.jtimes(momenta, q, v))


def swung(pushes: Array, until: float) -> Array:
    """(6,): place, angles and their rates at a time [s], under pushes that are linear between knots."""
    q, v, u = ca.SX.sym("q", 3), ca.SX.sym("v", 3), ca.SX.sym("u")
    slope, times = ca.Function("slope", [q, v, u], [ca.vertcat(v, acceleration(q, v, u))]), np.linspace(0, TIME, KNOTS)

    def at(time: float, state: Array) -> Array:
        return np.array(slope(state[:3], state[3:], np.interp(time, times, pushes))).ravel()

    return np.asarray(solve_ivp(at, [0, until], np.zeros(6), rtol=1e-9, atol=1e-11, max_step=0.05).y[:, -1])


def test_the_motion_is_that_of_the_equations() -> None:
    """For half a second, under pushes at random; what the time step leaves is of its size."""
    pushes = 1.0 + 3 * np.random.default_rng(3).standard_normal(KNOTS)
    motion = shipped("cart_double_pendulum", "casadi").simulate(pushes)
    places, rates = np.split(swung(pushes, 0.5), 2)
    found = [motion[name][50] for name in ("rail.position", "pivot.angle", "elbow.angle")]
    np.testing.assert_allclose(found, places, atol=1e-3)
    np.testing.assert_allclose([motion[f"{name}.rate"][50] for name in ("rail", "pivot", "elbow")], rates, atol=0.05)


@pytest.mark.thorough
def test_the_guess_leads_to_a_swing() -> None:
    """It stands at the end, in the place where the cart began."""
    made = shipped("cart_double_pendulum")
    found = solve("ilqr", made)
    assert found.trace[-1].max_violation <= 1
    motion = made.simulate(found.z)
    assert np.cos(motion["pivot.angle"][-1]) < -0.98 and abs(motion["rail.position"][-1]) < 0.1
