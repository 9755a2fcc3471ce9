"""Pendulums by Lagrange's equations from their energies, integrated by scipy: what shipped swings are compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from symphys.types import Array

GRAVITY = 9.81


@dataclass(frozen=True)
class Swing:
    """A system with ``n`` coordinates, driven by one force that is linear between knots.

    Attributes:
        energies: of coordinates and rates (n,), the kinetic and the potential energy [J].
        forces: of rates (n,) and the driving force, the generalised forces (n,) beside those of the potential.
        start: coordinates and rates at 0 s.
        time: of the motion [s].
        knots: of the force.
    """

    energies: Callable[[Any, Any], tuple[Any, Any]]
    forces: Callable[[Any, Any], Any]
    start: tuple[float, ...]
    time: float
    knots: int

    def slope(self) -> ca.Function:
        """d/dt of coordinates and rates (2n,), by the driving force."""
        n = len(self.start) // 2
        q, v, u = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("u")
        kinetic, potential = self.energies(q, v)
        momenta = ca.gradient(kinetic, v)
        forces = ca.gradient(kinetic - potential, q) + self.forces(v, u)
        rates = ca.solve(ca.jacobian(momenta, v), forces - ca.jtimes(momenta, q, v))
        return ca.Function("slope", [ca.vertcat(q, v), u], [ca.vertcat(v, rates)])

    def swung(self, push: Array, times: ArrayLike | None = None) -> Array:
        """(len(times), 2n) at these times, or (2n,) at the end, from the force at the knots."""
        slope, knots = self.slope(), np.linspace(0, self.time, self.knots)

        def at(time: float, state: Array) -> Array:
            return np.array(slope(state, np.interp(time, knots, push))).ravel()

        wanted = [self.time] if times is None else np.asarray(times)
        found = solve_ivp(
            at, [0, wanted[-1]], self.start, t_eval=wanted, rtol=1e-9, atol=1e-11, max_step=self.time / 100
        ).y.T
        return np.asarray(found[-1] if times is None else found)


def _hung(angle: Any) -> Any:
    """The direction (x, z) of a link at an angle from hanging; positive angles go to positive x."""
    return ca.vertcat(ca.sin(angle), -ca.cos(angle))


def _of_pendulum(q: Any, v: Any) -> tuple[Any, Any]:
    return 0.251 * v**2 / 2, -GRAVITY * 0.5 * ca.cos(q)


def _of_acrobot(q: Any, v: Any) -> tuple[Any, Any]:
    both = q[0] + q[1]
    centres = _hung(q[0]) / 2, _hung(q[0]) + _hung(both)
    kinetic = sum(ca.sumsqr(ca.jtimes(centre, q, v)) for centre in centres) / 2
    kinetic += (0.083 * v[0] ** 2 + 0.33 * (v[0] + v[1]) ** 2) / 2
    return kinetic, GRAVITY * (centres[0][1] + centres[1][1])


def _of_cart_pole(q: Any, v: Any) -> tuple[Any, Any]:
    bob = ca.vertcat(q[0], 0) + 0.5 * _hung(-q[1])
    kinetic = v[0] ** 2 / 2 + 0.3 * ca.sumsqr(ca.jtimes(bob, q, v)) / 2 + 0.0003 * v[1] ** 2 / 2
    return kinetic, 0.3 * GRAVITY * bob[1]


def _of_double_pendulum(q: Any, v: Any) -> tuple[Any, Any]:
    """Two uniform rods on a cart."""
    mass, length, cart = 0.3, 0.5, ca.vertcat(q[0], 0)
    links = [_hung(-q[1]), _hung(-q[1] - q[2])]
    centres = cart + length / 2 * links[0], cart + length * links[0] + length / 2 * links[1]
    kinetic = v[0] ** 2 / 2 + mass * sum(ca.sumsqr(ca.jtimes(centre, q, v)) for centre in centres) / 2
    kinetic += mass * length**2 / 12 * (v[1] ** 2 + (v[1] + v[2]) ** 2) / 2
    return kinetic, mass * GRAVITY * (centres[0][1] + centres[1][1])


def _between_walls(q: Any, v: Any) -> tuple[Any, Any]:
    """A point on a massless rod that stands on a cart, between two walls that are springs."""
    point, wall, stiffness = 0.1, 1.0, 200.0
    tip = ca.vertcat(q[0], 0) - 0.8 * _hung(-q[1])
    kinetic = v[0] ** 2 / 2 + point * ca.sumsqr(ca.jtimes(tip, q, v)) / 2
    pressed = ca.fmax(ca.fabs(tip[0]) - wall, 0)
    return kinetic, point * GRAVITY * tip[1] + stiffness * pressed**2 / 2


PENDULUM = Swing(_of_pendulum, lambda v, u: u - 0.1 * v, (0,) * 2, 2.0, 41)
ACROBOT = Swing(_of_acrobot, lambda v, u: ca.vertcat(0, u) - 0.1 * v, (0,) * 4, 2.0, 41)
CART_POLE = Swing(_of_cart_pole, lambda v, u: ca.vertcat(u, 0), (0,) * 4, 2.0, 11)
DOUBLE_PENDULUM = Swing(_of_double_pendulum, lambda v, u: ca.vertcat(u, -0.002 * v[1:]), (0,) * 6, 3.0, 61)
WALLS = Swing(_between_walls, lambda v, u: ca.vertcat(u, 0), (0.35, 0.5, 0, 0), 2.0, 41)
UPRIGHT = [1.0, -np.pi, 0.0, 0.0]
"""The state of the cart and pole at the end."""


@cache
def least_effort(steps: int = 100) -> float:
    """[N^2 s] of the cart and pole: multiple shooting by Runge and Kutta's steps, from a straight line to upright."""
    rate, h = CART_POLE.slope(), CART_POLE.time / steps
    opti = ca.Opti()
    states, knots = opti.variable(4, steps + 1), opti.variable(1, CART_POLE.knots)
    times, places = (np.linspace(0, CART_POLE.time, n) for n in (2 * steps + 1, CART_POLE.knots))
    force = ca.mtimes(knots, ca.DM(np.array([np.interp(times, places, unit) for unit in np.eye(CART_POLE.knots)])))
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
