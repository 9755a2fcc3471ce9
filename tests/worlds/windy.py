"""A toy with a scenario: a wind that moves what is best."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from worlds.toys import toy

from symphys.shooting import ScenarioSamples, ShootingProblem, Values
from symphys.types import Array

BEST = np.array([0.5, -0.25])


class Winds:
    """(z - BEST - wind)^2, with a wind that differs; those above ``storm`` end the motion, and spoil it ``badly``."""

    def __init__(self, spread: float = 0.3, storm: float = np.inf, badly: float = 0.0) -> None:
        self.grids, self.spread, self.storm, self.badly = ("", "fine"), spread, storm, badly
        self.asked: list[int] = []
        self.horizons: list[float] = []

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        rows = width * self.spread * rng.uniform(-1, 1, (count, 2))
        rows[0] = 0
        return ScenarioSamples(grid, rows)

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        off = Z - BEST - drawn.numbers
        merit = (off**2).sum(axis=1)
        over = np.abs(drawn.numbers).max(axis=1) > self.storm
        merit = np.where(over, merit + self.badly, merit)
        return Values(merit, merit, np.zeros((len(merit), 0)), alive=1.0 - over)

    def gradient(
        self, Z: Array, drawn: ScenarioSamples, smoothing: float, adjoint_discount: float = 0.0, horizon: float = np.inf
    ) -> Values:
        self.asked.append(drawn.grid)
        self.horizons.append(horizon)
        found = self.value(Z, drawn, smoothing)
        slopes = 2 * (Z - BEST - drawn.numbers) + 0 * found.merit[:, None]
        return replace(found, gradient=slopes)


def windy(**settings: Any) -> ShootingProblem:
    """The problem."""
    return replace(toy(2, objective=lambda z, s: ca.sumsqr(z - BEST)), scenario=Winds(**settings))
