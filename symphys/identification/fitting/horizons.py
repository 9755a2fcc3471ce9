"""Recordings cut off after a share of their time, so that fits may begin with what happens first.

After an impact a motion depends on its start more and more steeply, and where it leads to other impacts the merit has a
minimum for each. A fit of the first third of each recording has few of them. It is the start of a fit of the first
half, and so on to the whole.
"""

from __future__ import annotations

from dataclasses import replace

from symphys.identification.interface import Array, Bools, Ints, RecordedResiduals, ResidualRows, Rows


class TruncatedRecordings:
    """A problem without what was measured after a share of the time of each recording."""

    def __init__(self, problem: RecordedResiduals, share: float) -> None:
        """``share`` of the last measured time, above 0 and at most 1."""
        self.problem, self.share = problem, share
        self.recordings, self.held_back = problem.recordings, problem.held_back
        self.shared, self.own = problem.shared, problem.own
        self.quantities, self.units, self.noise_known = problem.quantities, problem.units, problem.noise_known
        self._kept: dict[int, Bools] = {}

    def kept(self, recording: int) -> Bools:
        """(m,) which residuals of the problem are kept."""
        if recording not in self._kept:
            time = self.problem.rows(recording).time
            self._kept[recording] = time <= self.share * time.max(initial=0.0)
        return self._kept[recording]

    def rows(self, recording: int) -> ResidualRows:
        """See ``RecordedResiduals``."""
        rows, kept = self.problem.rows(recording), self.kept(recording)
        columns = ("quantity", "component", "time", "noise", "impact")
        return replace(rows, **{name: getattr(rows, name)[kept] for name in columns})

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """See ``RecordedResiduals``."""
        found = self.problem.residuals(shared, own, which)
        return [r[self.kept(int(k))] for k, r in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """See ``RecordedResiduals``."""
        found = []
        for k, parts in zip(which, self.problem.jacobian(shared, own, which), strict=True):
            r, by_shared, by_own = (part[self.kept(int(k))] for part in parts)
            found.append((r, by_shared, by_own))
        return found
