"""From a crowd to what is compiled, and to what the driver walks.

Values and adjoints are walked apart. Where adjoints follow, the work of a member is laid out by the loops, and the
tapes of its calls come after it. For values alone words are used again. An entry of a call is the number of its
function, then places: the driver gives a call the work of its member as the whole memory.

Actions under one guard follow one another as a run. Where the members of a loop do not depend on one another, a run is
done for all of them before the next one, and the calls of one scene that are worth it are done for several members at
once, in the lanes of a vector.
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
from symphys.codegen.neighbours.program import Crowd, MemberCall, MemberLoop, Move, Of, Reference
from symphys.codegen.neighbours.reuse import reused

Words = NDArray[np.int64]
CALLED, CLEARED = 4, 5
"""The store of an action that is a call, or that clears results where a guard has left one out."""
ONE_RUN, APART, IN_TURN, MIXED = range(4)
"""How a loop goes through its runs."""
OUT = 8
"""Added to ``Of`` of a move that goes out."""
WORTH = 2
"""Operations for each word that is read or written, from which on a call is done for several members at once."""


@dataclass(frozen=True)
class Walk:
    """What the driver walks.

    Attributes:
        crowd: with the places of its words.
        work: words of a member of each room, with tapes.
        loops: (loops, 8) room, first run, end, first action of what is done where the section is left out, end, the
            section's word or -1, how runs are gone through (``neighbours.c``), where in turns they stand.
        runs: (runs, 5) first action, end, sieve or -1, word, whether it is done where that is 0.
        turns: of loops whose runs all belong to words of one sieve, by word the run or -1.
        actions: (actions, 11) store, of, offset, room, at, size, entry, entry of the adjoint, entry for several, first
            reference, end; see ``neighbours.c``, where the offset has the place of the room, and a member's words stand
            for the room.
        references: (references, 5) store, of, offset, room, the number of the argument.
        entries: of calls.
        back: of adjoints.
        several: of calls for several members: number, places, then the places.
    """

    crowd: Crowd
    work: tuple[int, ...]
    loops: Words
    runs: Words
    turns: Words
    actions: Words
    references: Words
    entries: Words
    back: Words
    several: Words


@dataclass(frozen=True)
class CrowdPlan:
    """What the compiler and the driver need.

    Attributes:
        functions: the C functions, in the order of their numbers.
        wide: the numbers of those that do several calls at once.
        values: for values alone.
        taped: for values and adjoints.
    """

    functions: tuple[tuple[Graph, Form], ...]
    wide: frozenset[int]
    values: Walk
    taped: Walk


def crowd_plan(crowd: Crowd, alone: bool = False, wide: bool = False) -> CrowdPlan:
    """Of a crowd.

    Args:
        crowd: what to compute.
        alone: for one scene at a time: calls of values read what lies elsewhere where it lies.
        wide: some calls of values are done for several members at once; of one scene alone.
    """
    functions, together = DistinctFunctions(), DistinctFunctions()
    part = with_adjoints(crowd.sample, ["x"], functions, crowd.chains)[0][1]
    planner = _Planner(reused(crowd, alone), part, functions, together if wide else None, taped=False)
    values = planner.walk()
    taped = _Planner(crowd, part, functions, None, taped=True).walk()
    first = len(functions.listed)
    values.several[planner.heads] += first
    numbers = frozenset(range(first, first + len(together.listed)))
    return CrowdPlan((*functions.listed, *together.listed), numbers, values, taped)


class _Planner:
    def __init__(
        self,
        crowd: Crowd,
        part: PlannedPhase,
        functions: DistinctFunctions,
        together: DistinctFunctions | None,
        taped: bool,
    ) -> None:
        self._crowd, self._part, self._functions, self._together = crowd, part, functions, together
        self._taped = taped
        self._work = [room.work for room in crowd.rooms]
        self._runs: list[tuple[int, ...]] = []
        self._turns: list[int] = []
        self._actions: list[tuple[int, ...]] = []
        self._references: list[tuple[int, ...]] = []
        self._entries: list[int] = []
        self._back: list[int] = []
        self._several: list[int] = []
        self.heads: list[int] = []
        """Where in the entries for several members the numbers of functions stand."""

    def walk(self) -> Walk:
        """Loops in order, and entries of their calls."""
        loops = []
        for loop in self._crowd.loops:
            first = len(self._runs)
            apart = _apart(loop)
            for guard, does in groupby(loop.does, key=lambda each: each.guard):
                self._run(list(does), loop.room, apart)
            end, begin = len(self._runs), len(self._actions)
            self._actions += [_moved(move) for move in loop.instead]
            section = NONE if loop.section is None else loop.section
            way, turns = self._way(first, apart)
            loops.append((loop.room, first, end, begin, len(self._actions), section, way, turns))
        lists = loops, self._runs, self._turns, self._actions, self._references, self._entries, self._back, self._several
        return Walk(self._crowd, tuple(self._work), *(np.array(each, np.int64) for each in lists))

    def _run(self, does: Sequence[Move | MemberCall], room: int, apart: bool) -> None:
        """What follows one another under one guard, then what is cleared where that leaves it out."""
        guard, first = does[0].guard, len(self._actions)
        for each in does:
            self._actions.append(_moved(each) if isinstance(each, Move) else self._called(each, room, apart))
        word = (NONE, 0) if guard is None else guard
        self._runs.append((first, len(self._actions), *word, 0))
        first = len(self._actions)
        for at, size in [span for each in does if isinstance(each, MemberCall) for span in each.cleared]:
            self._actions.append((CLEARED, 0, 0, 0, at, size, 0, NONE, NONE, 0, 0))
        if len(self._actions) > first:
            self._runs.append((first, len(self._actions), *word, 1))

    def _way(self, first: int, apart: bool) -> tuple[int, int]:
        """(how the runs from ``first`` on are gone through, where in ``turns`` they stand)."""
        runs = self._runs[first:]
        sieves, words = {run[2] for run in runs}, [run[3] for run in runs]
        if len(runs) == 1 and NONE in sieves and not self._several_in(runs):
            return ONE_RUN, NONE
        if apart and self._together is not None:
            return APART, NONE
        if len(sieves) != 1 or NONE in sieves or words != sorted(set(words)) or any(run[4] for run in runs):
            return MIXED, NONE
        at, (sieve,) = len(self._turns), sieves
        turns = [NONE] * len(self._crowd.sieves[sieve].places)
        for k, word in enumerate(words):
            turns[word] = first + k
        self._turns += turns
        return IN_TURN, at

    def _several_in(self, runs: Sequence[tuple[int, ...]]) -> bool:
        return any(action[8] != NONE for run in runs for action in self._actions[run[0] : run[1]])

    def _size(self, call: MemberCall) -> int:
        function = self._part.calls.calls[call.number].function
        return sum(function.numel_out(k) for k in range(function.n_out()))

    def _called(self, call: MemberCall, room: int, apart: bool) -> tuple[int, ...]:
        part, functions = self._part, self._functions
        function, kind = part.calls.calls[call.number].function, int(part.kind[call.number])
        forward = functions.forward(function)
        entry, back, tape, first = len(self._entries), NONE, list[int](), len(self._references)
        inputs = [0 if isinstance(at, Reference) else at for at in call.inputs]
        for k, at in enumerate(call.inputs):
            if isinstance(at, Reference):
                self._references.append((int(at.store), int(at.of), at.offset, at.room, k))
        if self._taped and kind != NONE:
            adjoint, back = part.kinds[kind], len(self._back)
            pulled = adjoint.graph
            if (pair := functions.taped(forward, adjoint.graph)) is not None:
                tape, forward, pulled = [self._work[room]], pair.forward, pair.adjoint
                self._work[room] += pair.size
            primal = [*inputs, *tape]
            form = Form(primal=len(primal), adds=True, backward=True, clears=True)
            marked = [*_marked(call.outputs, adjoint.outputs), *_marked(inputs, adjoint.inputs)]
            self._back += [functions.number(pulled, form), *primal, *marked]
        form, several = Form(primal=function.n_in(), adds=False), NONE
        number = functions.number(forward, form)
        self._entries += [number, *inputs, *call.outputs, *tape]
        words = self._size(call) + sum(function.numel_in(k) for k in range(function.n_in()))
        if apart and self._together is not None and len(forward.nodes) > WORTH * words:
            several = len(self._several)
            self.heads.append(several)
            places = [*inputs, *call.outputs]
            self._several += [self._together.number(forward, form), len(places), *places]
        size = self._size(call)
        return CALLED, 0, 0, 0, call.outputs[0], size, entry, back, several, first, len(self._references)


def _apart(loop: MemberLoop) -> bool:
    """Whether no member hands anything on to another."""
    return not any(isinstance(each, Move) and each.out and each.of is not Of.OWN for each in loop.does)


def _moved(move: Move) -> tuple[int, ...]:
    of = int(move.of) + OUT * move.out
    return int(move.store), of, move.offset, move.room, move.at, move.size, 0, NONE, NONE, 0, 0


def _marked(places: Sequence[int], mask: Sequence[bool]) -> Iterator[int]:
    return (at for at, on in zip(places, mask, strict=True) if on)


