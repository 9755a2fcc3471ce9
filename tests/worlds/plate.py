"""A plate that slides and turns on four corners which share its weight linearly, integrated by scipy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from symphys.types import Array

GRAVITY = 9.81


@dataclass(frozen=True)
class Plate:
    """A uniform box.

    Attributes:
        size: along and across [m].
        height: of the centre of mass above the floor [m]; friction acts that far below it, which loads the front.
        friction: coefficient.
    """

    size: tuple[float, float]
    height: float
    friction: float

    @property
    def inertia(self) -> float:
        """Of a unit of mass about the vertical [m^2]."""
        return (self.size[0] ** 2 + self.size[1] ** 2) / 12

    def rate(self, _: float, state: Array) -> Array:
        """d/dt of x, y, angle and their speeds."""
        cos, sin = np.cos(state[2]), np.sin(state[2])
        corners = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * self.size
        arms = corners @ np.array([[cos, sin], [-sin, cos]])
        across = np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        slip = state[3:5] + state[5] * across
        push = -self.friction * slip / np.sqrt((slip**2).sum(axis=1, keepdims=True) + 1e-14)
        tilt = np.linalg.solve(arms.T @ arms + self.height * push.T @ arms, -self.height * push.sum(axis=0))
        force = GRAVITY / 4 * (1 + arms @ tilt)[:, None] * push
        return np.array([*state[3:], *force.sum(axis=0), (across * force).sum() / self.inertia])

    def slid(self, throw: Sequence[float] | Array) -> Array:
        """(3,): place [m] and angle [rad] at rest, from velocity [m/s] and rate of turn [rad/s]."""

        def at_rest(_: float, state: Array) -> float:
            return float(np.abs(state[3:]).max() - 1e-3)

        at_rest.terminal = True  # type: ignore[attr-defined]
        return np.asarray(
            solve_ivp(self.rate, [0, 3], [0, 0, 0, *throw], rtol=1e-7, atol=1e-9, events=at_rest).y[:3, -1]
        )
