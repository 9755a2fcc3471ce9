"""A cart swings a pole up, against the equations of cart and pole, integrated and optimised on their own."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.shipped import Array, seeds, shipped, solve, work
from scipy.integrate import solve_ivp

CART, BOB, LENGTH, INERTIA, GRAVITY, TIME, KNOTS = 1.0, 0.3, 0.5, 0.0003, 9.81, 2.0, 11
UPRIGHT = [1.0, -np.pi, 0.0, 0.0]


def rate(state: Any, force: Any) -> Any:
    """Of place [m], angle [rad] about y from hanging, and their rates (4,), by Lagrange's equations."""
    _, angle, speed, spin = ca.vertsplit(state)
    lever = BOB * LENGTH
    masses = ca.blockcat([[CART + BOB, -lever * ca.cos(angle)], [-lever * ca.cos(angle), lever * LENGTH + INERTIA]])
    forces = ca.vertcat(force - lever * ca.sin(angle) * spin**2, -GRAVITY * lever * ca.sin(angle))
    return ca.vertcat(speed, spin, ca.solve(masses, forces))


def swung(push: Array) -> Array:
    """(4,): the state at the end."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    slope, times = ca.Function("rate", [x, u], [rate(x, u)]), np.linspace(0, TIME, KNOTS)

    def at(time: float, state: Array) -> Array:
        return np.array(slope(state, np.interp(time, times, push))).ravel()

    return np.asarray(solve_ivp(at, [0, TIME], np.zeros(4), rtol=1e-9, atol=1e-11, max_step=0.02).y[:, -1])


@cache
def least_effort(steps: int = 100) -> float:
    """[N^2 s]: multiple shooting by Runge and Kutta's steps, from a straight line to upright."""
    opti, h = ca.Opti(), TIME / steps
    states, knots = opti.variable(4, steps + 1), opti.variable(1, KNOTS)
    times, places = np.linspace(0, TIME, 2 * steps + 1), np.linspace(0, TIME, KNOTS)
    force = ca.mtimes(knots, ca.DM(np.array([np.interp(times, places, unit) for unit in np.eye(KNOTS)])))
    for k in range(steps):
        x, before, middle, after = states[:, k], force[2 * k], force[2 * k + 1], force[2 * k + 2]
        a = rate(x, before)
        b = rate(x + h / 2 * a, middle)
        c = rate(x + h / 2 * b, middle)
        d = rate(x + h * c, after)
        opti.subject_to(states[:, k + 1] == x + h / 6 * (a + 2 * b + 2 * c + d))
    opti.subject_to(states[:, 0] == 0)
    opti.subject_to(states[:, -1] == UPRIGHT)
    effort = h * ca.sumsqr(force[1::2])
    opti.minimize(effort)
    opti.set_initial(states[:2, :], np.outer(UPRIGHT[:2], np.linspace(0, 1, steps + 1)))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    return float(opti.solve().value(effort))


def test_the_cart_moves_as_its_equations_say() -> None:
    """Under the guess."""
    made = shipped("cart_pole")
    push = made.shooting.start(0)
    motion = made.simulate(push)
    end = np.concatenate([motion.joint_value[-1, :, 0], motion.joint_rate[-1, :, 0]])
    assert (np.abs(end - swung(push)) < [0.005, 0.03, 0.01, 0.1]).all()
    assert motion.joint_value[:, 0, 0] == pytest.approx(motion.position[:, 0, 0], abs=1e-6)
    assert motion.joint_separation.max() < 1e-5


@pytest.mark.parametrize(("name", "most"), [("gradient", 150), ("least_squares", 8), ("ipopt", 25), ("cma", 6000)])
@seeds(2)
def test_every_solver_swings_it_up(name: str, most: int, seed: int) -> None:
    """By the other equations too, whatever the forces are."""
    made = shipped("cart_pole")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert work(found) <= most
    assert (np.abs(swung(found.z) - UPRIGHT) < [0.01, 0.03, 0.03, 0.15]).all()


def test_the_force_is_the_least() -> None:
    made = shipped("cart_pole")
    found = solve("least_squares", made, polish=True)
    effort = made.judge(found.z).costs["effort"] / 0.001
    assert least_effort() == pytest.approx(60.0, abs=0.1)
    assert effort == pytest.approx(least_effort(), rel=0.004)
