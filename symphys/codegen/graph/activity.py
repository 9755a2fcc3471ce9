"""Which words matter to a gradient: those that depend on z and that a seeded output depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.program.program import FunctionCall, Place, Program
from symphys.types import Bools

Words = slice | NDArray[np.int64]
"""Of a place at all steps: neighbours, or (steps, size)."""


def words_of(place: Place, steps: int) -> Words:
    """The words of a place that is met in so many steps."""
    if place.stride and steps != 1:
        return place.words(steps)
    return slice(place.offset, place.offset + place.size)


@dataclass
class CallActivity:
    """One call with the words of its places at all steps.

    Attributes:
        call: the call.
        inputs: for each argument its words.
        outputs: for each result its words.
        dependence: for each result (size, arguments): whether a word depends on an argument.
    """

    call: FunctionCall
    inputs: list[Words]
    outputs: list[Words]
    dependence: Sequence[Bools]

    @classmethod
    def of(cls, call: FunctionCall, steps: int, dependence: Sequence[Bools]) -> Self:
        """Find the activity of a call that is made in a number of steps."""
        inputs, outputs = ([words_of(place, steps) for place in places] for places in (call.inputs, call.outputs))
        return cls(call, inputs, outputs, dependence)


class Activity:
    """The words that matter, and with them the calls."""

    def __init__(self, program: Program, phases: Sequence[Sequence[CallActivity]], seeded: Sequence[Place]) -> None:
        """Spread dependence on z forwards and usefulness backwards, over the body until nothing changes."""
        self._depends, self._useful = _Flags(program.size), _Flags(program.size)
        self._patterns: dict[tuple[int, tuple[bool, ...]], list[bytes]] = {}
        self._wanted: dict[tuple[int, int, bytes], list[int]] = {}
        self._depends.set(words_of(program.z, 1))
        for place in seeded:
            self._useful.set(words_of(place, 1))
        prologue, body, epilogue = phases
        for phase in (prologue, body, epilogue):
            while sum(map(self._forward, phase)) and phase is body:
                pass
        for phase in (epilogue, body, prologue):
            while sum(map(self._backward, reversed(phase))) and phase is body:
                pass
        self.active: Bools = self._depends.array & self._useful.array

    def _forward(self, reach: CallActivity) -> bool:
        moving = tuple(map(self._depends.any, reach.inputs))
        key = id(reach.dependence), moving
        patterns = self._patterns.get(key)
        if patterns is None:
            on = np.array(moving, dtype=bool)
            patterns = self._patterns[key] = [matters[:, on].any(axis=1).tobytes() for matters in reach.dependence]
        changed = False
        for words, pattern in zip(reach.outputs, patterns, strict=True):
            changed |= self._depends.add(words, pattern)
        return changed

    def _backward(self, reach: CallActivity) -> bool:
        changed = False
        for k, words in enumerate(reach.outputs):
            wanted = self._useful.columns(words)
            if wanted is None:
                continue
            key = id(reach.dependence), k, wanted
            arguments = self._wanted.get(key)
            if arguments is None:
                rows = reach.dependence[k][np.frombuffer(wanted, bool)]
                arguments = self._wanted[key] = np.flatnonzero(rows.any(axis=0)).tolist()
            for argument in arguments:
                changed |= self._useful.set(reach.inputs[argument])
        return changed

    def marks(self, places: Sequence[Words]) -> tuple[bool, ...]:
        """Return for each place whether any of its words is active."""
        return tuple([bool(self.active[words].any()) for words in places])


class _Flags:
    """A flag for each word, in bytes, which for a few neighbours are faster than arrays."""

    def __init__(self, size: int) -> None:
        self._bytes = bytearray(size)
        self.array: Bools = np.frombuffer(self._bytes, bool)

    def any(self, words: Words) -> bool:
        """Whether one of them is set."""
        if isinstance(words, slice):
            return self._bytes.find(1, words.start, words.stop) >= 0
        return bool(self.array[words].any())

    def columns(self, words: Words) -> bytes | None:
        """Return for each word of a place whether any step sets it; None if no word is set."""
        found = bytes(self._bytes[words]) if isinstance(words, slice) else self.array[words].any(axis=0).tobytes()
        return found if 1 in found else None

    def set(self, words: Words) -> bool:
        """Set all; whether one was not."""
        if isinstance(words, slice):
            fresh = self._bytes.find(0, words.start, words.stop) >= 0
            if fresh:
                self._bytes[words] = b"\1" * (words.stop - words.start)
            return fresh
        fresh = not self.array[words].all()
        self.array[words] = True
        return fresh

    def add(self, words: Words, pattern: bytes) -> bool:
        """Set those of a pattern, at all steps; whether one was not."""
        if isinstance(words, slice):
            before = bytes(self._bytes[words])
            if before == pattern:
                return False
            after = bytes(map(int.__or__, before, pattern))
            self._bytes[words] = after
            return after != before
        new = np.frombuffer(pattern, bool) & ~self.array[words]
        self.array[words] |= new
        return bool(new.any())
