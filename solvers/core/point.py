"""A point that was evaluated, and which of two is better."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from symphys.solvers.core.outcome import Array


@dataclass(frozen=True)
class Point:
    """An evaluated z.

    Attributes:
        z: (n,).
        merit, objective: see ``ShootingProblem``.
        errors: normalised; met where <= 1.
        met: all errors met.
        outputs: what the problem tells of it; empty where it tells nothing.
        gradient: (n,) of the merit by z; empty where it was not asked for.
        residuals, jacobian: (m,) and (m, n), merit = r . r; empty where they were not asked for.
        spoilt: situations for validation in which it is not finite; of a point that was not validated, all.
        violation: largest error of a constraint, 0 where all are met; 0 for solvers that know no constraints, which
            have the penalty in the merit.
    """

    z: Array
    merit: float
    objective: float
    errors: Array
    met: bool = False
    outputs: Array = field(default_factory=lambda: np.zeros(0))
    gradient: Array = field(default_factory=lambda: np.zeros(0))
    residuals: Array = field(default_factory=lambda: np.zeros(0))
    jacobian: Array = field(default_factory=lambda: np.zeros((0, 0)))
    spoilt: int = 0
    violation: float = 0.0

    @property
    def miss(self) -> float:
        """The largest of the errors; nan without any."""
        return float(np.max(self.errors)) if self.errors.size else math.nan

    @property
    def valued(self) -> bool:
        """Whether merit, objective and errors are finite: all that decides which point is better."""
        return math.isfinite(self.merit) and math.isfinite(self.objective) and bool(np.isfinite(self.errors).all())

    @cached_property
    def finite(self) -> bool:
        """Whether every number that was asked for is finite."""
        return self.valued and all(bool(np.isfinite(p).all()) for p in (self.gradient, self.residuals, self.jacobian))

    def better(self, other: Point | None) -> bool:
        """Whether it is strictly better, by ``rank``; one whose values are not finite is never better."""
        if not self.valued:
            return False
        return other is None or not other.valued or self.rank < other.rank

    @property
    def rank(self) -> tuple[int, bool, float, float]:
        """What is judged, the lower the better: met before not met, then the violation, then the merit."""
        return self.spoilt, not self.met, self.violation, self.merit


def best_of(points: list[Point]) -> Point | None:
    """The best; None if none is finite."""
    best = None
    for point in points:
        best = point if point.better(best) else best
    return best
