"""The points along a solve from which its motions are shown: an even choice of the iterations, with both ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.records import dataclass
from symphys.types import Array

MOST_POINTS = 60


@dataclass(frozen=True)
class FilmPoint:
    """The point of an iteration: the number of its ``row`` in the trace, and ``z`` (n,)."""

    row: int
    z: Array


class FilmRecorder:
    """Keeps up to ``MOST_POINTS`` points of a solve of unknown length: every so many iterations, the last one too."""

    def __init__(self) -> None:
        """Begin without any."""
        self._kept: list[FilmPoint] = []
        self._last: FilmPoint | None = None
        self._every = 1

    def add(self, row: int, z: Array) -> None:
        """Take note of the point of an iteration."""
        self._last = FilmPoint(row, np.array(z, float))
        if row % self._every:
            return
        self._kept.append(self._last)
        if len(self._kept) >= MOST_POINTS:
            self._every *= 2
            self._kept = [point for point in self._kept if point.row % self._every == 0]

    @property
    def points(self) -> Sequence[FilmPoint]:
        """Return what is kept, in order."""
        last = [self._last] if self._last is not None and self._last not in self._kept[-1:] else []
        return (*self._kept, *last)
