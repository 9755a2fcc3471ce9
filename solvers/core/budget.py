"""The used share of a solve's budget, and the time left at most, from the rows of its trace."""

from __future__ import annotations

import math
from collections.abc import Sequence

from symphys.solvers.core.outcome import TraceRow

BOUNDED = {"iterations": "iteration", "evaluations": "rollouts"}
"""Options that bound each stage of smoothing, each with the field of a row that it bounds."""


class BudgetUse:
    """The use of the budget of one solve; ``add`` takes its rows in order.

    A budget is an upper bound: solvers converge earlier. So ``seconds_left`` is the time that is left at most, if
    iterations go on at their present pace.
    """

    def __init__(self, options: object, smoothing: Sequence[float]) -> None:
        """Start with an unused budget.

        Args:
            options: of the solver; what none of them bounds has a share of nan.
            smoothing: of each stage of the solve.
        """
        self._limits = {key: float(getattr(options, key, math.inf)) for key in BOUNDED}
        self._most = float(getattr(options, "max_seconds", math.inf))
        self._smoothing = tuple(smoothing)
        self._first: TraceRow | None = None
        self._begin: dict[str, float] = {}
        self._row: TraceRow | None = None

    @property
    def row(self) -> TraceRow | None:
        """The last row; None before the first one."""
        return self._row

    def add(self, row: TraceRow) -> None:
        """Add the next row; the first row of a resumed solve may have any number."""
        before = self._row
        if before is None or row.smoothing != before.smoothing:
            rollouts = before.rollouts if before else row.rollouts if row.iteration else 0
            self._begin = {"iteration": row.iteration, "rollouts": rollouts}
        self._first, self._row = self._first or row, row

    @property
    def share(self) -> float:
        """Return the used share, 0 to 1, of the tightest bound; nan without a bound."""
        if self._row is None:
            return 0.0 if math.isfinite(min(self._most, *self._limits.values())) else math.nan
        stages = len(self._smoothing) or 1
        shares = [(self._stage + min(used / limit, 1.0)) / stages for _, used, limit in self._bounds(self._row)]
        if math.isfinite(self._most):
            shares.append(min(self._row.seconds / self._most, 1.0))
        return max(shares, default=math.nan)

    @property
    def seconds_left(self) -> float:
        """Return the time left [s] at most; inf where it is unknown."""
        row, first = self._row, self._first
        if row is None or first is None:
            return self._most
        left = [max(self._most - row.seconds, 0.0)]
        for number, used, limit in self._bounds(row):
            done = getattr(row, number) - getattr(first, number)
            if done > 0:
                rest = (max(len(self._smoothing), 1) - self._stage) * limit - used
                left.append(max(rest, 0.0) * (row.seconds - first.seconds) / done)
        return min(left)

    @property
    def _stage(self) -> int:
        """Return the index of the stage of the last row."""
        known = self._row is not None and self._row.smoothing in self._smoothing
        return self._smoothing.index(self._row.smoothing) if known and self._row else 0

    def _bounds(self, row: TraceRow) -> list[tuple[str, float, float]]:
        """Return for each bound of a stage the column of the row, the used amount and the limit."""
        return [
            (number, getattr(row, number) - self._begin[number], self._limits[key])
            for key, number in BOUNDED.items()
            if 0 < self._limits[key] < math.inf
        ]
