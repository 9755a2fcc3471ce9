"""Which results of calls have to be 0 where a guard leaves the calls out: those that something else reads then."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import casadi as ca

from symphys.codegen.neighbours.program import MemberLoop, Move, Word
from symphys.dynamics.tracing.recording import TracedCall, TracedVector

Entries = set[int]


class _Readers:
    """Which entries of vectors are read, by the guards of what reads them."""

    def __init__(self) -> None:
        self._read: dict[int, dict[Word | None, Entries]] = {}
        self._used: dict[int, list[Entries]] = {}

    def note(self, call: TracedCall, guard: Word | None, handed_on: Collection[int]) -> None:
        """What a call reads; copies of what is ``handed_on`` are read in place of it."""
        for vector, entries in zip(call.inputs, self._entries(call.function), strict=True):
            if vector.number not in handed_on:
                self.add(vector.number, guard, entries)

    def add(self, number: int, guard: Word | None, entries: Entries) -> None:
        """Entries of a vector that are read."""
        self._read.setdefault(number, {}).setdefault(guard, set()).update(entries)

    def beside(self, number: int, guard: Word | None) -> Entries:
        """The entries of a vector that are read under other guards."""
        return {entry for other, own in self._read.get(number, {}).items() if other != guard for entry in own}

    def _entries(self, function: ca.Function) -> list[Entries]:
        """By argument those on which a function depends."""
        key = function.__hash__()
        if key not in self._used:
            arguments = [ca.SX.sym("a", function.numel_in(i)) for i in range(function.n_in())]
            homes = {e.element_hash(): (i, j) for i, a in enumerate(arguments) for j, e in enumerate(_symbols(a))}
            self._used[key] = [set() for _ in arguments]
            results = function.call([*arguments])
            for symbol in ca.symvar(ca.vertcat(ca.SX(0, 1), *map(ca.vec, results))):
                argument, entry = homes[symbol.element_hash()]
                self._used[key][argument].add(entry)
        return self._used[key]


def with_clearing(
    loops: Sequence[MemberLoop], calls: Sequence[TracedCall], kept: Collection[int], handed_on: Collection[int]
) -> tuple[MemberLoop, ...]:
    """The loops, whose guarded calls know what has to be cleared.

    Args:
        loops: of a step.
        calls: by the numbers of the calls in loops.
        kept: numbers of vectors that are read beside calls.
        handed_on: the same of what one member hands on to the next: it stays as it was.
    """
    readers, found = _Readers(), list[MemberLoop]()
    for loop in reversed(loops):
        does = list(loop.does)
        for k in range(len(does) - 1, -1, -1):
            each = does[k]
            if isinstance(each, Move):
                continue
            call, spans = calls[each.number], list[tuple[int, int]]()
            for vector, at in zip(call.outputs, each.outputs, strict=True):
                if vector.number in kept:
                    readers.add(vector.number, None, set(range(vector.size)))
                spans += _spans(at, readers.beside(vector.number, each.guard))
            does[k] = replace(each, cleared=tuple(spans) if each.guard is not None else ())
            readers.note(call, each.guard, handed_on)
            for vector in _standing(call) if spans else ():
                if vector.number not in handed_on:
                    readers.add(vector.number, None, set(range(vector.size)))
        found.append(replace(loop, does=tuple(does)))
    return tuple(reversed(found))


def _standing(call: TracedCall) -> Iterator[TracedVector]:
    """What stands for the results of a call where its section is left out."""
    for part in call.section.otherwise if call.section is not None else ():
        if part is not None and part.vector is not None:
            yield part.vector


def _spans(at: int, entries: Entries) -> Iterator[tuple[int, int]]:
    """(start, size) of entries that follow one another, from a place on."""
    for _, row in groupby(enumerate(sorted(entries)), key=lambda each: each[1] - each[0]):
        own = [entry for _, entry in row]
        yield at + own[0], len(own)


def _symbols(column: ca.SX) -> list[Any]:
    symbols: list[Any] = column.nonzeros()
    return symbols
