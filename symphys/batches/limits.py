"""The limits of a batch: tries and time of a run, time of the whole; and the halt that they cause."""

from __future__ import annotations

import math
from time import monotonic

from symphys.interrupts import Stop
from symphys.records import dataclass

JUDGING_SHARE, MOST_JUDGING = 0.05, 10.0
"""Share of a run's time that is kept for judging what it has found, and that in seconds at most."""


@dataclass(frozen=True)
class BatchLimits:
    """Limits of a batch.

    Attributes:
        retries: how often a run that fails is tried again; one whose process dies is so at least once.
        timeout: [s] of one run, from its beginning.
        budget: [s] of the whole batch.
    """

    retries: int = 0
    timeout: float = math.inf
    budget: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether a limit may end a run, which needs a process of its own for that."""
        return min(self.timeout, self.budget) < math.inf

    @property
    def judging(self) -> float:
        """Return the last part of ``timeout`` [s], in which a run is judged and solves no more."""
        return min(JUDGING_SHARE * self.timeout, MOST_JUDGING)


UNLIMITED = BatchLimits()
"""No limit of time; no second try."""


class Halt:
    """The condition on which runs are to stop where they can resume."""

    def __init__(self, interrupted: Stop, budget: float = math.inf) -> None:
        """Keep ``interrupted``, whether Ctrl-C was pressed, and ``budget`` [s] from this moment."""
        self.interrupted, self.budget = interrupted, budget
        self.began = monotonic()

    @property
    def spent(self) -> bool:
        """Whether the time of the batch is used up."""
        return monotonic() - self.began > self.budget

    @property
    def overdue(self) -> float:
        """The time [s] since the budget was used up; 0 until then."""
        return max(monotonic() - self.began - self.budget, 0.0)

    def __call__(self) -> bool:
        """Whether to stop."""
        return self.interrupted() or self.spent

    @property
    def reason(self) -> str:
        """The reason, for the results of stopped runs; empty after Ctrl-C."""
        if self.interrupted() or not self.spent:
            return ""
        return f"stopped as the {self.budget:g} s of the batch are used up; the same command goes on from here"


def timed_out(timeout: float) -> str:
    """Return the reason for a run that was stopped by its timeout."""
    return f"stopped after {timeout:g} s, its timeout; the same command goes on from here"
