"""Flights of balls and their bounces, in closed form or integrated by scipy: what shipped shots are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from symphys.types import Array

UP = np.array([0.0, 0.0, 1.0])
GRAVITY = -9.81 * UP


def flight(start: ArrayLike, drag: Callable[[Array], Array], duration: float, floor: float = -np.inf) -> Any:
    """From place and velocity (6,), under gravity and ``drag`` of the velocity [m/s^2], until below ``floor`` [m]."""

    def slope(_: float, y: Array) -> Array:
        return np.concatenate([y[3:], GRAVITY + drag(y[3:])])

    def touch(_: float, y: Array) -> float:
        return float(max(y[2] - floor, -1.0))

    touch.terminal, touch.direction = True, -1  # type: ignore[attr-defined]
    events = touch if np.isfinite(floor) else None
    return solve_ivp(slope, (0, duration), start, rtol=1e-10, atol=1e-10, events=events, dense_output=True)


def bounced(
    velocity: Array, spin: Array, normal: Array, radius: float, restitution: float, friction: float
) -> tuple[Array, Array]:
    """Velocity and spin after an instant impact of a thin shell that slides through it, or grips."""
    arm, down = -radius * normal, velocity @ normal
    grip = -0.4 * (velocity - down * normal + np.cross(spin, arm))  # 1 / (1 + m r^2 / I), I = 2/3 m r^2
    most = friction * (1 + restitution) * abs(down)
    kick = grip * min(1.0, most / float(np.linalg.norm(grip)))
    return velocity - (1 + restitution) * down * normal + kick, spin + np.cross(arm, kick) / (2 / 3 * radius**2)


RISER, PERIOD, LYING = 0.17, 0.5, 0.68 + 0.03
FALL = np.sqrt(2 * RISER / 9.81)  # [s] from one stair to the next, without a bounce
RESTITUTION = (PERIOD**2 - FALL**2) / (PERIOD**2 + FALL**2)
APEX = RESTITUTION**2 * RISER / (1 - RESTITUTION**2)  # [m] above a stair
STAIRS = [LYING + APEX, RESTITUTION]
"""The steady bounce down stairs."""
BASKET_START, RING, BASKET_TIME, BASKET_RADIUS = np.array([-2.2, 1.8, 2.1]), np.array([0, 0, 3.05]), 1.3, 0.12


def basket_missed(throw: Sequence[float] | Array) -> Array:
    """(3,) [m]: from the ring to where a throw off the board is at the time; the board is a wall."""
    velocity = np.asarray(throw, float)
    touch = (0.3936 - 0.015 - BASKET_RADIUS - BASKET_START[0]) / velocity[0]
    place = BASKET_START + velocity * touch + GRAVITY * touch**2 / 2
    velocity, _ = bounced(velocity + GRAVITY * touch, np.zeros(3), np.array([-1.0, 0, 0]), BASKET_RADIUS, 0.75, 0.6)
    rest = BASKET_TIME - touch
    return np.asarray(place + velocity * rest + GRAVITY * rest**2 / 2 - RING)


BAT, BALL, BAT_KNOTS = 1.0, 0.1, np.linspace(0, 0.6, 7)
BAT_SPEED = (1 + 2 * BALL / BAT - 0.8) * 0.3 * 9.81 / (1 + 0.8)
"""[m/s] Speed of the bat before a hit that sends a ball back with the speed of a fall of 0.3 s:
m 2 v = M (V - V') and v - V' = e (v + V), for a ball that comes and goes with v."""


def juggled(lift: Array) -> tuple[Array, list[float]]:
    """Heights of bat and ball and their speeds (4,) at the end, and the bat's speeds before its hits."""

    def rate(time: float, state: Array) -> Array:
        return np.array([state[2], state[3], np.interp(time, BAT_KNOTS, lift) / BAT - 9.81, -9.81])

    def gap(_: float, state: Array) -> float:
        return float(state[1] - state[0] - 0.02 - 0.05)

    gap.terminal, gap.direction = True, -1  # type: ignore[attr-defined]
    time, state, speeds = 0.0, np.array([0.5, 1.0, 0, 0]), []
    while time < BAT_KNOTS[-1]:
        part = solve_ivp(rate, [time, BAT_KNOTS[-1]], state, events=gap, rtol=1e-9, atol=1e-11, max_step=0.05)
        time, state = part.t[-1], part.y[:, -1].copy()
        if part.status == 1:
            speeds.append(float(state[2]))
            impulse = (1 + 0.8) * (state[2] - state[3]) / (1 / BAT + 1 / BALL)
            state[2:] += [-impulse / BAT, impulse / BALL]
    return state, speeds


ROTORS = np.array([[0.1, 0.1, 1], [-0.1, 0.1, -1], [-0.1, -0.1, 1], [0.1, -0.1, -1]])
"""Of the quadrotor's rotors: place [m] and sign of the drag."""


def quadrotor(thrusts: Array, duration: float) -> Array:
    """(13,) Position, orientation, velocity and spin in its frame at the end, of thrusts (4, knots) [N].

    They are linear between the knots. By Newton's and Euler's equations.
    """
    mass, inertia, knots = 0.5, np.array([0.0025, 0.0025, 0.0045]), np.linspace(0, duration, thrusts.shape[1])

    def slope(time: float, y: Array) -> Array:
        given = np.array([np.interp(time, knots, each) for each in thrusts])
        q, spin, (w, x, y_, z) = y[3:7], y[10:13], y[3:7]
        up = np.array([2 * (x * z + w * y_), 2 * (y_ * z - w * x), 1 - 2 * (x * x + y_ * y_)]) / (q @ q)
        torque = np.array([ROTORS[:, 1] @ given, -ROTORS[:, 0] @ given, 0.016 * ROTORS[:, 2] @ given])
        vector = np.cross(q[1:], spin) + w * spin
        turning = 0.5 * np.concatenate([[-q[1:] @ spin], vector])
        return np.concatenate(
            [y[7:10], turning, GRAVITY + up * given.sum() / mass, (torque - np.cross(spin, inertia * spin)) / inertia]
        )

    start = np.array([0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], float)
    found = solve_ivp(slope, (0, duration), start, rtol=1e-10, atol=1e-10, max_step=duration / thrusts.shape[1])
    return np.asarray(found.y[:, -1])
