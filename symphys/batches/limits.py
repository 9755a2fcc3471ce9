"""What bounds a batch: tries and time of a run, time of the whole; and why work is to stop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import monotonic

from symphys.interrupts import Stop


@dataclass(frozen=True)
class BatchLimits:
    """Bounds of a batch.

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


UNLIMITED = BatchLimits()
"""Whatever it takes; no second try."""


class Halt:
    """Whether, and why, runs are to stop where they can go on later."""

    def __init__(self, interrupted: Stop, budget: float = math.inf) -> None:
        """``interrupted``: whether Ctrl-C was pressed; ``budget``: [s] from now."""
        self.interrupted, self.budget = interrupted, budget
        self.began = monotonic()

    @property
    def spent(self) -> bool:
        """Whether the time of the batch is used up."""
        return monotonic() - self.began > self.budget

    @property
    def overdue(self) -> float:
        """[s] since the time of the batch was used up; 0 before."""
        return max(monotonic() - self.began - self.budget, 0.0)

    def __call__(self) -> bool:
        """Whether to stop."""
        return self.interrupted() or self.spent

    @property
    def reason(self) -> str:
        """For the runs that it stops; empty after Ctrl-C, which needs no words."""
        if self.interrupted() or not self.spent:
            return ""
        return f"stopped as the {self.budget:g} s of the batch are used up; the same command goes on from here"


def timed_out(timeout: float) -> str:
    """Said of a run that was stopped."""
    return f"stopped after {timeout:g} s, its timeout; the same command goes on from here"
