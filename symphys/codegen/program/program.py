"""A rollout as data: calls of small functions on places of a flat memory, with a loop over time.

A program is checked once, when it is made: sizes, one writer a word, nothing read before it is written. Times in that
check are those of calls: inputs at -1, then prologue, body of each step, epilogue. Scratch (what the body writes
without stride) is new in each step, so its times are those of step 0, and so are the times of what reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.calls import AdjointDiscount, Function, FunctionCall, Place
from symphys.codegen.program.phase_calls import PhaseCalls
from symphys.codegen.program.spans import stretches
from symphys.codegen.program.verification import verify

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
        """All calls, each once."""
        return (*self.prologue, *self.body, *self.epilogue)

    @cached_property
    def phases(self) -> tuple[PhaseCalls, PhaseCalls, PhaseCalls]:
        """Prologue, body and epilogue as arrays."""
        return PhaseCalls(self.prologue), PhaseCalls(self.body), PhaseCalls(self.epilogue)

    def scratch(self) -> NDArray[np.bool_]:
        """(size,) which words hold for one step of the body only."""
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
        """Words for a vector."""
        place = Place(self.size, size)
        self.size += size
        return place

    def series(self, size: int, count: int) -> Place:
        """Words for ``count`` vectors one after the other, with the stride that leads from each to the next."""
        place = Place(self.size, size, size)
        self.size += size * count
        return place
