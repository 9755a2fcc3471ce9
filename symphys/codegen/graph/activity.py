"""Which words matter to a gradient: those that depend on z and that a seeded output depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.program.program import FunctionCall, Place, Program

Flags = NDArray[np.bool_]
Words = NDArray[np.int64]


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
    dependence: Sequence[Flags]

    @classmethod
    def of(cls, call: FunctionCall, steps: int, dependence: Sequence[Flags]) -> Self:
        """Of a call that is made in so many steps."""
        inputs, outputs = ([place.words(steps) for place in places] for places in (call.inputs, call.outputs))
        return cls(call, inputs, outputs, dependence)


class Activity:
    """The words that matter, and with them the calls."""

    def __init__(self, program: Program, phases: Sequence[Sequence[CallActivity]], seeded: Sequence[Place]) -> None:
        """Spread dependence on z forwards and usefulness backwards, over the body until nothing changes."""
        self.depends = np.zeros(program.size, dtype=bool)
        self.useful = np.zeros(program.size, dtype=bool)
        self.depends[program.z.still().words(1)] = True
        for place in seeded:
            self.useful[place.still().words(1)] = True
        prologue, body, epilogue = phases
        for phase in (prologue, body, epilogue):
            while sum(self._forward(reach) for reach in phase) and phase is body:
                pass
        for phase in (epilogue, body, prologue):
            while sum(self._backward(reach) for reach in reversed(phase)) and phase is body:
                pass
        self.active = self.depends & self.useful

    def _forward(self, reach: CallActivity) -> bool:
        moving = np.array([self.depends[words].any() for words in reach.inputs], dtype=bool)
        changed = False
        for words, matters in zip(reach.outputs, reach.dependence, strict=True):
            changed |= _raise(self.depends, words, np.asarray(matters[:, moving].any(axis=1)))
        return changed

    def _backward(self, reach: CallActivity) -> bool:
        changed = False
        for words, matters in zip(reach.outputs, reach.dependence, strict=True):
            wanted = self.useful[words].any(axis=0)
            for argument in np.flatnonzero(matters[wanted].any(axis=0)):
                changed |= _raise(self.useful, reach.inputs[argument], np.array(True))
        return changed

    def marks(self, places: Sequence[Words]) -> tuple[bool, ...]:
        """For each place whether any of its words is active."""
        return tuple(bool(self.active[words].any()) for words in places)


def _raise(flags: Flags, words: Words, new: Flags) -> bool:
    fresh = new & ~flags[words]
    if not fresh.any():
        return False
    flags[words] |= new
    return True
