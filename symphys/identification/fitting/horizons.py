"""Recordings restricted to a first share of their time, or to the time before the first impact.

After an impact a motion depends on its start more and more steeply, and where it leads to other impacts the merit has a
minimum for each. A fit of the first third of each recording has few of them. It is the start of a fit of the first
half, and so on to the whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symphys.identification.interface import DerivedResiduals, RecordedResiduals, ResidualRows, Rows
from symphys.types import Array, Bools, Ints

Selection = Callable[[ResidualRows], Bools]
"""The m rows of a recording -> (m,) which of them count."""


def first_share(share: float) -> Selection:
    """Select what was measured in the first ``share`` of the time of a recording, above 0 and at most 1."""
    return lambda rows: rows.time <= share * rows.time.max(initial=0.0)


def before_impact(rows: ResidualRows) -> Bools:
    """Select what was measured before the first impact."""
    after = rows.time[~np.isnan(rows.impact)]
    return np.asarray(rows.time < after.min(initial=np.inf))


class PartialRecordings(DerivedResiduals):
    """A problem with some rows of each recording only."""

    def __init__(self, problem: RecordedResiduals, selection: Selection) -> None:
        """Take the rows chosen by ``selection``, which is called once for each recording."""
        super().__init__(problem)
        self.selection = selection
        self._kept: dict[int, Bools] = {}

    def kept(self, recording: int) -> Bools:
        """Return (m,) which residuals of the problem are kept."""
        if recording not in self._kept:
            self._kept[recording] = self.selection(self.problem.rows(recording))
        return self._kept[recording]

    def rows(self, recording: int) -> ResidualRows:
        """Describe the residuals that are kept."""
        rows, kept = self.problem.rows(recording), self.kept(recording)
        columns = ("quantity", "component", "time", "noise", "impact")
        return replace(rows, **{name: getattr(rows, name)[kept] for name in columns})

    def residuals(self, shared: Array, own: Array, which: Ints) -> list[Array]:
        """Return the residuals that are kept."""
        found = self.problem.residuals(shared, own, which)
        return [r[self.kept(int(k))] for k, r in zip(which, found, strict=True)]

    def jacobian(self, shared: Array, own: Array, which: Ints) -> Rows:
        """Return the residuals that are kept, and their derivatives."""
        found = []
        for k, parts in zip(which, self.problem.jacobian(shared, own, which), strict=True):
            r, by_shared, by_own = (part[self.kept(int(k))] for part in parts)
            found.append((r, by_shared, by_own))
        return found
