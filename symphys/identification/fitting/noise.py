"""Unknown noise: its standard deviation, estimated from the residuals, quantity by quantity.

sigma^2 = sum psi(r / sigma)^2 / (beta (m - h)), with m residuals of the quantity, h their leverage (how many numbers
they determine), and beta the mean of psi^2 under normal noise (Huber's proposal 2). In least squares that is the
unbiased variance. Fit and estimate take turns until the deviations stand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.inference.uncertainty import Information
from symphys.identification.interface import DerivedResiduals, RecordedResiduals, ResidualRows, Rows
from symphys.types import Array, Ints

MIN_NOISE_FACTOR = 1e-12
"""Least factor on the guess of a noise: residuals of exact recordings have none."""
MIN_DEGREES_OF_FREEDOM = 0.5
"""Least number of residuals less their leverage for an estimate."""
MAX_ITERATIONS, MIN_CHANGE = 50, 1e-4
"""Iterations of Huber's proposal 2 on the same residuals, at most, and the change at which they end."""


class RescaledResiduals(DerivedResiduals):
    """A problem whose residuals of each quantity are divided by an additional factor."""

    def __init__(self, problem: RecordedResiduals, factors: Array) -> None:
        """Multiply the noise of the problem by ``factors`` (q,) by quantity."""
        super().__init__(problem)
        self.factors = factors
        self._divisors: dict[int, Array] = {}

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals of a recording, with the estimated noise."""
        rows = self.problem.rows(recording)
        return replace(rows, noise=rows.noise * self.factors[rows.quantity])

    def _divisor(self, recording: int) -> Array:
        if recording not in self._divisors:
            self._divisors[recording] = self.factors[self.problem.rows(recording).quantity]
        return self._divisors[recording]

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the rescaled residuals."""
        found = self.problem.residuals(shared, own, which)
        return [r / self._divisor(int(k)) for k, r in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Return the rescaled residuals and derivatives."""
        found = []
        for k, (r, by_shared, by_own) in zip(which, self.problem.jacobian(shared, own, which), strict=True):
            divisor = self._divisor(int(k))
            found.append((r / divisor, by_shared / divisor[:, None], by_own / divisor[:, None]))
        return found


def noise_factors(
    problem: RecordedResiduals, evaluated: Rows, which: Ints, loss: RobustLoss, information: Information
) -> Array:
    """Estimate (q,) the factor on the noise of each quantity; 1 where it is given."""
    count = len(problem.quantities)
    quantities, leverages = [], []
    for at, (k, (_, by_shared, by_own)) in enumerate(zip(which, evaluated, strict=True)):
        quantities.append(problem.rows(int(k)).quantity)
        own_rows = by_own * problem.own.scale[k] * information.free_own[at]
        ahead = by_shared * problem.shared.scale * information.free_shared + own_rows @ information.gain[at]
        alone = own_rows @ information.own.whitener[at]
        leverages.append(np.sum((ahead @ information.shared.whitener) ** 2, axis=1) + np.sum(alone**2, axis=1))
    r, quantity, leverage = (np.concatenate(each) for each in ([r for r, _, _ in evaluated], quantities, leverages))
    factors = np.ones(count)
    for _ in range(MAX_ITERATIONS):
        scaled = r / factors[quantity]
        squares = np.bincount(quantity, loss.influence(scaled) ** 2, minlength=count)
        freedom = np.bincount(quantity, 1 - leverage * loss.inside(scaled), minlength=count)
        enough = (freedom > MIN_DEGREES_OF_FREEDOM) & ~problem.noise_known
        change = np.sqrt(squares / (loss.normal_square * np.where(enough, freedom, 1.0)))
        change = np.where(enough, np.maximum(change, MIN_NOISE_FACTOR), 1.0)
        factors = np.maximum(factors * change, MIN_NOISE_FACTOR)
        if np.all(np.abs(change - 1) < MIN_CHANGE):
            break
    return factors
