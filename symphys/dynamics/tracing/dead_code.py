"""Dead-code elimination: traced calls without the results, and the entries of results, that no later call uses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.tracing.recording import TracedCall, TracedVector

Expr = Any
"""casadi SX"""
Words = tuple[int, ...]
"""Places in a slot, in order."""


def without_dead_code(calls: Sequence[TracedCall]) -> tuple[TracedCall, ...]:
    """The calls with the same named results; other vectors hold only the entries that are used."""
    return _Trimming(calls).calls()


class _Trimming:
    """The entries of each vector that are used, and the functions that are left."""

    def __init__(self, calls: Sequence[TracedCall]) -> None:
        self._calls = calls
        self._read: dict[int, set[int]] = {}
        self._kept: dict[int, Words] = {}
        self._needs: dict[tuple[int, tuple[Words, ...]], list[set[int]]] = {}
        self._functions: dict[Any, ca.Function] = {}
        self._vectors: dict[int, TracedVector] = {}
        needed = []
        for call in reversed(calls):
            kept = tuple(map(self._used, call.outputs))
            needed.append(self._needed(call, kept))
            for slot, words in zip(call.inputs, needed[-1], strict=True):
                if words:
                    self._read.setdefault(slot.number, set()).update(words)
        self._needed_by_call = needed[::-1]

    def calls(self) -> tuple[TracedCall, ...]:
        """Those of which something is read."""
        return tuple(
            self._trimmed(call, needed)
            for call, needed in zip(self._calls, self._needed_by_call, strict=True)
            if any(map(self._used, call.outputs))
        )

    def _used(self, slot: TracedVector) -> Words:
        """The words of a slot that are kept; what reads it has been looked at."""
        if slot.number not in self._kept:
            words = range(slot.size) if slot.name else sorted(self._read.get(slot.number, ()))
            self._kept[slot.number] = tuple(words)
        return self._kept[slot.number]

    def _needed(self, call: TracedCall, kept: tuple[Words, ...]) -> list[set[int]]:
        """The words of its inputs that a call needs for what is read of it."""
        key = call.function.__hash__(), kept
        if key not in self._needs:
            symbols: list[Expr] = [ca.SX.sym("a", slot.size) for slot in call.inputs]
            found = _symbols_of(_results(call.function, symbols, kept))
            self._needs[key] = [
                {k for k, entry in enumerate(column.nonzeros()) if entry.element_hash() in found} for column in symbols
            ]
        return self._needs[key]

    def _trimmed(self, call: TracedCall, needed: Sequence[set[int]]) -> TracedCall:
        inputs = tuple(self._closer(slot) for slot, words in zip(call.inputs, needed, strict=True) if words)
        outputs = tuple(self._closer(slot) for slot in call.outputs if self._used(slot))
        return TracedCall(self._function(call, needed), inputs, outputs)

    def _closer(self, slot: TracedVector) -> TracedVector:
        if slot.number not in self._vectors:
            self._vectors[slot.number] = slot if slot.name else replace(slot, size=len(self._used(slot)))
        return self._vectors[slot.number]

    def _function(self, call: TracedCall, needs: Sequence[set[int]]) -> ca.Function:
        """The function from what is kept of the inputs to what is kept of the outputs."""
        kept, given = tuple(map(self._used, call.inputs)), tuple(map(self._used, call.outputs))
        key = call.function.__hash__(), kept, given
        if key not in self._functions:
            symbols, columns = [], []
            for slot, words, needed in zip(call.inputs, kept, needs, strict=True):
                column = ca.SX(slot.size, 1)
                if needed:
                    symbols.append(ca.SX.sym("a", len(words)))
                    column[list(words)] = symbols[-1]
                columns.append(ca.densify(column))
            results = [result for result in _results(call.function, columns, given) if result.numel()]
            self._functions[key] = ca.Function("piece", symbols, results)
        return self._functions[key]


def _symbols_of(columns: list[Expr]) -> set[int]:
    symbols: list[Expr] = ca.symvar(ca.vertcat(ca.SX(0, 1), *columns))
    return {symbol.element_hash() for symbol in symbols}


def _results(function: ca.Function, arguments: Sequence[Expr], kept: Sequence[Words]) -> list[Expr]:
    """The words that are kept of what a function gives."""
    results = function.call(list(arguments), True, False)
    return [ca.densify(result)[list(words)] for result, words in zip(results, kept, strict=True)]
