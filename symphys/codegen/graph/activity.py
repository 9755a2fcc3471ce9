"""Activity analysis: the words that depend on z and that a seeded output depends on.

``Activity`` takes call by call, ``LivenessGraph`` many calls at a time. An argument is active if one of its words is. A
word of a result is active if an argument is that it depends on. Words of places with a stride are active at all steps
or at none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.program.phase_calls import PhaseCalls
from symphys.codegen.program.program import FunctionCall, Place, Program
from symphys.codegen.program.spans import Spans, stretches
from symphys.records import dataclass
from symphys.types import Bools, Ints

Words = slice | NDArray[np.int64]
"""Words of a place at all steps: neighbours, or (steps, size)."""


def words_of(place: Place, steps: int) -> Words:
    """Return the words of a place that is met in so many steps."""
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


@dataclass(frozen=True)
class Lists:
    """A list of numbers for each number: those from ``starts[i]`` to ``starts[i + 1]`` of ``items``."""

    starts: Ints
    items: Ints

    @classmethod
    def inverse(cls, keys: Ints, count: int) -> Lists:
        """Return the positions of each key."""
        ends = np.cumsum(np.bincount(keys, minlength=count))
        return cls(np.concatenate([[0], ends]), np.argsort(keys, kind="stable"))

    @classmethod
    def of(cls, parts: Sequence[Ints]) -> Lists:
        """Concatenate lists."""
        sizes = np.cumsum([0, *map(len, parts)])
        return cls(sizes, np.concatenate([np.zeros(0, np.int64), *parts]))

    def at(self, keys: Ints) -> tuple[Ints, Ints]:
        """Return all lists of some numbers, one after the other, and which number each item is of."""
        first = self.starts[keys]
        counts = self.starts[keys + 1] - first
        return self.items[stretches(first, counts)], np.repeat(np.arange(len(keys)), counts)


@dataclass(frozen=True)
class AnnotatedCalls:
    """Calls with what is known of their functions.

    Attributes:
        calls: of the phase.
        steps: in which they are made.
        dependence: for each function (words of all its results, arguments) which depends on which.
    """

    calls: PhaseCalls
    steps: int
    dependence: Sequence[Bools]


@dataclass(frozen=True)
class _Places:
    offset: Ints
    size: Ints
    stride: Ints
    steps: Ints

    def words(self) -> Lists:
        """Return the words of each, step after step."""
        step = stretches(np.zeros(len(self.steps), np.int64), self.steps)
        first = np.repeat(self.offset, self.steps) + step * np.repeat(self.stride, self.steps)
        starts = np.concatenate([[0], np.cumsum(self.size * self.steps)])
        return Lists(starts, stretches(first, np.repeat(self.size, self.steps)))


class LivenessGraph:
    """The calls of all phases as a graph of words, places and calls."""

    def __init__(self, size: int, phases: Sequence[AnnotatedCalls]) -> None:
        """Build the graph; ``size``: words of memory."""
        inputs = [(phase.calls.inputs, phase.steps) for phase in phases]
        outputs = [(phase.calls.outputs, phase.steps) for phase in phases]
        counts = [len(phase.calls) for phase in phases]
        self._size = size
        self._bounds = np.cumsum([0, *counts]).tolist()
        self._inputs = np.cumsum([0, *(len(spans.offset) for spans, _ in inputs)]).tolist()
        # calls: where their arguments and results begin, and where their functions have what depends on what
        self._call = _renumber([spans.call for spans, _ in inputs], counts)
        self._writer = _renumber([spans.call for spans, _ in outputs], counts)
        self._first_input = _renumber([s.starts[:-1] for s, _ in inputs], [len(s.offset) for s, _ in inputs])
        first_output = _renumber([s.starts[:-1] for s, _ in outputs], [len(s.offset) for s, _ in outputs])
        functions = _renumber([phase.calls.number for phase in phases], [len(phase.dependence) for phase in phases])
        stacked = [each for phase in phases for each in phase.dependence]
        self._of_argument = Lists.of([np.flatnonzero(each[:, i]) for each in stacked for i in range(each.shape[1])])
        self._of_word = Lists.of([np.flatnonzero(row) for each in stacked for row in each])
        self._argument_key = np.cumsum([0, *(each.shape[1] for each in stacked)])[functions]
        self._word_key = np.cumsum([0, *(each.shape[0] for each in stacked)])[functions]
        # arguments: places that many calls read, each once
        self.read, self.place = _distinct(_join_places(inputs))
        self._place_words = self.read.words()
        owner = np.repeat(np.arange(len(self.read.offset)), np.diff(self._place_words.starts))
        by_word = Lists.inverse(self._place_words.items, size)
        self._places_of_word = Lists(by_word.starts, owner[by_word.items])
        self._readers = Lists.inverse(self.place, len(self.read.offset))
        # results: their words have numbers, one after the other
        self._out = _join_places(outputs)
        covered, self._end = self._out.words(), np.cumsum(self._out.size)
        self._before = self._end - self._out.size
        self._within = stretches(np.zeros(len(self._end), np.int64), self._out.size)
        self._before_call = np.append(self._before, self._end[-1:])[first_output]
        lengths = np.diff(covered.starts)
        self._result_of = np.repeat(np.arange(len(lengths)), lengths)
        self._word_at = stretches(np.zeros(len(lengths), np.int64), lengths) % np.repeat(self._out.size, lengths)
        self._writers = Lists.inverse(covered.items, size)

    def forwards(self, words: Ints) -> Bools:
        """Return flags (size,) of these words and of those that depend on them."""
        seen, moving = _MarkedNumbers(self._size), _MarkedNumbers(len(self.read.offset))
        fresh = seen.fresh(words)
        while fresh.size:
            inputs = self._readers.at(moving.fresh(self._places_of_word.at(fresh)[0]))[0]
            calls = self._call[inputs]
            found, which = self._of_argument.at(self._argument_key[calls] + inputs - self._first_input[calls])
            fresh = seen.fresh(self._words(self._before_call[calls][which] + found))
        return seen.flags

    def backwards(self, words: Ints) -> Bools:
        """Return flags (size,) of these words and of those that they depend on."""
        seen, useful = _MarkedNumbers(self._size), _MarkedNumbers(len(self.read.offset))
        fresh = seen.fresh(words)
        while fresh.size:
            slots = self._writers.at(fresh)[0]
            results = self._result_of[slots]
            calls = self._writer[results]
            at = self._before[results] - self._before_call[calls] + self._word_at[slots]
            found, which = self._of_word.at(self._word_key[calls] + at)
            places = useful.fresh(self.place[self._first_input[calls][which] + found])
            fresh = seen.fresh(self._place_words.at(places)[0])
        return seen.flags

    def producers(self, read: Ints, words: Ints, through: Bools, phase: int) -> Bools:
        """Return flags (calls of a phase,) of those that write the words that are read.

        Args:
            read: arguments of the phase, by the numbers of their places.
            words: further words that are read.
            through: (size,) the words that count: others need no call.
            phase: the number of the phase.
        """
        first, last = self._bounds[phase : phase + 2]
        seen, taken, places = (
            _MarkedNumbers(self._size),
            _MarkedNumbers(int(self._bounds[-1])),
            _MarkedNumbers(len(self.read.offset)),
        )
        fresh = np.concatenate([words, self._place_words.at(places.fresh(self.place[self._inputs[phase] + read]))[0]])
        while fresh.size:
            fresh = seen.fresh(fresh[through[fresh]])
            calls = self._writer[self._result_of[self._writers.at(fresh)[0]]]
            calls = taken.fresh(calls[(calls >= first) & (calls < last)])
            begin = self._first_input[calls]
            inputs = stretches(begin, np.append(self._first_input, len(self.place))[calls + 1] - begin)
            fresh = self._place_words.at(places.fresh(self.place[inputs]))[0]
        return taken.flags[first:last]

    def _words(self, numbers: Ints) -> Ints:
        """Return the words of the memory that these words of results are, at all steps."""
        results = np.searchsorted(self._end, numbers, side="right")
        first, stride = self._out.offset[results] + self._within[numbers], self._out.stride[results]
        if not stride.any():
            return first
        steps = self._out.steps[results]
        return np.repeat(first, steps) + stretches(np.zeros(len(first), np.int64), steps) * np.repeat(stride, steps)


class _MarkedNumbers:
    """A set of marked numbers."""

    def __init__(self, count: int) -> None:
        self.flags: Bools = np.zeros(count, bool)
        self._last: Ints = np.zeros(count, np.int64)

    def fresh(self, numbers: Ints) -> Ints:
        """Return the unseen items, each once, and mark them as seen."""
        found: Ints = numbers[~self.flags[numbers]]
        order = np.arange(len(found))
        self._last[found] = order
        found = found[self._last[found] == order]
        self.flags[found] = True
        return found


def _renumber(parts: Sequence[Ints], counts: Sequence[int]) -> Ints:
    """Return numbers of things in several lists, as numbers in all of them together."""
    before = np.cumsum([0, *counts]).tolist()
    return np.concatenate([part + start for part, start in zip(parts, before[:-1], strict=True)])


def _join_places(parts: Sequence[tuple[Spans, int]]) -> _Places:
    """Return the places of all phases; those without stride, or in phases of one step, at one step."""
    offset, size = (np.concatenate([getattr(spans, name) for spans, _ in parts]) for name in ("offset", "size"))
    stride = np.concatenate([spans.stride if steps != 1 else 0 * spans.stride for spans, steps in parts])
    steps = np.concatenate([np.where(spans.stride != 0, steps, 1) for spans, steps in parts])
    return _Places(offset, size, stride, steps)


def _distinct(places: _Places) -> tuple[_Places, Ints]:
    """Return places, each once, and which of them is whose."""
    strides, kind = np.unique(places.stride, return_inverse=True)
    key = (places.offset * (places.size.max(initial=0) + 1) + places.size) * max(len(strides), 1) + kind
    _, first, whose = np.unique(key, return_index=True, return_inverse=True)
    parts = (places.offset, places.size, places.stride, places.steps)
    return _Places(*(each[first] for each in parts)), whose.ravel()
