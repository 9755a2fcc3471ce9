"""Guards: the calls of a traced step without effect where a guard is 0, and substitutes of their results.

A guard is a word of the step that is 0 or 1, such as whether a pair of surfaces is near. What it multiplies is 0 with
it, and what is added to that stays as it is. So each call is evaluated with symbols, and with 0 where its arguments are
known to be 0: results that come out as 0, or as one of the arguments, need no computing. A call whose results are all
of that kind, or are used by such calls only, can be left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.tracing.recording import TracedCall, TracedVector
from symphys.records import dataclass
from symphys.types import Expr

MAX_EXAMINED_ARGUMENTS = 80
"""Arguments of a call that is not looked into: it puts together what many bodies or pairs have."""
Known = int
"""Entries of a vector that are known to be 0, as bits."""
Pattern = tuple[Known, ...]
"""Known zeros of each argument of a call."""


class Part(NamedTuple):
    """Entries ``start`` and after of a vector; of None: zeros."""

    vector: TracedVector | None
    start: int = 0


class Guard(NamedTuple):
    """The condition under which a call may be skipped.

    Attributes:
        word: the call is without effect where this is 0: one entry.
        otherwise: for each result what it equals then; None where nothing uses it then.
    """

    word: Part
    otherwise: tuple[Part | None, ...]


@dataclass(frozen=True)
class _Substitute:
    """Entries ``start`` and after of an argument, by its number; of None: zeros."""

    argument: int | None
    start: int = 0

    def of(self, inputs: Sequence[TracedVector]) -> Part:
        """Return what the results of a call equal, as parts of its vectors."""
        return Part(None if self.argument is None else inputs[self.argument], self.start)


Simplified = tuple[_Substitute | None, Known]
"""The substitute of a result, and its known zeros."""


def with_guards(
    calls: Sequence[TracedCall],
    guards: Sequence[TracedVector],
    sections: Sequence[tuple[TracedVector, int]],
) -> tuple[TracedCall, ...]:
    """Return the calls, with what leaves them without effect; each section in one piece.

    Args:
        calls: of a step.
        guards: words that each leave out a few calls, here and there. What they depend on comes first.
        sections: words, as entries of vectors, that each leave out many calls that follow one another.
    """
    search = _GuardSearch(calls)
    first, found = search.dependencies(guards), dict[int, Guard]()
    for word in guards:
        found |= search.skippable(Part(word), first | found.keys())
    order = sorted(range(len(calls)), key=lambda k: k not in first)
    apart: dict[int, Guard] = {}
    for vector, entry in sections:
        left = search.skippable(Part(vector, entry), apart.keys())
        arranged = search.consecutive(order, left)
        if arranged is not None:
            order, apart = arranged, apart | left
    return tuple([calls[k]._replace(guard=found.get(k), section=apart.get(k)) for k in order])


class _GuardSearch:
    """Calls by who reads and who writes a vector, and the guards that have been found."""

    def __init__(self, calls: Sequence[TracedCall]) -> None:
        self._calls = calls
        self._readers: dict[int, list[int]] = {}
        self._writer: dict[int, int] = {}
        self._evaluated: dict[tuple[int, Pattern], list[Simplified]] = {}
        self._ignored: dict[tuple[int, Pattern], _IgnoredArguments] = {}
        self._zeros: dict[int, Pattern] = {}
        for k, call in enumerate(calls):
            for vector in call.outputs:
                self._writer[vector.number] = k
            for vector in call.inputs:
                self._readers.setdefault(vector.number, []).append(k)

    def skippable(self, word: Part, without: Collection[int]) -> dict[int, Guard]:
        """Return the calls that are without effect where ``word`` is 0, but for those ``without``."""
        assert word.vector is not None
        found = self._simplified(word.vector, word.start)
        left, substitute_vectors = dict[int, Guard](), {word.vector.number}
        looked_at = set(found)
        waiting = [-k for k in found]
        heapify(waiting)
        while waiting:
            k = -heappop(waiting)
            otherwise = None if k in without else self._otherwise(k, found, left, substitute_vectors)
            if otherwise is None:
                continue
            left[k] = Guard(word, otherwise)
            for part in otherwise:
                if part is not None and part.vector is not None:
                    substitute_vectors.add(part.vector.number)
            for vector in self._calls[k].inputs:
                writer = self._writer.get(vector.number)
                if writer is not None and writer not in looked_at:
                    looked_at.add(writer)
                    heappush(waiting, -writer)
        return left

    def consecutive(self, order: Sequence[int], left: Mapping[int, Guard]) -> list[int] | None:
        """Return the calls in an order in which those of a section follow one another; None if there is none."""
        places = [i for i, k in enumerate(order) if k in left]
        if not places:
            return None
        inside, before, after = list[int](), list[int](), list[int]()
        follows, within = set[int](), set[int]()
        for k in order[places[0] : places[-1] + 1]:
            reads = [vector.number for vector in self._calls[k].inputs]
            writes = [vector.number for vector in self._calls[k].outputs]
            if k in left:
                if not follows.isdisjoint(reads):
                    return None
                inside.append(k)
                within.update(writes)
            elif within.isdisjoint(reads) and follows.isdisjoint(reads):
                before.append(k)
            else:
                after.append(k)
                follows.update(writes)
        return [*order[: places[0]], *before, *inside, *after, *order[places[-1] + 1 :]]

    def dependencies(self, words: Sequence[TracedVector]) -> set[int]:
        """Return the calls that words depend on."""
        found: set[int] = set()
        waiting = [self._writer[word.number] for word in words if word.number in self._writer]
        while waiting:
            k = waiting.pop()
            if k not in found:
                found.add(k)
                inputs = (vector.number for vector in self._calls[k].inputs)
                waiting += [self._writer[number] for number in inputs if number in self._writer]
        return found

    def _otherwise(
        self,
        k: int,
        found: Mapping[int, Sequence[Simplified]],
        left: Collection[int],
        substitute_vectors: Collection[int],
    ) -> tuple[Part | None, ...] | None:
        """Return the substitutes of the results of a call; None if a needed result must be computed.

        ``left`` are skipped calls, ``substitute_vectors`` what replaces their results.
        """
        parts: list[Part | None] = []
        call, results = self._calls[k], found.get(k)
        for i, vector in enumerate(call.outputs):
            needed, read = bool(vector.name) or vector.number in substitute_vectors, False
            for reader in () if needed else self._readers.get(vector.number, ()):
                if reader not in left:
                    read = True
                    if not self._ignores(reader, vector.number, found):
                        needed = True
                        break
            same = results[i][0] if needed and results is not None else None
            if needed and (vector.name or same is None):
                return None
            if read and not needed:
                same = _Substitute(None)  # any number would do
            parts.append(None if same is None else same.of(call.inputs))
        return tuple(parts)

    def _ignores(self, k: int, number: int, found: Mapping[int, Sequence[Simplified]]) -> bool:
        """Whether the results of a call are the same whatever is in a vector that it reads, and with zeros there."""
        if k not in found:
            return False
        call = self._calls[k]
        if call.outputs[0].name or len(call.inputs) > MAX_EXAMINED_ARGUMENTS:
            return False
        key = id(call.function), self._zeros[k]
        if key not in self._ignored:
            self._ignored[key] = _IgnoredArguments(call.function, self._zeros[k])
        return all(self._ignored[key][i] for i, vector in enumerate(call.inputs) if vector.number == number)

    def _simplified(self, word: TracedVector, start: int) -> dict[int, list[Simplified]]:
        """Return for each call with known arguments what is known of its results, in order."""
        known: dict[int, Known] = {word.number: 1 << start}
        found: dict[int, list[Simplified]] = {}
        self._zeros = {}
        waiting = list(self._readers.get(word.number, ()))
        heapify(waiting)
        while waiting:
            k = heappop(waiting)
            if k in found:
                continue
            call = self._calls[k]
            self._zeros[k] = zeros = tuple([known.get(vector.number, 0) for vector in call.inputs])
            found[k] = results = self._results(call, zeros)
            for vector, (_, zero) in zip(call.outputs, results, strict=True):
                if zero:
                    known[vector.number] = zero
                    for reader in self._readers.get(vector.number, ()):
                        heappush(waiting, reader)
        return found

    def _results(self, call: TracedCall, zeros: Pattern) -> list[Simplified]:
        """Return what is known of each result; nothing if it is needed anyway, or few of many arguments are known."""
        function = call.function
        if call.outputs[0].name or len(zeros) > max(MAX_EXAMINED_ARGUMENTS, 2 * sum(map(bool, zeros))):
            return [(None, 0)] * len(call.outputs)
        key = id(function), zeros
        if key not in self._evaluated:
            homes, results = _with_zeros(function, zeros)
            found = list[Simplified]()
            for result in results:
                same = [_entry(e, homes) for e in ca.densify(result).nonzeros()]
                found.append((_part(same), sum(1 << j for j, entry in enumerate(same) if entry == 0)))
            self._evaluated[key] = found
        return self._evaluated[key]


def _with_zeros(function: ca.Function, zeros: Pattern) -> tuple[dict[int, tuple[int, int]], list[Expr]]:
    """Map hashes of symbols to (argument, entry), and return the results of these symbols and zeros."""
    homes, arguments = dict[int, tuple[int, int]](), list[Expr]()
    for i, known in enumerate(zeros):
        entries: list[Expr] = ca.SX.sym("a", function.numel_in(i)).nonzeros()
        homes |= {e.element_hash(): (i, j) for j, e in enumerate(entries)}
        if known:
            entries = [ca.SX(0) if known >> j & 1 else e for j, e in enumerate(entries)]
        arguments.append(ca.densify(ca.vertcat(ca.SX(0, 1), *entries)))
    return homes, function.call(arguments)


class _IgnoredArguments:
    """For each argument of a function whether results do not depend on it, and are the same with zeros in its place."""

    def __init__(self, function: ca.Function, zeros: Pattern) -> None:
        """Analyse a function; ``zeros``: known zeros of the arguments."""
        self._function, self._zeros = function, zeros
        homes, results = _with_zeros(function, zeros)
        read: list[Expr] = ca.symvar(ca.vertcat(ca.SX(0, 1), *map(ca.vec, results)))
        self._found: dict[int, bool] = dict.fromkeys((homes[e.element_hash()][0] for e in read), False)

    def __getitem__(self, argument: int) -> bool:
        """Tell whether an argument matters; symbols decide most cases, numbers the others."""
        if argument not in self._found:
            random, given = np.random.default_rng(0), list[NDArray[np.float64]]()
            for i, known in enumerate(self._zeros):
                kept = [not known >> j & 1 for j in range(self._function.numel_in(i))]
                given.append(random.uniform(0.5, 1.5, len(kept)) * kept)
            others = [*given[:argument], 0 * given[argument], *given[argument + 1 :]]
            one, other = (
                np.array(ca.vertcat(*self._function.call(list(map(ca.DM, each))))) for each in (given, others)
            )
            self._found[argument] = np.array_equal(one, other)
        return self._found[argument]


def _entry(expression: Expr, homes: dict[int, tuple[int, int]]) -> Any:
    """Return 0, the (argument, entry) that an expression equals, or None."""
    if expression.is_constant():
        return 0 if float(expression) == 0 else None
    return homes.get(expression.element_hash())


def _part(entries: Sequence[Any]) -> _Substitute | None:
    """Return what a result equals: zeros, or adjacent entries of one argument; None if it must be computed."""
    if all(entry == 0 for entry in entries):
        return _Substitute(None)
    if any(entry is None or entry == 0 for entry in entries):
        return None
    (argument, start), *_ = entries
    if any(entry != (argument, start + j) for j, entry in enumerate(entries)):
        return None
    return _Substitute(argument, start)
