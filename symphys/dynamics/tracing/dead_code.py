"""Dead-code elimination: traced calls without the results, and the entries of results, that no later call uses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.tracing.recording import TracedCall, TracedVector
from symphys.types import Expr

Words = int
"""Places in a slot, as bits."""


def without_dead_code(calls: Sequence[TracedCall]) -> tuple[TracedCall, ...]:
    """The calls with the same named results; other vectors hold only the entries that are used."""
    return _Trimming(calls).calls()


class _Trimming:
    """The entries of each vector that are used, and the functions that are left."""

    def __init__(self, calls: Sequence[TracedCall]) -> None:
        self._calls = calls
        self._used: dict[int, Words] = {}
        self._needs: dict[tuple[int, tuple[Words, ...]], tuple[Words, ...]] = {}
        self._functions: dict[Any, ca.Function] = {}
        self._vectors: dict[int, TracedVector] = {}
        self._needed_by_call: list[tuple[Words, ...]] = []
        used = self._used
        for call in reversed(calls):
            for slot in call.outputs:
                used[slot.number] = (1 << slot.size) - 1 if slot.name else used.get(slot.number, 0)
            needed = self._needed(call, tuple([used[slot.number] for slot in call.outputs]))
            for slot, words in zip(call.inputs, needed, strict=True):
                used[slot.number] = used.get(slot.number, 0) | words
            self._needed_by_call.append(needed)
        for slot in (slot for call in calls for slot in call.inputs if slot.name):
            used[slot.number] = (1 << slot.size) - 1

    def calls(self) -> tuple[TracedCall, ...]:
        """Return the calls of which some result is read."""
        found, used = list[TracedCall](), self._used
        for call, needed in zip(self._calls, reversed(self._needed_by_call), strict=True):
            given = tuple([used[slot.number] for slot in call.outputs])
            if any(given):
                found.append(self._trimmed(call, needed, given))
        return tuple(found)

    def _needed(self, call: TracedCall, kept: tuple[Words, ...]) -> tuple[Words, ...]:
        """The words of its inputs that a call needs for what is read of it."""
        key = id(call.function), kept
        if key not in self._needs:
            symbols: list[Expr] = [ca.SX.sym("a", slot.size) for slot in call.inputs]
            found = _symbols_of(_results(call.function, symbols, kept))
            self._needs[key] = tuple(
                sum(1 << k for k, entry in enumerate(column.nonzeros()) if entry.element_hash() in found)
                for column in symbols
            )
        return self._needs[key]

    def _trimmed(self, call: TracedCall, needed: Sequence[Words], given: tuple[Words, ...]) -> TracedCall:
        closer, known = self._closer, self._vectors
        inputs = [
            known.get(slot.number) or closer(slot) for slot, words in zip(call.inputs, needed, strict=True) if words
        ]
        outputs = [closer(slot) for slot, words in zip(call.outputs, given, strict=True) if words]
        return TracedCall(self._function(call, needed, given), tuple(inputs), tuple(outputs))

    def _closer(self, slot: TracedVector) -> TracedVector:
        found = self._vectors.get(slot.number)
        if found is None:
            size = self._used[slot.number].bit_count()
            found = slot if slot.name or size == slot.size else TracedVector(slot.name, size, slot.number)
            self._vectors[slot.number] = found
        return found

    def _function(self, call: TracedCall, needs: Sequence[Words], given: tuple[Words, ...]) -> ca.Function:
        """The function from what is kept of the inputs to what is kept of the outputs."""
        used = self._used
        kept = tuple([used[slot.number] for slot in call.inputs])
        key = id(call.function), kept, given
        if key not in self._functions:
            symbols, columns = [], []
            for slot, words, needed in zip(call.inputs, kept, needs, strict=True):
                column = ca.SX(slot.size, 1)
                if needed:
                    symbols.append(ca.SX.sym("a", words.bit_count()))
                    column[_places(words)] = symbols[-1]
                columns.append(ca.densify(column))
            results = [result for result in _results(call.function, columns, given) if result.numel()]
            self._functions[key] = ca.Function("piece", symbols, results)
        return self._functions[key]


def _places(words: Words) -> list[int]:
    return [k for k in range(words.bit_length()) if words >> k & 1]


def _symbols_of(columns: list[Expr]) -> set[int]:
    symbols: list[Expr] = ca.symvar(ca.vertcat(ca.SX(0, 1), *columns))
    return {symbol.element_hash() for symbol in symbols}


def _results(function: ca.Function, arguments: Sequence[Expr], kept: Sequence[Words]) -> list[Expr]:
    """The words that are kept of what a function gives."""
    results = function.call(list(arguments), True, False)
    return [ca.densify(result)[_places(words)] for result, words in zip(results, kept, strict=True)]
