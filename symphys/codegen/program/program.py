"""A rollout as data: calls of small functions on places of a flat memory, with a loop over time.

A program is checked once, when it is made: sizes, one writer a word, nothing read before it is written. Times in that
check are those of calls: inputs at -1, then prologue, body of each step, epilogue. Scratch (what the body writes
without stride) is new in each step, so its times are those of step 0, and so are the times of what reads it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.errors import ProgramError

Function = Any
"""casadi Function of SX type"""


@dataclass(frozen=True)
class Place:
    """Words ``offset + k stride`` to ``offset + k stride + size`` of the memory, at time step k.

    Outside the body k is 0, so that the stride does not matter there.
    """

    offset: int
    size: int
    stride: int = 0

    def words(self, steps: int) -> NDArray[np.int64]:
        """(steps, size) or, without stride, (1, size): the words that it covers, a row for each step."""
        count = steps if self.stride else 1
        return self.offset + self.stride * np.arange(count)[:, None] + np.arange(self.size)

    def still(self) -> Place:
        """The place at step 0, for calls outside the body."""
        return Place(self.offset, self.size)

    def later(self, steps: int = 1) -> Place:
        """The place that many steps later: with a stride, what the next step finds under its own number."""
        return Place(self.offset + steps * self.stride, self.size, self.stride)


@dataclass(frozen=True)
class FunctionCall:
    """One call of a function.

    Attributes:
        function: SX Function of dense vectors without free symbols; equal functions are compiled once.
        inputs: where its arguments lie.
        outputs: where its results go. They are written, or added to what is there if ``accumulate``.
        guard: a word of scratch; where it is 0 the call may be left out, as it then gives what ``otherwise`` has.
        otherwise: for each result the place that holds the same then; None where no call reads it then.
        section: the same for a run of calls that have one word in common, which are left out together.
        beside: what ``otherwise`` is, for the section.
    """

    function: Function
    inputs: tuple[Place, ...]
    outputs: tuple[Place, ...]
    accumulate: bool = False
    guard: Place | None = None
    otherwise: tuple[Place | None, ...] = ()
    section: Place | None = None
    beside: tuple[Place | None, ...] = ()


@dataclass(frozen=True)
class AdjointDiscount:
    """What adjoints may lose on their way back through time.

    Attributes:
        state: of a step, with a stride: its adjoint is shortened when the adjoint of the step before begins.
        kept: a word of each step, 1 or 0: where it is 0, the adjoint ends. None: it is 1 everywhere.
    """

    state: Place
    kept: Place | None = None


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

    def __post_init__(self) -> None:
        """Check everything that can be checked; ProgramError names the call and the words."""
        if self.steps < 0:
            raise ProgramError(f"steps must be 0 or more, not {self.steps}")
        verify(self)

    @property
    def calls(self) -> tuple[FunctionCall, ...]:
        """All calls, each once."""
        return (*self.prologue, *self.body, *self.epilogue)

    def scratch(self) -> NDArray[np.bool_]:
        """(size,) which words hold for one step of the body only."""
        flags = np.zeros(self.size, dtype=bool)
        for call in self.body:
            for place in call.outputs:
                if not call.accumulate and not place.stride:
                    flags[place.offset : place.offset + place.size] = True
        return flags

    def output_slices(self) -> dict[str, slice]:
        """Where each output lies in the vector of all outputs."""
        slices, start = {}, 0
        for name, place in self.outputs.items():
            slices[name] = slice(start, start + place.size)
            start += place.size
        return slices


Words = NDArray[np.int64]
NEVER = np.iinfo(np.int64).max


class Verification:
    """The state of the check: for each word when it was written last, and whether it is scratch."""

    def __init__(self, program: Program) -> None:
        """Mark the inputs and the zeroed words as written."""
        self.program = program
        self.written = np.full(program.size, NEVER)
        self.scratch = np.zeros(program.size, dtype=bool)
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
        if np.any(self.written[words] != NEVER):
            raise ProgramError(f"{name}: {span(words)} overlap another input or zeroed place")
        self.written[words] = -1

    def inside(self, who: str, words: Words) -> None:
        """Refuse words outside the memory."""
        if words.size and (words.min() < 0 or words.max() >= self.program.size):
            raise ProgramError(f"{who}: {span(words)} lie outside the memory of {self.program.size} words")

    def timed(self) -> Iterator[tuple[str, FunctionCall, int, int]]:
        """Every call with a description, its time at step 0 and the time from one step to the next (0: no body)."""
        program = self.program
        start, length = len(program.prologue), len(program.body)
        end = start + program.steps * length
        for i, call in enumerate(program.prologue):
            yield f"prologue call {i} ({call.function.name()})", call, i, 0
        for i, call in enumerate(program.body):
            yield f"body call {i} ({call.function.name()})", call, start + i, length
        for i, call in enumerate(program.epilogue):
            yield f"epilogue call {i} ({call.function.name()})", call, end + i, 0

    def cover(self, who: str, place: Place, period: int) -> Words:
        """The words of a place, all inside the memory."""
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
            taken = self.written[words] != NEVER
            if taken.any():
                raise ProgramError(f"{who}: {span(words[taken])} are written already")
            self.written[words] = time + period * np.arange(len(words))[:, None]
            self.scratch[words] = period > 0 and place.stride == 0

    def _add(self, who: str, place: Place, words: Words, time: int, period: int) -> None:
        if period and place.stride:
            raise ProgramError(f"{who}: adds to {span(words)} with a stride; write them instead")
        before = self.written[words]
        if np.any(before == NEVER):
            raise ProgramError(f"{who}: adds to {span(words[before == NEVER])}, which nobody wrote or zeroed before")
        if np.any(before == time):
            raise ProgramError(f"{who}: two of its results overlap in {span(words[before == time])}")
        last = time + period * max(self.program.steps - 1, 0)
        self.written[words] = np.where(self.scratch[words], time, np.maximum(last, before))

    def read(self, who: str, call: FunctionCall, time: int, period: int) -> None:
        """Refuse what is read before it is complete."""
        for place in call.inputs:
            words = self.cover(who, place, period)
            when = time + period * np.arange(len(words))[:, None]  # without stride: step 0, the first to read
            self._refuse(who, words, self.written[words] == NEVER, "which nobody writes")
            scratch = self.scratch[words]
            if not period:
                self._refuse(who, words, scratch, "which are scratch of the body")
            late = np.where(scratch, self.written[words] >= time, self.written[words] >= when)
            self._refuse(who, words, late, "before they are complete")

    def _refuse(self, who: str, words: Words, bad: NDArray[np.bool_], why: str) -> None:
        if bad.any():
            raise ProgramError(f"{who}: reads {span(words[bad])}, {why}")


def verify(program: Program) -> Verification:
    """Check a program; ProgramError names the first fault."""
    check = Verification(program)
    calls = list(check.timed())
    for who, call, _, _ in calls:
        _signature(who, call)
    for step in calls:
        check.write(*step)
    for step in calls:
        check.read(*step)
    for name, place in program.outputs.items():
        words = place.still().words(1)
        check.inside(f"output {name}", words)
        check._refuse(f"output {name}", words, check.written[words] == NEVER, "which nobody writes")
        check._refuse(f"output {name}", words, check.scratch[words], "which are scratch of the body")
    for name, discounted in () if program.discounted is None else vars(program.discounted).items():
        if discounted is not None:
            words = discounted.words(program.steps)
            check.inside(f"discounted {name}", words)
            check._refuse(f"discounted {name}", words, check.scratch[words], "which are scratch of the body")
    return check


def _signature(who: str, call: FunctionCall) -> None:
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


def span(words: Words) -> str:
    """Words for a message."""
    return f"words {words.min()} to {words.max()}" if words.size else "no words"
