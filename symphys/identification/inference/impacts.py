"""Recordings whose impacts are those of their simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np

from symphys.identification.interface import RecordedResiduals, ResidualRows, Rows
from symphys.types import Array, Ints


@runtime_checkable
class SimulatedImpacts(Protocol):
    """A problem of identification that simulates when impacts are."""

    def simulated_impacts(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """(i,) [s] instants of the impacts of each recording in ``which``, rising; shared (s,), own (K, o)."""


class TimedRecordings:
    """A problem whose rows have the time since the last impact, from instants of all recordings."""

    def __init__(self, problem: RecordedResiduals, impacts: Sequence[Array]) -> None:
        """``impacts``: (i,) [s] of each of the K recordings, rising."""
        self.problem, self.impacts = problem, impacts
        self.recordings, self.held_back = problem.recordings, problem.held_back
        self.shared, self.own = problem.shared, problem.own
        self.quantities, self.units, self.noise_known = problem.quantities, problem.units, problem.noise_known

    def rows(self, recording: int) -> ResidualRows:
        """See ``RecordedResiduals``."""
        rows, instants = self.problem.rows(recording), self.impacts[recording]
        count = np.searchsorted(instants, rows.time)
        last = np.concatenate([[np.nan], instants])[count]
        return replace(rows, impact=rows.time - last)

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """See ``RecordedResiduals``."""
        return self.problem.residuals(shared, own, which)

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """See ``RecordedResiduals``."""
        return self.problem.jacobian(shared, own, which)


def timed(problem: RecordedResiduals, source: RecordedResiduals, shared: Array, own: Array) -> RecordedResiduals:
    """``problem`` with the impacts that ``source`` simulates at shared (s,) and own (K, o), where it simulates any."""
    if not isinstance(source, SimulatedImpacts):
        return problem
    return TimedRecordings(problem, source.simulated_impacts(shared, own, np.arange(len(own))))
