"""A rollout as data: calls of small functions on places of a flat memory, with a loop over time.

A program is checked once, when it is made: sizes, one writer a word, nothing read before it is written. Times in that
check are those of calls: inputs at -1, then prologue, body of each step, epilogue. Scratch (what the body writes
without stride) is new in each step, so its times are those of step 0, and so are the times of what reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.verification import verify

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
