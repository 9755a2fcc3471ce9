"""The tables that the driver walks, written many calls at a time.

A call's entry is the number of its function, its length, then offset and stride of each place. Calls of one kind have
entries that are made alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from symphys.codegen.program.phase_calls import PhaseCalls, grouped
from symphys.records import dataclass
from symphys.types import Ints


class Recipe(NamedTuple):
    """The recipe of the entries of one kind.

    Attributes:
        number: of the function.
        columns: its places: ("in", i) an argument, ("out", i) a result, ("tape", 0) the tape.
    """

    number: int
    columns: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Table:
    """The entries of some calls.

    Attributes:
        calls: (entries,) the number of each in its phase.
        starts: (entries,) where each begins.
        words: all of them, one after the other.
        rows: for each kind its entries.
        recipes: of the kinds.
    """

    calls: Ints
    starts: Ints
    words: Ints
    rows: Sequence[Ints]
    recipes: Sequence[Recipe]

    def start_of(self, count: int) -> Ints:
        """Return where the entry of each call of the phase begins (count,); -1: it has none."""
        found = np.full(count, -1, np.int64)
        found[self.calls] = self.starts
        return found

    def filled(self) -> Ints:
        """Return the words; one 0 where there are none, since C knows no empty arrays."""
        return self.words if len(self.words) else np.zeros(1, np.int64)


def table_of(phase: PhaseCalls, calls: Ints, kinds: Ints, recipe: Callable[[int], Recipe], tape: Ints) -> Table:
    """Return the entries of calls.

    Args:
        phase: what they are part of.
        calls: their numbers, in the order of the table.
        kinds: (calls,) what is made alike, in small numbers.
        recipe: of a kind; asked for in the order in which kinds come first.
        tape: (calls of the phase,) where the tape of each begins.
    """
    present, first, whose = np.unique(kinds, return_index=True, return_inverse=True)
    recipes = [Recipe(0, ())] * len(present)
    for i in np.argsort(first).tolist():
        recipes[i] = recipe(int(present[i]))
    lengths = np.array([2 + 2 * len(each.columns) for each in recipes], np.int64)[whose.ravel()]
    starts = np.cumsum(lengths) - lengths
    words = np.zeros(int(lengths.sum()), np.int64)
    rows = grouped(whose.ravel(), len(present))
    for each, (number, columns) in zip(rows, recipes, strict=True):
        at, own = starts[each], calls[each]
        words[at], words[at + 1] = number, 2 + 2 * len(columns)
        for k, (side, i) in enumerate(columns):
            if side == "tape":
                words[at + 2 + 2 * k] = tape[own]
                continue
            spans = phase.inputs if side == "in" else phase.outputs
            places = spans.starts[own] + i
            words[at + 2 + 2 * k], words[at + 3 + 2 * k] = spans.offset[places], spans.stride[places]
    return Table(calls, starts, words, rows, recipes)
