"""A rollout as data: calls of small functions on places of a flat memory, with a loop over time.

A program is checked once, when it is made: sizes, one writer a word, nothing read before it is written. Times in that
check are those of calls: inputs at -1, then prologue, body of each step, epilogue. Scratch (what the body writes
without stride) is new in each step, so its times are those of step 0, and so are the times of calls that read it.
The check takes many calls at a time. If some of them are wrong, it takes each by itself and names the first fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.calls import AdjointDiscount, Function, FunctionCall, Place
from symphys.codegen.program.phase_calls import PhaseCalls, rows_of
from symphys.codegen.program.spans import Spans, stretches
from symphys.records import dataclass
from symphys.types import Ints

CHUNK = 4096
"""Calls that are looked at together: more take memory and save nothing."""
__all__ = ["AdjointDiscount", "Function", "FunctionCall", "Place", "Program"]


@dataclass(frozen=True)
class Program:
    """A rollout: ``prologue`` once, ``body`` for steps k = 0 .. steps - 1, ``epilogue`` once.

    Every word has one writer. Words that the body writes without stride are its scratch: they hold for one step, and
    cannot be read by the epilogue. Words that are added to must first be zeroed or written; what the body adds to
    over many steps can be read by the epilogue only.

    Attributes:
        size: words of memory.
        z: the decision vector; what gradients are with respect to.
        parameters: other inputs of a rollout; may be empty.
        steps: number of time steps.
        outputs: named places, read after the epilogue.
        zeroed: places that are 0 at the beginning.
        constants: places and their values. Programs that differ in them only share one compiled kernel.
        discounted: what adjoints may lose on their way back; None: nothing.
        in_order: whether the body stays in its order; otherwise independent calls of one function are put side by side,
            see ``packs``.
    """

    size: int
    z: Place
    parameters: Place
    steps: int
    outputs: Mapping[str, Place]
    prologue: tuple[FunctionCall, ...] = ()
    body: tuple[FunctionCall, ...] = ()
    epilogue: tuple[FunctionCall, ...] = ()
    zeroed: tuple[Place, ...] = ()
    constants: tuple[tuple[Place, tuple[float, ...]], ...] = ()
    discounted: AdjointDiscount | None = None
    in_order: bool = False

    def __post_init__(self) -> None:
        """Check everything that can be checked; ProgramError names the call and the words."""
        if self.steps < 0:
            raise ProgramError(f"steps must be 0 or more, not {self.steps}")
        verify(self)

    @property
    def calls(self) -> tuple[FunctionCall, ...]:
        """Return all calls, each once."""
        return (*self.prologue, *self.body, *self.epilogue)

    @cached_property
    def phases(self) -> tuple[PhaseCalls, PhaseCalls, PhaseCalls]:
        """Return prologue, body and epilogue as arrays."""
        return PhaseCalls(self.prologue), PhaseCalls(self.body), PhaseCalls(self.epilogue)

    def scratch(self) -> NDArray[np.bool_]:
        """Return flags (size,) of the words that hold for one step of the body only."""
        flags, body = np.zeros(self.size, dtype=bool), self.phases[1]
        written = (body.outputs.stride == 0) & ~body.accumulate[body.outputs.call]
        flags[stretches(body.outputs.offset[written], body.outputs.size[written])] = True
        return flags

    def output_slices(self) -> dict[str, slice]:
        """Map each output to its slice of the vector of all outputs."""
        slices, start = {}, 0
        for name, place in self.outputs.items():
            slices[name] = slice(start, start + place.size)
            start += place.size
        return slices


class MemoryLayout:
    """A memory that grows as places are taken from it."""

    def __init__(self) -> None:
        """Begin with no words."""
        self.size = 0

    def take(self, size: int) -> Place:
        """Take words for a vector."""
        place = Place(self.size, size)
        self.size += size
        return place

    def series(self, size: int, count: int) -> Place:
        """Take words for ``count`` vectors in a row, with the stride from each to the next."""
        place = Place(self.size, size, size)
        self.size += size * count
        return place


NEVER_WRITTEN = np.iinfo(np.int64).max


class Verification:
    """The state of the check: for each word when it was written last, and whether it is scratch."""

    def __init__(self, program: Program) -> None:
        """Mark the inputs and the zeroed words as written."""
        self.program = program
        self.written = np.full(program.size, NEVER_WRITTEN)
        self.scratch = np.zeros(program.size, dtype=bool)
        self._seen = np.zeros(program.size, np.int64)
        for name, place in (("z", program.z), ("parameters", program.parameters)):
            self._begin(name, place)
        for place in program.zeroed:
            self._begin("zeroed place", place)
        for place, values in program.constants:
            self._begin("constant", place)
            if len(values) != place.size:
                raise ProgramError(f"constant: {place} has {place.size} words, but there are {len(values)} values")

    def _begin(self, name: str, place: Place) -> None:
        words = place.still().words(1)
        self.inside(name, words)
        if np.any(self.written[words] != NEVER_WRITTEN):
            raise ProgramError(f"{name}: {span(words)} overlap another input or zeroed place")
        self.written[words] = -1

    def inside(self, who: str, words: Ints) -> None:
        """Refuse words outside the memory."""
        if words.size and (words.min() < 0 or words.max() >= self.program.size):
            raise ProgramError(f"{who}: {span(words)} lie outside the memory of {self.program.size} words")

    def phases(self) -> Iterator[_Phase]:
        """Yield prologue, body and epilogue."""
        program = self.program
        start, length = len(program.prologue), len(program.body)
        prologue, body, epilogue = program.phases
        yield _Phase("prologue", prologue, 0, 0)
        yield _Phase("body", body, start, length)
        yield _Phase("epilogue", epilogue, start + program.steps * length, 0)

    def write_all(self, phase: _Phase) -> None:
        """Take note of what the calls of a phase write, many at a time."""
        for first, last in phase.runs():
            if phase.calls[first].accumulate or not self._written_at_once(phase, first, last):
                for k in range(first, last):
                    self.write(phase.who(k), phase.calls[k], phase.start + k, phase.period)

    def _written_at_once(self, phase: _Phase, first: int, last: int) -> bool:
        """Whether calls may write what they write; if so, that is noted."""
        part = phase.outputs.part(first, last)
        words, call, step = part.words(self.program.steps if phase.period else 1)
        if words.size and (words.min() < 0 or words.max() >= self.program.size):
            return False
        order = np.arange(words.size)
        self._seen[words] = order
        if np.any(self.written[words] != NEVER_WRITTEN) or np.any(self._seen[words] != order):
            return False
        self.written[words] = phase.start + call + phase.period * step
        if phase.period:
            self.scratch[words] = np.repeat(part.stride == 0, _words_of(part, self.program.steps))
        return True

    def read_all(self, phase: _Phase) -> None:
        """Refuse what the calls of a phase read before it is complete; many at a time."""
        for first in range(0, len(phase.calls), CHUNK):
            last = min(first + CHUNK, len(phase.calls))
            if not self._read_at_once(phase, first, last):
                for k in range(first, last):
                    self.read(phase.who(k), phase.calls[k], phase.start + k, phase.period)

    def _read_at_once(self, phase: _Phase, first: int, last: int) -> bool:
        """Whether all that calls read is complete."""
        words, call, step = phase.inputs.part(first, last).words(self.program.steps if phase.period else 1)
        if words.size and (words.min() < 0 or words.max() >= self.program.size):
            return False
        written, scratch = self.written[words], self.scratch[words]
        if not phase.period and np.any(scratch):
            return False
        when = phase.start + call + np.where(scratch, 0, phase.period * step)
        return not np.any(written >= when)  # NEVER is later than all

    def cover(self, who: str, place: Place, period: int) -> Ints:
        """Return the words of a place, all inside the memory."""
        words = (place if period else place.still()).words(self.program.steps)
        self.inside(who, words)
        return words

    def write(self, who: str, call: FunctionCall, time: int, period: int) -> None:
        """Take note of what a call writes; refuse second writers."""
        for place in call.outputs:
            words = self.cover(who, place, period)
            if call.accumulate:
                self._add(who, place, words, time, period)
                continue
            if len(np.unique(words)) != words.size:
                raise ProgramError(f"{who}: its steps overwrite each other in {span(words)}")
            taken = self.written[words] != NEVER_WRITTEN
            if taken.any():
                raise ProgramError(f"{who}: {span(words[taken])} are written already")
            self.written[words] = time + period * np.arange(len(words))[:, None]
            self.scratch[words] = period > 0 and place.stride == 0

    def _add(self, who: str, place: Place, words: Ints, time: int, period: int) -> None:
        if period and place.stride:
            raise ProgramError(f"{who}: adds to {span(words)} with a stride; write them instead")
        before = self.written[words]
        if np.any(before == NEVER_WRITTEN):
            raise ProgramError(
                f"{who}: adds to {span(words[before == NEVER_WRITTEN])}, which nobody wrote or zeroed before"
            )
        if np.any(before == time):
            raise ProgramError(f"{who}: two of its results overlap in {span(words[before == time])}")
        last = time + period * max(self.program.steps - 1, 0)
        self.written[words] = np.where(self.scratch[words], time, np.maximum(last, before))

    def read(self, who: str, call: FunctionCall, time: int, period: int) -> None:
        """Refuse what is read before it is complete."""
        for place in call.inputs:
            words = self.cover(who, place, period)
            when = time + period * np.arange(len(words))[:, None]  # without stride: step 0, the first to read
            self._refuse(who, words, self.written[words] == NEVER_WRITTEN, "which nobody writes")
            scratch = self.scratch[words]
            if not period:
                self._refuse(who, words, scratch, "which are scratch of the body")
            late = np.where(scratch, self.written[words] >= time, self.written[words] >= when)
            self._refuse(who, words, late, "before they are complete")

    def _refuse(self, who: str, words: Ints, bad: NDArray[np.bool_], why: str) -> None:
        if bad.any():
            raise ProgramError(f"{who}: reads {span(words[bad])}, {why}")


def verify(program: Program) -> Verification:
    """Check a program; ProgramError names the first fault."""
    check = Verification(program)
    phases = list(check.phases())
    for phase in phases:
        phase.check_sizes()
    for phase in phases:
        check.write_all(phase)
    for phase in phases:
        check.read_all(phase)
    for name, place in program.outputs.items():
        words = place.still().words(1)
        check.inside(f"output {name}", words)
        check._refuse(f"output {name}", words, check.written[words] == NEVER_WRITTEN, "which nobody writes")
        check._refuse(f"output {name}", words, check.scratch[words], "which are scratch of the body")
    for name, discounted in () if program.discounted is None else vars(program.discounted).items():
        if discounted is not None:
            words = discounted.words(program.steps)
            check.inside(f"discounted {name}", words)
            check._refuse(f"discounted {name}", words, check.scratch[words], "which are scratch of the body")
    return check


class _Phase:
    """Calls that follow one another, the time of the first, and that from one step to the next (0: no body)."""

    def __init__(self, name: str, phase: PhaseCalls, start: int, period: int) -> None:
        self.name, self.calls, self.start, self.period = name, phase.calls, start, period
        self.phase, self.inputs, self.outputs = phase, phase.inputs, phase.outputs

    def check_sizes(self) -> None:
        """Refuse calls whose places do not have the sizes of their function; the others of each are like the first."""
        doubtful: list[int] = []
        for number, calls in self.phase.by_function():
            function, unlike = self.phase.functions[number], np.zeros(len(calls), bool)
            arguments = [function.numel_in(i) for i in range(function.n_in())]
            results = [function.numel_out(i) for i in range(function.n_out())]
            for spans, sizes in ((self.inputs, arguments), (self.outputs, results)):
                counts = spans.starts[calls + 1] - spans.starts[calls]
                alike = calls[counts == len(sizes)]
                unlike |= counts != len(sizes)
                unlike[counts == len(sizes)] |= (spans.size[rows_of(spans, alike)] != np.array(sizes)).any(axis=1)
            doubtful += [int(calls[0]), *calls[unlike].tolist()]
        for k in sorted(doubtful):
            _signature(self.who(k), self.calls[k])

    def who(self, k: int) -> str:
        """Return the name of a call for a message."""
        return f"{self.name} call {k} ({self.calls[k].function.name()})"

    def runs(self) -> Iterator[tuple[int, int]]:
        """Yield (first, after the last) of calls that all write, or of one that adds."""
        first = 0
        for k in [*np.flatnonzero(self.phase.accumulate).tolist(), len(self.calls)]:
            yield from ((start, min(start + CHUNK, k)) for start in range(first, k, CHUNK))
            if k < len(self.calls):
                yield k, k + 1
            first = k + 1


def _words_of(part: Spans, steps: int) -> Ints:
    """Return the number of words of each place."""
    return part.size * np.where(part.stride != 0, steps, 1)


def _signature(who: str, call: FunctionCall) -> None:
    """Refuse a call whose places do not have the sizes that its function has."""
    function = call.function
    if not function.is_a("SXFunction"):
        raise ProgramError(f"{who}: is not an SX Function but {function.class_name()}")
    if function.has_free():
        raise ProgramError(f"{who}: has free symbols {function.get_free()}")
    arguments = [function.sparsity_in(i) for i in range(function.n_in())]
    results = [function.sparsity_out(i) for i in range(function.n_out())]
    for what, shapes, places in (("argument", arguments, call.inputs), ("result", results, call.outputs)):
        if len(shapes) != len(places):
            raise ProgramError(f"{who}: has {len(shapes)} {what}s but {len(places)} places")
        for i, (shape, place) in enumerate(zip(shapes, places, strict=True)):
            if not shape.is_dense() or (shape.size2() != 1 and shape.numel() > 0):
                raise ProgramError(f"{who}: {what} {i} is not a dense column but {shape.dim()}")
            if shape.numel() != place.size:
                raise ProgramError(f"{who}: {what} {i} has {shape.numel()} words, its place {place.size}")


def span(words: Ints) -> str:
    """Return the text of words for a message."""
    return f"words {words.min()} to {words.max()}" if words.size else "no words"
