"""What the driver needs to leave out calls whose guard is 0.

A result of a call that is left out stands for another place: that of an argument, or of zeros. So calls that read it
read there, and their adjoints add there. The driver writes the table of the calls that are left, with these places, and
keeps it for as long as it has all calls that are needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.program import FunctionCall, Place, Program

Words = NDArray[np.int64]
NONE = -1


@dataclass(frozen=True)
class Guarding:
    """Guards of a program, and what stands for results.

    Attributes:
        words: (g,) of the memory: the guards.
        first: calls of the body up to the last that computes a guard.
        aliases: (a, 5) of each result that has a stand-in: its guard, its offset, the alias that stands for it (-1:
            none), and the offset and the stride of what does.
        marks: for each table that is guarded one like it: at the place of a function's number the call's guard, at the
            place of an offset the alias that is there (-1: none).
    """

    words: Words
    first: int
    aliases: Words
    marks: dict[str, Words]


def guarding_of(
    program: Program, tables: dict[str, tuple[Sequence[FunctionCall], Sequence[Sequence[int]]]]
) -> Guarding | None:
    """Of a program; None if it has no guards. ProgramError names a call that the driver cannot follow.

    Args:
        program: whose body has calls with guards.
        tables: by name the calls and their entries.
    """
    words = list(dict.fromkeys(call.guard.offset for call in program.body if call.guard is not None))
    if not words:
        return None
    number = {word: k for k, word in enumerate(words)}
    aliases = _Aliases(program.size)
    for call in program.body:
        if call.guard is not None:
            _check(call)
            for place, other in zip(call.outputs, call.otherwise, strict=True):
                if other is not None:
                    aliases.add(number[call.guard.offset], place, other)
    for call in program.calls:
        for place in call.inputs:
            aliases.covering(place)
    marks = {name: _marks(calls, entries, number, aliases) for name, (calls, entries) in tables.items()}
    first = 1 + max(k for k, call in enumerate(program.body) if _writes(call, number))
    return Guarding(np.array(words, np.int64), first, np.array(aliases.rows, np.int64).reshape(-1, 5), marks)


class _Aliases:
    """The results that have a stand-in, and parts of them, by number."""

    def __init__(self, size: int) -> None:
        self.rows: list[tuple[int, int, int, int, int]] = []
        self._places: list[Place] = []
        self._owner = np.full(size, NONE, np.int64)
        self._parts: dict[tuple[int, int], int] = {}

    def add(self, guard: int, place: Place, other: Place) -> None:
        """A result for which another place may stand."""
        below = self.covering(other)
        self._owner[place.offset : place.offset + place.size] = len(self.rows)
        self._append(guard, place, below, other)

    def covering(self, place: Place) -> int:
        """The alias that is this place; NONE if there is none."""
        owners = self._owner[place.offset : place.offset + place.size]
        if place.stride or not owners.size or np.all(owners == NONE):
            return NONE
        if np.any(owners != owners[0]):
            raise ProgramError(f"{place} is read, of which parts have a stand-in")
        owner = int(owners[0])
        return self._part(owner, place.offset - self._places[owner].offset, place.size)

    def at(self, offset: int) -> int:
        """The alias that begins at a word."""
        if offset >= len(self._owner) or self._owner[offset] == NONE:
            return NONE
        owner = int(self._owner[offset])
        start = offset - self._places[owner].offset
        return self._parts[owner, start] if start else owner

    def _part(self, owner: int, start: int, size: int) -> int:
        if not start:
            return owner
        if (owner, start) not in self._parts:
            guard, offset, below, other, stride = self.rows[owner]
            below = NONE if below == NONE else self._part(below, start, size)
            self._parts[owner, start] = len(self.rows)
            self._append(guard, Place(offset + start, size), below, Place(other + start, size, stride))
        return self._parts[owner, start]

    def _append(self, guard: int, place: Place, below: int, other: Place) -> None:
        self.rows.append((guard, place.offset, below, other.offset, other.stride))
        self._places.append(place)


def _check(call: FunctionCall) -> None:
    assert call.guard is not None
    who = call.function.name()
    if call.guard.size != 1 or call.guard.stride:
        raise ProgramError(f"{who}: its guard is not a word of scratch but {call.guard}")
    if len(call.otherwise) != len(call.outputs) or call.accumulate:
        raise ProgramError(f"{who}: with a guard it says of each result what stands for it, and adds to nothing")
    for place, other in zip(call.outputs, call.otherwise, strict=True):
        if other is not None and (place.stride or other.size != place.size):
            raise ProgramError(f"{who}: {other} cannot stand for {place}")


def _writes(call: FunctionCall, guards: dict[int, int]) -> bool:
    return any(place.offset in guards and place.size == 1 for place in call.outputs)


def _marks(
    calls: Sequence[FunctionCall], entries: Sequence[Sequence[int]], number: dict[int, int], aliases: _Aliases
) -> Words:
    found = []
    for call, entry in zip(calls, entries, strict=True):
        guard = NONE if call.guard is None else number[call.guard.offset]
        found += [guard, NONE]
        for offset in entry[2::2]:
            found += [aliases.at(offset), NONE]
    return np.array(found or [0], np.int64)
