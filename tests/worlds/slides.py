"""Impacts and slides in closed form: what the shipped bowl, knock and row of balls are compared with."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi, tan

import numpy as np

from symphys.types import Array

KICK = [4.8767, 1.7477, -0.1312]
"""Where the kick of ``knock`` goes as the time step goes to 0, from 10 ms, 5 ms and 2.5 ms."""
ROW = [1.6, 0.8, 0.4, 0.2, 0.1]
"""[kg] Huygens' geometric row."""
BALL_RADIUS, LANE_BRAKE, FORWARD_SPIN, BOWL_TIME = 0.1085, 0.08 * 9.81, 30.0, 2.4


def bowled(z: Sequence[float] | Array) -> tuple[Array, Array, float]:
    """Place and velocity (2,) at the end of a ball that slides until it rolls, and when it begins to roll."""
    velocity, surface = np.array(z[:2]), np.array([FORWARD_SPIN, -z[2]]) * BALL_RADIUS
    slip = velocity - surface
    grip = float(2 / 7 * np.hypot(*slip) / LANE_BRAKE)
    force = -LANE_BRAKE * slip / np.hypot(*slip)
    sliding = min(grip, BOWL_TIME)
    end = velocity + force * sliding
    place = velocity * sliding + force * sliding**2 / 2 + end * (BOWL_TIME - sliding)
    return place, end, grip


def pocket_missed(z: Sequence[float] | Array) -> list[float]:
    """The errors of the targets of the bowling problem."""
    place, velocity, _ = bowled(z)
    return [place[0] - 18.13, place[1] + 0.07, velocity[1] - tan(4 * pi / 180) * velocity[0]]


def knocked(velocity: Array, side: float) -> Array:
    """(3,): velocity and rate of turn of the shipped crate after an impact in which the ball does not slip."""
    inertia = (0.3**2 + 0.4**2) / 12
    arms = {"crate": np.array([-0.15, side]), "ball": np.array([0.1, 0.0])}
    inverse = np.zeros((2, 2))
    for name, mass, turning in (("crate", 1.0, inertia), ("ball", 0.5, 0.4 * 0.5 * 0.1**2)):
        across = np.array([-arms[name][1], arms[name][0]])
        inverse += np.eye(2) / mass + np.outer(across, across) / turning
    impulse = np.linalg.solve(inverse, velocity * [1 + 0.5, 1])
    if abs(impulse[1]) >= 0.2 * impulse[0]:
        raise ValueError("the ball slips on the crate, and this formula does not hold")
    across = np.array([-arms["crate"][1], arms["crate"][0]])
    return np.array([*impulse, across @ impulse / inertia])


def kept_in_row(masses: Sequence[float]) -> tuple[float, float]:
    """Speed of the last ball and energy of the others, after elastic hits from first to last; the first has 1 m/s."""
    speed, energy = 1.0, 0.0
    for mass, other in pairwise(masses):
        left = (mass - other) / (mass + other) * speed
        energy += mass * left**2 / 2
        speed *= 2 * mass / (mass + other)
    return speed, energy
