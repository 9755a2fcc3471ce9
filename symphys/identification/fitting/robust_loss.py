"""Huber's loss: squares of small residuals, absolute values of large ones (Huber 1964).

The merit is sum rho(r), rho = r^2 for |r| <= k, 2 k |r| - k^2 beyond. k is in units of the noise; inf is least squares,
1.345 keeps 95 % of the efficiency of least squares under normal noise.

A step takes min(1, k / |r|) for the curvature of rho: iterative reweighting. That is an upper bound of the curvature.
Triggs' correction (Triggs et al., *Bundle Adjustment - A Modern Synthesis*, 2000, section 4.3) takes the curvature
itself, which is 0 beyond k. It was slower on the projectile, oscillator, bounce and sliding block of
tests/data/analytic_recordings.py with 0, 10 and 40 % of gross errors: 10 to 15 steps instead of 7 to 13 from 5 % off,
and from 30 % off it ended in another minimum of the bounces, where most residuals begin beyond k and have no curvature.
"""

from __future__ import annotations

import math

import numpy as np

from symphys.identification.interface import IdentificationError
from symphys.records import dataclass
from symphys.types import Array


@dataclass(frozen=True)
class RobustLoss:
    """Huber's loss with the ``threshold`` k, in units of the noise; inf: least squares."""

    threshold: float = math.inf

    def __post_init__(self) -> None:
        """Raise IdentificationError where the threshold is no number above 0."""
        if not self.threshold > 0:
            raise IdentificationError(f"the threshold of the robust loss is {self.threshold}: it must be above 0")

    @property
    def robust(self) -> bool:
        """Whether it differs from least squares."""
        return self.threshold < math.inf

    def value(self, r: Array) -> float:
        """Return the sum of rho over residuals (m,)."""
        size = np.abs(r)
        if not self.robust or not np.any(size > self.threshold):
            return float(r @ r)
        return float(np.sum(np.where(size <= self.threshold, r * r, self.threshold * (2 * size - self.threshold))))

    def influence(self, r: Array) -> Array:
        """Return (m,) psi, half the derivative of rho: r clipped to the threshold."""
        return np.clip(r, -self.threshold, self.threshold)

    def weight(self, r: Array) -> Array:
        """Return (m,) psi / r, which stands for half the second derivative of rho in a step."""
        return self.threshold / np.maximum(np.abs(r), self.threshold) if self.robust else np.ones_like(r)

    def inside(self, r: Array) -> Array:
        """Return (m,) half the second derivative of rho itself: 1 up to the threshold, 0 beyond."""
        return (np.abs(r) <= self.threshold).astype(float)

    @property
    def normal_square(self) -> float:
        """Return the mean of psi^2 under standard normal residuals."""
        if not self.robust:
            return 1.0
        k = self.threshold
        beyond = math.erfc(k / math.sqrt(2))
        return 1 - beyond - 2 * k * math.exp(-k * k / 2) / math.sqrt(2 * math.pi) + k * k * beyond
