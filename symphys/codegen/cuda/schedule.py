"""Which calls of a phase run side by side: levels of calls that meet in no word that one of them writes.

The calls of a robot's step form a graph: legs do not touch each other, nor do contacts of different bodies. A block of
the device has several warps, each with a thread for every robot of the block; a warp takes its share of a level, then
all wait. Every word sees its calls in the order of the program, so that numbers do not depend on the count of warps.

Before calls with a section or a guard stands an entry that leaves them out where that word is 0 for all robots of the
block (``emit/alternatives.py``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from symphys.codegen.emit.alternatives import ALWAYS, Alternatives, Span, entries_of, of_adjoint, of_call, word_of
from symphys.codegen.emit.guarding import TABLES as GUARDED
from symphys.codegen.emit.planned import Plan
from symphys.codegen.program.program import FunctionCall, Program
from symphys.codegen.runtime.library import TABLES
from symphys.types import Ints

LOOPED = ("body", "again", "back_body")
"""Phases of every step."""
CALL_COST = 40
"""What a call costs besides its operations, in operations: a jump, its table entry."""


@dataclass(frozen=True)
class Schedule:
    """A phase for a number of warps.

    Attributes:
        spans: (levels, warps, 2) for each warp where its calls begin and end among ``entries``.
        entries: of the calls: number, length, then offset and stride of each place; see ``entries_of``.
        work, longest: operations of all calls, and of the warps that the others wait for, one level after the other.
        words: that are read and written.
    """

    spans: Ints
    entries: Ints
    work: int
    longest: int
    words: int


@dataclass(frozen=True)
class _Call:
    """What a call touches at step 0, where it goes from there, and when it may be left out."""

    entry: list[int]
    cost: int
    reads: Ints
    writes: Ints
    places: tuple[Span, ...]
    alternatives: Alternatives


def schedules(planned: Plan, program: Program, warps: int) -> dict[str, Schedule]:
    """Schedule all phases of a planned program."""
    return {
        phase: _schedule(list(_calls(planned, program, phase)), 2 * program.size + planned.tape, steps, warps)
        for phase, steps in {name: program.steps if name in LOOPED else 1 for name in TABLES}.items()
    }


def _schedule(calls: Sequence[_Call], memory: int, steps: int, warps: int) -> Schedule:
    levels = _levels(calls, memory, steps)
    shares = [_shared(level, warps) for level in levels]
    spans, entries, start = [], [], 0
    for share in shares:
        for own in share:
            words = _entries(own)
            spans.append((start, start + len(words)))
            entries += words
            start += len(words)
    return Schedule(
        spans=np.array(spans, np.int64).reshape(len(levels), warps, 2),
        entries=np.array(entries, np.int64),
        work=sum(call.cost for call in calls),
        longest=sum(max(sum(call.cost for call in own) for own in share) for share in shares),
        words=sum(len(call.reads) + len(call.writes) for call in calls),
    )


def _entries(calls: Sequence[_Call]) -> list[int]:
    """The entries of a warp's calls of a level; those that are left out together follow one another."""
    together = sorted(calls, key=lambda call: tuple(map(word_of, call.alternatives)))
    return entries_of([(call.entry, call.alternatives) for call in together])


def _calls(planned: Plan, program: Program, phase: str) -> Iterator[_Call]:
    count, table = planned.tables[phase]
    guarded: list[FunctionCall | None] = [None] * count
    if planned.guarding is not None and phase in GUARDED:
        first = planned.guarding.first  # those before compute guards
        guarded = [program.body[k] if k >= first else None for k in planned.guarding.calls_of(phase).tolist()]
    costs = {}
    at, far = 0, program.size + planned.tape
    for call in guarded:
        number, length = int(table[at]), int(table[at + 1])
        graph, form = planned.functions[number]
        pairs = table[at + 2 : at + length].reshape(-1, 2).tolist()
        sizes = [*graph.sizes, *map(len, graph.results)]
        spans = [Span(offset, stride, size) for (offset, stride), size in zip(pairs, sizes, strict=True)]
        own, given = spans[: form.primal], spans[form.primal : len(graph.sizes)]
        results = spans[len(graph.sizes) :]
        alternatives = ALWAYS
        if call is not None:
            alternatives = of_adjoint(call, given, results) if form.backward else of_call(call)
        also = [span for other in alternatives if other is not None for span in other.reads]
        if form.backward:
            given, results = ([span._replace(offset=span.offset + far) for span in each] for each in (given, results))
        if number not in costs:
            costs[number] = CALL_COST + sum(graph.nodes[x].op not in ("const", "input") for x in graph.needed())
        yield _Call(
            entry=table[at : at + length].tolist(),
            cost=costs[number],
            reads=_words([*own, *given, *also, *(results if form.adds else [])]),
            writes=_words([*results, *(given if form.clears else [])]),
            places=(*own, *given, *also, *results),
            alternatives=alternatives,
        )
        at += length


def _levels(calls: Sequence[_Call], words: int, steps: int) -> list[list[_Call]]:
    """Each call as early as the words allow; one by one where places move through time at different speeds."""
    if not _apart(calls, words, steps):
        return [[call] for call in calls]
    written, read = np.zeros(words, np.int64), np.zeros(words, np.int64)
    levels: list[list[_Call]] = []
    for call in calls:
        after = max(
            written[call.reads].max(initial=0), written[call.writes].max(initial=0), read[call.writes].max(initial=0)
        )
        if after == len(levels):
            levels.append([])
        levels[after].append(call)
        written[call.writes] = after + 1
        read[call.reads] = np.maximum(read[call.reads], after + 1)
    return levels


def _apart(calls: Sequence[_Call], words: int, steps: int) -> bool:
    """Whether places of different strides never meet: then those that are apart at step 0 always are."""
    taken = np.full(words, -1, np.int64)
    for offset, stride, size in {place for call in calls for place in call.places} if steps > 1 else ():
        own = np.arange(offset, offset + size) + stride * np.arange(steps)[:, None]
        if ((taken[own] != -1) & (taken[own] != stride)).any():
            return False
        taken[own] = stride
    return True


def _shared(level: Sequence[_Call], warps: int) -> list[list[_Call]]:
    """The calls of a level among warps, each to the one with the least so far: those that always run, dearest first."""
    shares: list[list[_Call]] = [[] for _ in range(warps)]
    loads = [0] * warps
    for call in sorted(level, key=lambda call: (any(call.alternatives), -call.cost)):
        least = loads.index(min(loads))
        shares[least].append(call)
        loads[least] += call.cost
    return shares


def _words(spans: Sequence[Span]) -> Ints:
    """Return the words of these places at step 0, in order."""
    return np.concatenate([np.zeros(0, np.int64), *(np.arange(span.offset, span.offset + span.size) for span in spans)])
