"""From a crowd to what is compiled, and to what the driver walks.

Work of a member is laid out by the loops; the tapes of its calls come after it. Entries of calls have no strides: the
driver gives a call the work of its member as the whole memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.pieces import Form
from symphys.codegen.emit.plan import NONE, with_adjoints
from symphys.codegen.graph.graph import Graph
from symphys.codegen.neighbours.program import Crowd, MemberCall, Move

Words = NDArray[np.int64]
CALLED = 4
"""The store of an action that is a call."""
OUT = 8
"""Added to ``Of`` of a move that goes out."""


@dataclass(frozen=True)
class CrowdPlan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        work: words of a member of each room, with tapes.
        loops: (loops, 5) room, first action, end, end of what is done where the section is left out, its word or -1.
        actions: (actions, 9) store, of, offset, room, at, size, entry, entry of the adjoint, guard; see
            ``neighbours.c``, where the offset has the place of the room, and a member's words stand for the room.
        values, again, back: entries of calls: of values alone, with tapes, adjoints.
    """

    functions: tuple[tuple[Graph, Form], ...]
    work: tuple[int, ...]
    loops: Words
    actions: Words
    values: Words
    again: Words
    back: Words


def crowd_plan(crowd: Crowd) -> CrowdPlan:
    """Of a crowd."""
    return _Planner(crowd).plan()


class _Planner:
    def __init__(self, crowd: Crowd) -> None:
        self._crowd, self._functions = crowd, DistinctFunctions()
        self._part = with_adjoints(crowd.sample, ["x"], self._functions, crowd.chains)[0][1]
        self._work = [room.work for room in crowd.rooms]
        self._values: list[int] = []
        self._again: list[int] = []
        self._back: list[int] = []

    def plan(self) -> CrowdPlan:
        """Loops in order, and entries of their calls."""
        loops, actions = list[tuple[int, ...]](), list[tuple[int, ...]]()
        for loop in self._crowd.loops:
            first = len(actions)
            for does in loop.does:
                actions.append(_moved(does) if isinstance(does, Move) else self._called(does, loop.room))
            end = len(actions)
            actions += [_moved(move) for move in loop.instead]
            loops.append((loop.room, first, end, len(actions), NONE if loop.section is None else loop.section))
        lists = (np.array(each, np.int64) for each in (loops, actions, self._values, self._again, self._back))
        return CrowdPlan(tuple(self._functions.listed), tuple(self._work), *lists)

    def _called(self, call: MemberCall, room: int) -> tuple[int, ...]:
        part, functions = self._part, self._functions
        function, kind = part.calls.calls[call.number].function, int(part.kind[call.number])
        forward, reads = functions.forward(function), Form(primal=function.n_in(), adds=False)
        places, size = [*call.inputs, *call.outputs], sum(map(len, forward.results))
        guard = NONE if call.guard is None else call.guard
        entry = len(self._values)
        self._values += _entry(functions.number(forward, reads), places)
        if kind == NONE:
            self._again += _entry(functions.number(forward, reads), places)
            self._level()
            return CALLED, 0, 0, 0, call.outputs[0], size, entry, NONE, guard
        adjoint = part.kinds[kind]
        pair = functions.taped(forward, adjoint.graph)
        tape = []
        if pair is not None:
            tape = [self._work[room]]
            self._work[room] += pair.size
        self._again += _entry(functions.number(pair.forward if pair else forward, reads), [*places, *tape])
        self._level()
        primal = [*call.inputs, *tape]
        form = Form(primal=len(primal), adds=True, backward=True, clears=True)
        marked = [*_marked(call.outputs, adjoint.outputs), *_marked(call.inputs, adjoint.inputs)]
        back = len(self._back)
        self._back += _entry(functions.number(pair.adjoint if pair else adjoint.graph, form), [*primal, *marked])
        return CALLED, 0, 0, 0, call.outputs[0], size, entry, back, guard

    def _level(self) -> None:
        """Entries of both lists begin at the same places."""
        most = max(len(self._values), len(self._again))
        for each in (self._values, self._again):
            each += [0] * (most - len(each))


def _moved(move: Move) -> tuple[int, ...]:
    guard = NONE if move.guard is None else move.guard
    return int(move.store), int(move.of) + OUT * move.out, move.offset, move.room, move.at, move.size, 0, NONE, guard


def _marked(places: Sequence[int], mask: Sequence[bool]) -> list[int]:
    return [at for at, on in zip(places, mask, strict=True) if on]


def _entry(number: int, places: Sequence[int]) -> list[int]:
    return [number, 2 + 2 * len(places), *(x for at in places for x in (at, 0))]
