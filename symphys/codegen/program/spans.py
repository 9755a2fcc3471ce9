"""The places of many calls as arrays, for operations on all words at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.codegen.program.calls import Place
from symphys.records import dataclass
from symphys.types import Ints


@dataclass(frozen=True)
class Spans:
    """Places, those of a call side by side.

    Attributes:
        starts: (calls + 1,) where the places of each call begin.
        call: (places,) whose each is.
        offset, size, stride: (places,) [words].
    """

    starts: Ints
    call: Ints
    offset: Ints
    size: Ints
    stride: Ints

    @classmethod
    def of(cls, places: Sequence[Sequence[Place]]) -> Spans:
        """Collect the places of each call; most places belong to several calls as one object."""
        counts = np.array([len(own) for own in places], np.int64)
        found, first, numbers = np.unique(
            np.array([id(place) for own in places for place in own], np.int64), return_index=True, return_inverse=True
        )
        del found
        starts = np.concatenate([[0], np.cumsum(counts)])
        flat = [place for own in places for place in own]
        rows = np.array([(p.offset, p.size, p.stride) for p in (flat[k] for k in first)], np.int64).reshape(-1, 3)
        return cls(starts, np.repeat(np.arange(len(counts)), counts), *rows[numbers.ravel()].T.copy())

    def part(self, first: int, last: int) -> Spans:
        """Select some calls, which keep their numbers."""
        begin, end = self.starts[first], self.starts[last]
        rows = (each[begin:end] for each in (self.call, self.offset, self.size, self.stride))
        return Spans(self.starts[first : last + 1] - begin, *rows)

    def words(self, steps: int = 1) -> tuple[Ints, Ints, Ints]:
        """Return the words that they cover, of each the call and the step; places with a stride at all steps."""
        count = np.where(self.stride != 0, steps, 1)
        step = stretches(np.zeros(len(count), np.int64), count)
        offset = np.repeat(self.offset, count) + step * np.repeat(self.stride, count)
        size = np.repeat(self.size, count)
        return stretches(offset, size), np.repeat(np.repeat(self.call, count), size), np.repeat(step, size)


def stretches(first: Ints, count: Ints) -> Ints:
    """Return ``count`` consecutive numbers from each ``first``, side by side."""
    ends = np.cumsum(count)
    total = int(ends[-1]) if len(ends) else 0
    return np.repeat(first - ends + count, count) + np.arange(total)
