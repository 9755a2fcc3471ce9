"""The trace of a solve: one row for each iteration, and the time since the solve began."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, astuple, replace

from symphys.solvers.core.outcome import Counts, TraceRow


class SolveTrace:
    """The iterations of a solve and their times, interruptions left out."""

    def __init__(self, rows: Iterable[TraceRow] = (), seconds: float = 0.0) -> None:
        """Start the clock; ``rows`` and ``seconds``: those of a resumed solve."""
        self._rows = list(rows)
        self._earlier, self._began = seconds, time.perf_counter()

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._rows)

    @property
    def rows(self) -> tuple[TraceRow, ...]:
        """All rows."""
        return tuple(self._rows)

    @property
    def last(self) -> TraceRow | None:
        """The last row; None before the first one."""
        return self._rows[-1] if self._rows else None

    @property
    def seconds(self) -> float:
        """The time [s] since the solve began, interruptions left out."""
        return self._earlier + time.perf_counter() - self._began

    def append(self, counts: Counts, numbers: Iterable[float], outputs: Mapping[str, float]) -> TraceRow:
        """Add an iteration that ends now; ``numbers``: objective to smoothing, in the order of ``TraceRow``."""
        row = TraceRow(*(len(self), *astuple(counts), self.seconds, *numbers, dict(outputs)))
        self._rows.append(row)
        return row

    def distribute(self, work: Counts, first: int) -> None:
        """Add work evenly to the rows from ``first`` on, for a library that reports it only at its end."""
        share = len(self) - first
        for index in range(first, len(self)):
            row, part = self._rows[index], work.share((index - first + 1) / share)
            self._rows[index] = replace(row, **asdict(counts_of(row) + part))


def counts_of(row: TraceRow) -> Counts:
    """Return the work up to a row."""
    return Counts(row.rollouts, row.gradients, row.jacobians, row.hessians)
