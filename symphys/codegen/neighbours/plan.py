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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.functions import DistinctFunctions
from symphys.codegen.emit.pieces import Form
from symphys.codegen.emit.plan import NONE, PlannedPhase, with_adjoints
from symphys.codegen.graph.graph import Graph
from symphys.codegen.neighbours.program import Crowd, MemberCall, MemberLoop, MemberReference, Move, Of
from symphys.codegen.neighbours.reuse import reused

Words = NDArray[np.int64]
CALLED, CLEARED = 4, 5
"""The store of an action that is a call, or that clears results where a guard has left one out."""
ONE_RUN, APART, IN_TURN, MIXED = range(4)
"""How a loop goes through its runs."""
OUT = 8
"""Added to ``Of`` of a move that goes out."""
WORTH = 6
"""Operations for each word that is read or written, from which on a call is done for several members at once."""


class ActionRun(NamedTuple):
    """Actions from ``first`` to ``end`` under one guard: done where its word is not 0, or where it is, if ``off``."""

    first: int
    end: int
    sieve: int
    word: int
    off: bool = False


class CrowdAction(NamedTuple):
    """A copy or a call; in the driver the offset has the place of the room, and a member's words stand for the room.

    Attributes:
        store: the other one of a copy, or CALLED, or CLEARED.
        of, offset, room: what is copied, as in ``Move``.
        at, size: where in the member's work, and how much.
        entry: of a call.
        back: entry of its adjoint.
        several: entry of the call for several members.
        first, end: its references.
    """

    store: int
    of: int = 0
    offset: int = 0
    room: int = 0
    at: int = 0
    size: int = 0
    entry: int = 0
    back: int = NONE
    several: int = NONE
    first: int = 0
    end: int = 0


@dataclass(frozen=True)
class Walk:
    """What the driver walks.

    Attributes:
        crowd: with the places of its words.
        work: words of a member of each room, with tapes.
        loops: (loops, 8) room, first run, end, first action of what is done where the section is left out, end, the
            section's word or -1, how runs are gone through, where in turns they stand.
        runs: (runs, 5); see ``ActionRun``.
        turns: of loops whose runs all belong to words of one sieve, by word the run or -1.
        actions: (actions, 11); see ``CrowdAction``.
        references: (references, 5) store, of, offset, room, the number of the argument.
        entries: of calls: number of the function, then places.
        back: of adjoints.
        several: of calls for several members: number, how many places, then these.
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


def crowd_plan(crowd: Crowd, several: int = 0) -> CrowdPlan:
    """Of a crowd.

    Args:
        crowd: what to compute.
        several: of one scene alone, how many members a call of values may be done for at once; 0: scenes in lanes.
    """
    functions, together = DistinctFunctions(), DistinctFunctions()
    differs = crowd.taped or crowd
    part = with_adjoints(differs.sample, ["x"], functions, differs.chains)[0][1]
    planner = _Planner(reused(crowd, several > 0), None, functions, together if several > 1 else None)
    values = planner.walk()
    taped = _Planner(differs, part, functions, None).walk()
    first = len(functions.listed)
    values.several[planner.heads] += first
    numbers = frozenset(range(first, first + len(together.listed)))
    return CrowdPlan((*functions.listed, *together.listed), numbers, values, taped)


class _Planner:
    """Goes through the loops of a crowd; ``heads``: where in ``several`` the numbers of functions stand.

    ``part`` has the adjoints; None: of values alone.
    """

    def __init__(
        self,
        crowd: Crowd,
        part: PlannedPhase | None,
        functions: DistinctFunctions,
        together: DistinctFunctions | None,
    ) -> None:
        self._crowd, self._part, self._functions, self._together = crowd, part, functions, together
        self._work = [room.work for room in crowd.rooms]
        self._runs: list[ActionRun] = []
        self._turns: list[int] = []
        self._actions: list[CrowdAction] = []
        self._references: list[tuple[int, ...]] = []
        self._entries: list[int] = []
        self._back: list[int] = []
        self._several: list[int] = []
        self.heads: list[int] = []

    def walk(self) -> Walk:
        """Loops in order, and entries of their calls."""
        loops = []
        for loop in self._crowd.loops:
            first = len(self._runs)
            apart = self._together is not None and _apart(loop)
            for _, does in groupby(loop.does, key=lambda each: each.guard):
                self._run(list(does), loop.room, apart)
            end, begin = len(self._runs), len(self._actions)
            self._actions += [_moved(move) for move in loop.instead]
            section = NONE if loop.section is None else loop.section
            way, turns = self._way(self._runs[first:], first, apart)
            loops.append((loop.room, first, end, begin, len(self._actions), section, way, turns))
        tables = loops, self._runs, self._turns, self._actions, self._references
        calls = self._entries, self._back, self._several
        return Walk(self._crowd, tuple(self._work), *(np.array(each, np.int64) for each in (*tables, *calls)))

    def _run(self, does: Sequence[Move | MemberCall], room: int, apart: bool) -> None:
        """What follows one another under one guard, then what is cleared where that leaves it out."""
        word, first = does[0].guard or (NONE, 0), len(self._actions)
        for each in does:
            self._actions.append(_moved(each) if isinstance(each, Move) else self._called(each, room, apart))
        self._runs.append(ActionRun(first, len(self._actions), *word))
        spans = [span for each in does if isinstance(each, MemberCall) for span in each.cleared]
        if spans:
            first = len(self._actions)
            self._actions += [CrowdAction(CLEARED, at=at, size=size) for at, size in spans]
            self._runs.append(ActionRun(first, len(self._actions), *word, off=True))

    def _way(self, runs: Sequence[ActionRun], first: int, apart: bool) -> tuple[int, int]:
        """(how runs from number ``first`` on are gone through, where in ``turns`` they stand)."""
        sieves, words = {run.sieve for run in runs}, [run.word for run in runs]
        if len(runs) == 1 and NONE in sieves:
            several = any(each.several != NONE for each in self._actions[runs[0].first : runs[0].end])
            return (APART if several else ONE_RUN), NONE
        if apart:
            return APART, NONE
        if len(sieves) != 1 or NONE in sieves or words != sorted(set(words)) or any(run.off for run in runs):
            return MIXED, NONE
        at, (sieve,) = len(self._turns), sieves
        turns = [NONE] * len(self._crowd.sieves[sieve].places)
        for k, word in enumerate(words):
            turns[word] = first + k
        self._turns += turns
        return IN_TURN, at

    def _called(self, call: MemberCall, room: int, apart: bool) -> CrowdAction:
        function = self._crowd.sample.body[call.number].function
        size = sum(function.numel_out(k) for k in range(function.n_out()))
        forward, first = self._functions.forward(function), len(self._references)
        inputs = [0 if isinstance(at, MemberReference) else at for at in call.inputs]
        for k, at in enumerate(call.inputs):
            if isinstance(at, MemberReference):
                self._references.append((int(at.store), int(at.of), at.offset, at.room, k))
        form, places, several = Form(primal=function.n_in(), adds=False), [*inputs, *call.outputs], NONE
        words = size + sum(function.numel_in(k) for k in range(function.n_in()))
        if apart and self._together is not None and len(forward.nodes) > WORTH * words:
            several = len(self._several)
            self.heads.append(several)
            self._several += [self._together.number(forward, form), len(places), *places]
        forward, tape, back = self._pulled(call, forward, inputs, room)
        entry = len(self._entries)
        self._entries += [self._functions.number(forward, form), *places, *tape]
        ends = first, len(self._references)
        return CrowdAction(CALLED, 0, 0, 0, call.outputs[0], size, entry, back, several, *ends)

    def _pulled(
        self, call: MemberCall, forward: Graph, inputs: Sequence[int], room: int
    ) -> tuple[Graph, list[int], int]:
        """(the function with what its adjoint reads, where that lies, the entry of the adjoint)."""
        tape = list[int]()
        if self._part is None or (kind := int(self._part.kind[call.number])) == NONE:
            return forward, tape, NONE
        adjoint, back = self._part.kinds[kind], len(self._back)
        pulled = adjoint.graph
        if (pair := self._functions.taped(forward, adjoint.graph)) is not None:
            tape, forward, pulled = [self._work[room]], pair.forward, pair.adjoint
            self._work[room] += pair.size
        primal = [*inputs, *tape]
        form = Form(primal=len(primal), adds=True, backward=True, clears=True)
        marked = [*_marked(call.outputs, adjoint.outputs), *_marked(inputs, adjoint.inputs)]
        self._back += [self._functions.number(pulled, form), *primal, *marked]
        return forward, tape, back


def _apart(loop: MemberLoop) -> bool:
    """Whether no member hands anything on to another."""
    return not any(isinstance(each, Move) and each.out and each.of is not Of.OWN for each in loop.does)


def _moved(move: Move) -> CrowdAction:
    return CrowdAction(int(move.store), int(move.of) + OUT * move.out, move.offset, move.room, move.at, move.size)


def _marked(places: Sequence[int], mask: Sequence[bool]) -> Iterator[int]:
    return (at for at, on in zip(places, mask, strict=True) if on)
