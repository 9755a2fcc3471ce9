"""Where values of one point, and adjoints of one block of rows, lie while a Jacobian is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symphys.codegen.emit.alternatives import NONE
from symphys.codegen.program.program import Place, Program
from symphys.codegen.slopes.pulls import Pull
from symphys.types import Ints

Key = tuple[int, int]
"""Offset and size of a place."""
Guards = tuple[int, int]
"""The words of a section and of a guard; -1: none."""


class PointPlaces:
    """Where the values of one point lie that adjoints read: in the order in which they read them."""

    def __init__(self) -> None:
        """Start with no place read."""
        self._found: dict[Key, tuple[int, Guards]] = {}
        self.size = 0

    def of(self, place: Place, guards: Guards) -> int:
        """The first word of a place, which is read by an adjoint with these guards."""
        key = place.offset, place.size
        at, before = self._found.get(key, (self.size, guards))
        if key not in self._found:
            self.size += place.size
        self._found[key] = at, before if before == guards else (NONE, NONE)
        return at

    def read(self) -> list[tuple[int, int, int, int]]:
        """(first, count, section, guard) of what is read; it is not where one of these words is 0."""
        return [(*key, *guards) for key, (_, guards) in self._found.items()]


@dataclass
class Cell:
    """Two places for results of which each stands for the one before, such as a body's velocity after each contact.

    Only the call that writes one reads the one before. So their adjoints are needed one after the other: each call
    reads one of the two places and adds to the other. A call that is left out leaves its adjoint where it is.

    Attributes:
        members: in the order in which their adjoints are needed; they lie in the two places in turns.
        first, second: words where these begin.
    """

    members: list[Key]
    first: int = 0
    second: int = 0


class AdjointPlaces:
    """Where adjoints lie: those that are not needed at the same time share words, so that all stay in fast memory.

    A result that calls read as a whole lives from the adjoint of its last reader to that of its writer, which leaves it
    zeroed. All other words have places of their own.

    Attributes:
        size: words.
        cells: pairs of places.
    """

    def __init__(self, program: Program, target: Place, backward: Sequence[Pull]) -> None:
        """Hand out the words; ``backward`` in the order in which adjoints are computed."""
        read, written = dict[Key, list[int]](), dict[Key, int]()
        parts: Ints = np.zeros(program.size, np.int64)
        for i, pull in enumerate(backward):
            for place in pull.marked("inputs"):
                read.setdefault((place.offset, place.size), []).append(i)
            for place in pull.marked("outputs"):
                written[place.offset, place.size] = i
        for offset, size in {*read, *written}:
            parts[offset : offset + size] += 1
        fixed = np.zeros(program.size, bool)
        for place in (target, program.z):
            fixed[place.offset : place.offset + place.size] = True
        whole = {
            key: (read[key][0], written[key])
            for key in read
            if key in written and (parts[key[0] : sum(key)] == 1).all() and not fixed[key[0] : sum(key)].any()
        }
        rest = fixed | (parts > 0)
        for offset, size in whole:
            rest[offset : offset + size] = False
        self.size = int(rest.sum())
        self._word: Ints = np.full(program.size, NONE, np.int64)
        self._word[rest] = np.arange(self.size)
        self.cells, self._of_key = list[Cell](), dict[Key, tuple[int, int]]()
        for i, pull in enumerate(backward):
            self._link(i, pull, whole, read)
        self._share(whole)

    def _link(self, i: int, pull: Pull, whole: dict[Key, Key], read: dict[Key, list[int]]) -> None:
        """Put results of a call, and what stands for them in any case, into cells."""
        copies = [set(other.copies) for other in pull.alternatives if other is not None]
        for copy in sorted(set.intersection(*copies)) if copies else ():
            after, before = (copy.offset, copy.size), (copy.source, copy.size)
            if after not in whole or before not in whole or set(read[before]) != {i}:
                continue
            if after not in self._of_key:
                self._of_key[after] = len(self.cells), 0
                self.cells.append(Cell([after]))
            number, parity = self._of_key[after]
            self._of_key[before] = number, 1 - parity
            self.cells[number].members.append(before)

    def _share(self, whole: dict[Key, Key]) -> None:
        """Places for what lives for a while: from the first of its readers to its writer."""
        alone = [(whole[key], key[1], key, NONE) for key in whole if key not in self._of_key]
        for number, cell in enumerate(self.cells):
            lives = [whole[key] for key in cell.members]
            both = min(first for first, _ in lives), max(last for _, last in lives)
            alone.append((both, cell.members[0][1], cell.members[0], number))
        free: dict[int, list[tuple[int, int]]] = {}
        for (first, last), size, key, number in sorted(alone):
            places = [self._taken(free.setdefault(size, []), first, last, size) for _ in range(1 + (number != NONE))]
            if number == NONE:
                self._put(key, places[0])
                continue
            cell = self.cells[number]
            cell.first, cell.second = places
            for member in cell.members:
                self._put(member, places[self._of_key[member][1]])

    def _taken(self, same: list[tuple[int, int]], first: int, last: int, size: int) -> int:
        index = next((i for i, (_, until) in enumerate(same) if until < first), None)
        at = same.pop(index)[0] if index is not None else self.size
        self.size += size if index is None else 0
        same.append((at, last))
        return at

    def _put(self, key: Key, at: int) -> None:
        self._word[key[0] : sum(key)] = at + np.arange(key[1])

    def of(self, offset: int, size: int) -> int:
        """The first word of a place."""
        return int(self._word[offset]) if size else 0

    def cell(self, offset: int, size: int) -> tuple[int, int]:
        """The number of the cell of a place and in which of its two places it lies; -1: it has none."""
        return self._of_key.get((offset, size), (NONE, 0))

    def ranges(self, place: Place) -> list[tuple[int, int]]:
        """(first, count) where the adjoint of a place may lie."""
        number, _ = self.cell(place.offset, place.size)
        if number == NONE:
            return [(self.of(place.offset, place.size), place.size)]
        cell = self.cells[number]
        return [(cell.first, place.size), (cell.second, place.size)]
