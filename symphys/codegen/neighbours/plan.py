"""From a crowd to what is compiled, and to what the driver walks.

Values and adjoints are walked apart. Where adjoints follow, the work of a member is laid out by the loops, and the
tapes of its calls come after it. For values alone words are used again. Entries of calls have no strides: the driver
gives a call the work of its member as the whole memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.pieces import Form
from symphys.codegen.emit.plan import NONE, PlannedPhase, with_adjoints
from symphys.codegen.graph.graph import Graph
from symphys.codegen.neighbours.program import Crowd, MemberCall, Move
from symphys.codegen.neighbours.reuse import reused

Words = NDArray[np.int64]
CALLED, CLEARED = 4, 5
"""The store of an action that is a call, or that clears results where a guard has left one out."""
OUT = 8
"""Added to ``Of`` of a move that goes out."""


@dataclass(frozen=True)
class Walk:
    """What the driver walks.

    Attributes:
        crowd: with the places of its words.
        work: words of a member of each room, with tapes.
        loops: (loops, 5) room, first action, end, end of what is done where the section is left out, its word or -1.
        actions: (actions, 12) store, of, offset, room, at, size, entry, entry of the adjoint, guard and how many more
            it leaves out, the same backwards; see ``neighbours.c``, where the offset has the place of the room, and a
            member's words stand for the room.
        entries: of calls.
        back: of adjoints.
    """

    crowd: Crowd
    work: tuple[int, ...]
    loops: Words
    actions: Words
    entries: Words
    back: Words


@dataclass(frozen=True)
class CrowdPlan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        values: for values alone.
        taped: for values and adjoints.
    """

    functions: tuple[tuple[Graph, Form], ...]
    values: Walk
    taped: Walk


def crowd_plan(crowd: Crowd) -> CrowdPlan:
    """Of a crowd."""
    functions = DistinctFunctions()
    part = with_adjoints(crowd.sample, ["x"], functions, crowd.chains)[0][1]
    values = _Planner(reused(crowd), part, functions, taped=False).walk()
    taped = _Planner(crowd, part, functions, taped=True).walk()
    return CrowdPlan(tuple(functions.listed), values, taped)


class _Planner:
    def __init__(self, crowd: Crowd, part: PlannedPhase, functions: DistinctFunctions, taped: bool) -> None:
        self._crowd, self._part, self._functions, self._taped = crowd, part, functions, taped
        self._work = [room.work for room in crowd.rooms]
        self._entries: list[int] = []
        self._back: list[int] = []

    def walk(self) -> Walk:
        """Loops in order, and entries of their calls."""
        loops, actions = list[tuple[int, ...]](), list[tuple[int, ...]]()
        for loop in self._crowd.loops:
            first = len(actions)
            for guard, does in groupby(loop.does, key=lambda each: each.guard):
                actions += self._guarded(guard, list(does), loop.room)
            end = len(actions)
            actions += [(*_moved(move), NONE, 0, NONE, 0) for move in loop.instead]
            loops.append((loop.room, first, end, len(actions), NONE if loop.section is None else loop.section))
        lists = (np.array(each, np.int64) for each in (loops, actions, self._entries, self._back))
        return Walk(self._crowd, tuple(self._work), *lists)

    def _guarded(self, guard: int | None, does: Sequence[Move | MemberCall], room: int) -> Iterator[tuple[int, ...]]:
        """What follows one another under one guard: it is looked at once, by the first or backwards by the last."""
        for k, each in enumerate(does):
            at = _moved(each) if isinstance(each, Move) else self._called(each, room)
            ends = k == 0, k == len(does) - 1
            yield (*at, *(x for is_end in ends for x in (guard if is_end and guard is not None else NONE, len(does) - 1)))
        for each in does:
            if guard is not None and isinstance(each, MemberCall) and each.read:
                yield CLEARED, 0, 0, 0, each.outputs[0], self._size(each), 0, NONE, guard, 0, guard, 0

    def _size(self, call: MemberCall) -> int:
        function = self._part.calls.calls[call.number].function
        return sum(function.numel_out(k) for k in range(function.n_out()))

    def _called(self, call: MemberCall, room: int) -> tuple[int, ...]:
        part, functions = self._part, self._functions
        function, kind = part.calls.calls[call.number].function, int(part.kind[call.number])
        forward = functions.forward(function)
        entry, back, tape = len(self._entries), NONE, list[int]()
        if self._taped and kind != NONE:
            adjoint, back = part.kinds[kind], len(self._back)
            pulled = adjoint.graph
            if (pair := functions.taped(forward, adjoint.graph)) is not None:
                tape, forward, pulled = [self._work[room]], pair.forward, pair.adjoint
                self._work[room] += pair.size
            primal = [*call.inputs, *tape]
            form = Form(primal=len(primal), adds=True, backward=True, clears=True)
            marked = [*_marked(call.outputs, adjoint.outputs), *_marked(call.inputs, adjoint.inputs)]
            self._back += _entry(functions.number(pulled, form), [*primal, *marked])
        number = functions.number(forward, Form(primal=function.n_in(), adds=False))
        self._entries += _entry(number, [*call.inputs, *call.outputs, *tape])
        return CALLED, 0, 0, 0, call.outputs[0], self._size(call), entry, back


def _moved(move: Move) -> tuple[int, ...]:
    return int(move.store), int(move.of) + OUT * move.out, move.offset, move.room, move.at, move.size, 0, NONE


def _marked(places: Sequence[int], mask: Sequence[bool]) -> list[int]:
    return [at for at, on in zip(places, mask, strict=True) if on]


def _entry(number: int, places: Sequence[int]) -> list[int]:
    return [number, 2 + 2 * len(places), *(x for at in places for x in (at, 0))]
