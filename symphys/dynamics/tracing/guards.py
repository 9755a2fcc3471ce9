"""Which calls of a traced step are without effect where a guard is 0, and what stands for their results then.

A guard is a word of the step that is 0 or 1, such as whether a pair of surfaces is near. What it multiplies is 0 with
it, and what is added to that stays as it is. So each call is evaluated with symbols, and with 0 where its arguments are
known to be 0: results that come out as 0, or as one of the arguments, need no computing. A call whose results are all
of that kind, or are used by such calls only, can be left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush
from typing import Any

import casadi as ca

from symphys.dynamics.tracing.recording import TracedCall, TracedVector

Expr = Any
"""casadi SX"""
Known = tuple[bool, ...]
"""For each entry of a vector whether it is known to be 0."""


@dataclass(frozen=True)
class Part:
    """Entries ``start`` and after of a vector; of None: zeros."""

    vector: TracedVector | None
    start: int = 0


@dataclass(frozen=True)
class Guard:
    """When a call may be left out.

    Attributes:
        word: the call is without effect where this is 0: one entry.
        otherwise: for each result what it equals then; None where nothing uses it then.
    """

    word: Part
    otherwise: tuple[Part | None, ...]


def with_guards(
    calls: Sequence[TracedCall], guards: Sequence[TracedVector], sections: Sequence[tuple[TracedVector, int]]
) -> tuple[TracedCall, ...]:
    """The calls, with what leaves them without effect; each section in one piece.

    Args:
        calls: of a step.
        guards: words that each leave out a few calls, here and there. What they depend on comes first.
        sections: words, as entries of vectors, that each leave out many calls that follow one another.
    """
    search = _Search(calls)
    first = search.needed(guards)
    found: dict[int, Guard] = {}
    for word in guards:
        found |= search.left_out(Part(word), first | found.keys())
    order = [k for k in range(len(calls)) if k in first] + [k for k in range(len(calls)) if k not in first]
    apart: dict[int, Guard] = {}
    for vector, entry in sections:
        left = search.left_out(Part(vector, entry), apart.keys())
        arranged = search.in_one_piece(order, left)
        if arranged is not None:
            order, apart = arranged, apart | left
    return tuple(replace(calls[k], guard=found.get(k), section=apart.get(k)) for k in order)


class _Search:
    """Calls by who reads and who writes a vector, and the guards that have been found."""

    def __init__(self, calls: Sequence[TracedCall]) -> None:
        self._calls = calls
        self._readers: dict[TracedVector, list[int]] = {}
        self._writer: dict[TracedVector, int] = {}
        self._evaluated: dict[tuple[int, tuple[Known, ...]], list[list[Any]]] = {}
        for k, call in enumerate(calls):
            self._writer |= dict.fromkeys(call.outputs, k)
            for vector in call.inputs:
                self._readers.setdefault(vector, []).append(k)

    def left_out(self, word: Part, without: Collection[int]) -> dict[int, Guard]:
        """The calls that are without effect where ``word`` is 0, but for those ``without``."""
        assert word.vector is not None
        found = self._simplified(word.vector, word.start)
        left, standing = dict[int, Guard](), {word.vector}
        looked_at = set(found)
        waiting = [-k for k in found]
        heapify(waiting)
        while waiting:
            k = -heappop(waiting)
            otherwise = None if k in without else self._otherwise(k, found.get(k), left.keys(), standing)
            if otherwise is None:
                continue
            left[k] = Guard(word, otherwise)
            standing |= {part.vector for part in otherwise if part is not None and part.vector is not None}
            for vector in self._calls[k].inputs:
                writer = self._writer.get(vector)
                if writer is not None and writer not in looked_at:
                    looked_at.add(writer)
                    heappush(waiting, -writer)
        return left

    def in_one_piece(self, order: Sequence[int], left: Mapping[int, Guard]) -> list[int] | None:
        """The calls in an order in which those of a section follow one another; None if there is none."""
        places = [i for i, k in enumerate(order) if k in left]
        if not places:
            return None
        inside, before, after = list[int](), list[int](), list[int]()
        follows: set[TracedVector] = set()
        within: set[TracedVector] = set()
        for k in order[places[0] : places[-1] + 1]:
            call = self._calls[k]
            if k in left:
                if not follows.isdisjoint(call.inputs):
                    return None
                inside.append(k)
                within.update(call.outputs)
            elif within.isdisjoint(call.inputs) and follows.isdisjoint(call.inputs):
                before.append(k)
            else:
                after.append(k)
                follows.update(call.outputs)
        return [*order[: places[0]], *before, *inside, *after, *order[places[-1] + 1 :]]

    def needed(self, words: Sequence[TracedVector]) -> set[int]:
        """The calls that words depend on."""
        found: set[int] = set()
        waiting = [self._writer[word] for word in words if word in self._writer]
        while waiting:
            k = waiting.pop()
            if k not in found:
                found.add(k)
                waiting += [self._writer[vector] for vector in self._calls[k].inputs if vector in self._writer]
        return found

    def _otherwise(
        self, k: int, found: list[Part | None] | None, left: Collection[int], standing: Collection[TracedVector]
    ) -> tuple[Part | None, ...] | None:
        """What stands for the results of a call; None if one of them is needed and has to be computed.

        ``left`` are the calls that are left out, ``standing`` what stands for their results.
        """
        parts: list[Part | None] = []
        outputs = self._calls[k].outputs
        for vector, part in zip(outputs, found or [None] * len(outputs), strict=True):
            needed = bool(vector.name) or vector in standing or any(reader not in left for reader in self._readers.get(vector, ()))
            if needed and (vector.name or part is None):
                return None
            parts.append(part if needed else None)
        return tuple(parts)

    def _simplified(self, word: TracedVector, start: int) -> dict[int, list[Part | None]]:
        """For each call that reads something known what its results are, as far as they are known; in order."""
        known: dict[TracedVector, Known] = {word: tuple(j == start for j in range(word.size))}
        found: dict[int, list[Part | None]] = {}
        waiting = list(self._readers.get(word, ()))
        heapify(waiting)
        while waiting:
            k = heappop(waiting)
            if k in found:
                continue
            call = self._calls[k]
            zeros = tuple(known.get(vector, (False,) * vector.size) for vector in call.inputs)
            found[k] = []
            for vector, entries in zip(call.outputs, self._results(call.function, zeros), strict=True):
                found[k].append(_part(entries, call.inputs))
                if any(entry == 0 for entry in entries):
                    known[vector] = tuple(entry == 0 for entry in entries)
                    for reader in self._readers.get(vector, ()):
                        heappush(waiting, reader)
        return found

    def _results(self, function: ca.Function, zeros: tuple[Known, ...]) -> list[list[Any]]:
        """The entries of each result: 0, or (argument, entry) that it equals, or None."""
        key = function.__hash__(), zeros
        if key not in self._evaluated:
            symbols = [ca.SX.sym("a", len(known)) for known in zeros]
            homes = {e.element_hash(): (i, j) for i, column in enumerate(symbols) for j, e in enumerate(column.nonzeros())}
            arguments = []
            for column, known in zip(symbols, zeros, strict=True):
                entries = [ca.SX(0) if zero else e for zero, e in zip(known, column.nonzeros(), strict=True)]
                arguments.append(ca.vertcat(*entries) if entries else column)
            results = function.call([ca.densify(each) for each in arguments])
            self._evaluated[key] = [[_entry(e, homes) for e in ca.densify(result).nonzeros()] for result in results]
        return self._evaluated[key]


def _entry(expression: Expr, homes: dict[int, tuple[int, int]]) -> Any:
    if expression.is_constant():
        return 0 if float(expression) == 0 else None
    return homes.get(expression.element_hash())


def _part(entries: Sequence[Any], inputs: Sequence[TracedVector]) -> Part | None:
    """What a result equals: zeros, or neighbouring entries of one argument; None if it has to be computed."""
    if all(entry == 0 for entry in entries):
        return Part(None)
    if any(entry is None or entry == 0 for entry in entries):
        return None
    (argument, start), *_ = entries
    if any(entry != (argument, start + j) for j, entry in enumerate(entries)):
        return None
    return Part(inputs[argument], start)
