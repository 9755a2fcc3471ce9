"""Evaluated points, their order, and the incumbent: the best point of a stage."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import field
from functools import cached_property

import numpy as np

from symphys.records import dataclass
from symphys.solvers.core.outcome import Status, StopReason
from symphys.types import Array


@dataclass(frozen=True)
class Point:
    """An evaluated z.

    Attributes:
        z: (n,).
        merit, objective: see ``ShootingProblem``.
        errors: normalised; met where <= 1.
        met: all errors met.
        outputs: (o,) the problem's outputs, see ``ShootingProblem.output_names``; empty where it has none.
        gradient: (n,) of the merit by z; empty where it was not asked for.
        residuals, jacobian: (m,) and (m, n), merit = r . r; empty where they were not asked for.
        failed_samples: validation samples in which it is not finite; of a point that was not validated, all.
        violation: largest error of a constraint, 0 where all are met; 0 for solvers without constraints, which have the
            penalty in the merit.
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
    failed_samples: int = 0
    violation: float = 0.0

    @property
    def max_violation(self) -> float:
        """The largest error; nan without any."""
        return float(np.max(self.errors)) if self.errors.size else math.nan

    @property
    def valued(self) -> bool:
        """Whether merit, objective and errors are finite, which decide the order of points."""
        return math.isfinite(self.merit) and math.isfinite(self.objective) and bool(np.isfinite(self.errors).all())

    @cached_property
    def finite(self) -> bool:
        """Whether all evaluated numbers are finite."""
        return self.valued and all(bool(np.isfinite(p).all()) for p in (self.gradient, self.residuals, self.jacobian))

    def better(self, other: Point | None) -> bool:
        """Whether the point is strictly better, by ``rank``; one whose values are not finite never is."""
        if not self.valued:
            return False
        return other is None or not other.valued or self.rank < other.rank

    @property
    def rank(self) -> tuple[int, bool, float, float]:
        """Return the sort key, lower is better: met before unmet, then the violation, then the merit."""
        return self.failed_samples, not self.met, self.violation, self.merit


def best_of(points: list[Point]) -> Point | None:
    """Return the best point; None if none is finite."""
    best = None
    for point in points:
        best = point if point.better(best) else best
    return best


class Stop(Exception):
    """Raised within an evaluation to end a stage: the incumbent meets everything, and the problem stops there."""

    def __init__(self) -> None:
        """Set the reason."""
        super().__init__(Status.MET.value)
        self.reason = StopReason(Status.MET)


class Incumbent:
    """The best point of a stage by the measure that judges runs, see ``Point.rank``.

    Where the problem stops when all is met, and somebody can confirm that, it stops at a point that is confirmed.
    """

    def __init__(
        self, stop_when_met: bool, best: Point | None = None, confirms: Callable[[Array], bool] | None = None
    ) -> None:
        """Start from ``best``, that of a resumed solve; ``stop_when_met``, ``confirms``: see ``ShootingProblem``."""
        self._stop_when_met, self._best, self._confirms = stop_when_met, best, confirms
        self._refused: Point | None = None

    @property
    def best(self) -> Point | None:
        """The best point so far; None before the first finite one."""
        return self._best

    def offer(self, points: Iterable[Point]) -> None:
        """Keep the best of the points and the present one; raise Stop where everything is met."""
        for point in points:
            if point.better(self._best):
                self._best = point
        self._stop_if_met()

    def replace(self, point: Point) -> None:
        """Keep this point, whatever the present one is; raise Stop where everything is met."""
        self._best = point
        self._stop_if_met()

    def _stop_if_met(self) -> None:
        best = self._best
        if not self._stop_when_met or best is None or not best.met or best is self._refused:
            return
        if self._confirms is None or self._confirms(best.z):
            raise Stop
        self._refused = best
