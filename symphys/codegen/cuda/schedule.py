"""Which calls of a phase run side by side: levels of calls that meet in no word that one of them writes.

The calls of a robot's step form a graph: legs do not touch each other, nor do contacts of different bodies. A block of
the device has several warps, each with a thread for every robot of the block; a warp takes its share of a level, then
all wait. Every word sees its calls in the order of the program, so that numbers do not depend on the count of warps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.plan import Plan
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.library import TABLES

Words = NDArray[np.int64]
LOOPED = ("body", "again", "back_body")
"""Phases of every step."""
CALL = 40
"""What a call costs besides its operations, in operations: a jump, its table entry."""


@dataclass(frozen=True)
class Schedule:
    """A phase for a number of warps.

    Attributes:
        spans: (levels, warps, 2) for each warp where its calls begin among ``entries``, and how many they are.
        entries: of the calls: number, length, then offset and stride of each place.
        work, longest: operations of all calls, and of the warps that the others wait for, one level after the other.
        words: that are read and written.
    """

    spans: Words
    entries: Words
    work: int
    longest: int
    words: int


@dataclass(frozen=True)
class _Call:
    """What a call touches at step 0, and where it goes from there."""

    entry: Words
    cost: int
    reads: Words
    writes: Words
    places: tuple[tuple[int, int, int], ...]
    """(offset, stride, size)"""


def schedules(planned: Plan, program: Program, warps: int) -> dict[str, Schedule]:
    """Of all phases of a planned program."""
    return {
        phase: _schedule(list(_calls(planned, program.size, phase)), 2 * program.size + planned.tape, steps, warps)
        for phase, steps in {name: program.steps if name in LOOPED else 1 for name in TABLES}.items()
    }


def _schedule(calls: Sequence[_Call], memory: int, steps: int, warps: int) -> Schedule:
    levels = _levels(calls, memory, steps)
    shares = [_shared(level, warps) for level in levels]
    spans, entries, start = [], [], 0
    for share in shares:
        for own in share:
            spans.append((start, len(own)))
            entries += [call.entry for call in own]
            start += sum(len(call.entry) for call in own)
    return Schedule(
        spans=np.array(spans, np.int64).reshape(len(levels), warps, 2),
        entries=np.concatenate(entries) if entries else np.zeros(0, np.int64),
        work=sum(call.cost for call in calls),
        longest=sum(max(sum(call.cost for call in own) for own in share) for share in shares),
        words=sum(len(call.reads) + len(call.writes) for call in calls),
    )


def _calls(planned: Plan, size: int, phase: str) -> Iterator[_Call]:
    count, table = planned.tables[phase]
    costs = {}
    at = 0
    for _ in range(count):
        number, length = int(table[at]), int(table[at + 1])
        graph, form = planned.functions[number]
        pairs = table[at + 2 : at + length].reshape(-1, 2).tolist()
        sizes = [*graph.sizes, *map(len, graph.results)]
        arguments, far = len(graph.sizes), size + planned.tape
        places = []
        for i, ((offset, stride), words) in enumerate(zip(pairs, sizes, strict=True)):
            backward = form.backward if i >= arguments else i >= form.primal
            places.append((offset + far * backward, stride, words))
        covered = [np.arange(offset, offset + words) for offset, _, words in places]
        cleared = covered[form.primal : arguments] if form.clears else []
        if number not in costs:
            costs[number] = CALL + sum(graph.nodes[x].op not in ("const", "input") for x in graph.needed())
        yield _Call(
            entry=table[at : at + length],
            cost=costs[number],
            reads=_joined([*covered[:arguments], *(covered[arguments:] if form.adds else [])]),
            writes=_joined([*covered[arguments:], *cleared]),
            places=tuple(places),
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
    """The calls of a level among warps, the dearest first, each to the one with the least so far."""
    shares: list[list[_Call]] = [[] for _ in range(warps)]
    loads = [0] * warps
    for call in sorted(level, key=lambda call: -call.cost):
        least = loads.index(min(loads))
        shares[least].append(call)
        loads[least] += call.cost
    return shares


def _joined(parts: Sequence[Words]) -> Words:
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)
