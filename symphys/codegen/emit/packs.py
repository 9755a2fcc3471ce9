"""SLP vectorisation of one rollout: packs of independent isomorphic calls, such as those of four legs.

Isomorphic calls are calls of one function that do not depend on one another. A library of one lane computes a pack of
them in the lanes of a vector. ``pack_calls`` finds the packs and orders the body so that the calls of a pack follow one
another, whatever its lanes: adjoints add up in that order. ``single_lane_plan`` makes the plan of the library: results
of a pack are interleaved, the first word of each lane, then the second of each. So values that one pack passes to
another are loaded and stored as vectors. Other values that a pack reads are broadcast, or gathered from a place for
each lane.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np

from symphys.codegen.emit.guarding import TABLES
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.shapes import BROADCAST, GATHER, GATHER_ALIASED, INTERLEAVED, Access, Shape
from symphys.codegen.program.phase_calls import PhaseCalls
from symphys.codegen.program.program import Program
from symphys.records import dataclass
from symphys.types import Ints

NONE = -1
PACK_SIZES = (4, 2)
"""Calls in a pack, widest first."""
MAX_BODY_CALLS = 5000
"""Bodies of more calls are not searched for packs; that of a robot has a thousand."""


@dataclass(frozen=True)
class PackedProgram:
    """A program in which the calls of a pack follow one another.

    Attributes:
        program: with its body in the new order.
        packs: (first call, calls) of each.
    """

    program: Program
    packs: tuple[tuple[int, int], ...] = ()


def pack_calls(program: Program) -> PackedProgram:
    """Find packs; a body with guards or sections, whose calls must keep their order, stays as it is."""
    body = program.phases[1]
    if (
        program.in_order
        or not 1 < len(body) <= MAX_BODY_CALLS
        or any(call.guard or call.section for call in program.body)
    ):
        return PackedProgram(program)
    before = _dependencies(program, body)
    if before is None:
        return PackedProgram(program)
    found = list(_find_packs(body, before))
    if not found:
        return PackedProgram(program)
    order, packs = _order_with_packs(before, found)
    return PackedProgram(replace(program, body=tuple(program.body[c] for c in order), in_order=True), packs)


def _dependencies(program: Program, body: PhaseCalls) -> list[list[int]] | None:
    """Return the calls that each call depends on; None if places move through time at different strides."""
    # words of one stride each: places of different strides could meet at some step only
    places = [np.stack([spans.offset, spans.size, spans.stride]) for spans in (body.inputs, body.outputs)]
    taken = np.full(program.size, NONE, np.int64)
    for offset, size, stride in np.unique(np.concatenate(places, axis=1), axis=1).T.tolist():
        steps = np.arange(program.steps if stride else 1)
        own = np.arange(offset, offset + size) + stride * steps[:, None]
        if ((taken[own] != NONE) & (taken[own] != stride)).any():
            return None
        taken[own] = stride
    # writer of each word; a word written again depends on the writer before
    words, calls, _ = body.outputs.words()
    turn = np.lexsort((calls, words))
    words, calls = words[turn], calls[turn]
    writer = np.full(program.size, NONE, np.int64)
    writer[words] = calls
    again = words[1:] == words[:-1]
    # edges from writers to readers
    read, reader, _ = body.inputs.words()
    edges = np.stack([np.append(writer[read], calls[:-1][again]), np.append(reader, calls[1:][again])])
    edges = np.unique(edges[:, edges[0] != NONE], axis=1)
    if (edges[0] >= edges[1]).any():
        return None
    before: list[list[int]] = [[] for _ in range(len(body))]
    for first, then in edges.T.tolist():
        before[then].append(first)
    return before


def _find_packs(body: PhaseCalls, before: Sequence[Sequence[int]]) -> Iterator[list[int]]:
    """Yield the calls of each pack, lane by lane."""
    sets = _isomorphic_calls(body, before)
    work = Counter[int]()
    for calls in sets:
        work[len(calls)] += len(calls)
    chain_count = max(work, key=lambda n: work[n], default=0)
    chain = _cluster_chains(sets, before, chain_count, len(body))
    for calls in sets:
        own = {k: [c for c in calls if chain[c] == k] for k in sorted({chain[c] for c in calls})}
        rest = own.pop(NONE, [])
        rounds = max(map(len, own.values()), default=0)
        for r in range(rounds):
            rest_of_round = [mine[r] for mine in own.values() if r < len(mine)]
            yield from _cut_into_packs(rest_of_round)
        yield from _cut_into_packs(rest)


def _cut_into_packs(calls: list[int]) -> Iterator[list[int]]:
    for size in PACK_SIZES:
        while len(calls) >= size:
            yield calls[:size]
            calls = calls[size:]


def _isomorphic_calls(body: PhaseCalls, before: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the sets of two or more calls of one function on the same level; earlier levels first."""
    levels: list[int] = []
    for own in before:
        levels.append(1 + max((levels[c] for c in own), default=0))
    sets: dict[tuple[object, ...], list[int]] = {}
    for c, level in enumerate(levels):
        moves = (
            tuple(spans.stride[spans.starts[c] : spans.starts[c + 1]].tolist()) for spans in (body.inputs, body.outputs)
        )
        sets.setdefault((level, body.number[c], body.accumulate[c], *moves), []).append(c)
    return [sets[key] for key in sorted(sets, key=lambda key: key[0]) if len(sets[key]) > 1]  # type: ignore[arg-type,return-value]


def _cluster_chains(
    sets: Sequence[Sequence[int]], before: Sequence[Sequence[int]], chain_count: int, count: int
) -> list[int]:
    """Assign each call to a chain, -1 for none: the chain of the calls that it reads, or that read it."""
    chain = [NONE] * count
    after: list[list[int]] = [[] for _ in range(count)]
    for c, own in enumerate(before):
        for other in own:
            after[other].append(c)

    def majority_chain(c: int, near: Sequence[Sequence[int]]) -> int:
        counts = Counter(chain[other] for other in near[c] if chain[other] != NONE)
        if not counts:
            return NONE
        first, *others = counts.most_common(2)
        return NONE if others and others[0][1] == first[1] else first[0]

    # sets with a call for each chain: each call stays on the chain of its arguments
    for calls in sets:
        if len(calls) == chain_count:
            chains = [majority_chain(c, before) for c in calls]
            if sorted(chains) != list(range(chain_count)):
                chains = list(range(chain_count))
            for c, k in zip(calls, chains, strict=True):
                chain[c] = k
    # other calls: forward by their arguments, backward by their readers, forward again
    others = [calls for calls in sets if len(calls) != chain_count]
    for near, turn in ((before, others), (after, others[::-1]), (before, others)):
        for calls in turn:
            for c in calls:
                if chain[c] == NONE:
                    chain[c] = majority_chain(c, near)
    return chain


def _order_with_packs(
    before: Sequence[Sequence[int]], found: Sequence[Sequence[int]]
) -> tuple[list[int], tuple[tuple[int, int], ...]]:
    """Return the calls in their order as far as packs allow, and where the packs begin."""
    # each pack is one vertex, at its first call
    whose = list(range(len(before)))
    members = {c: [c] for c in whose}
    for pack in found:
        for c in pack:
            whose[c] = pack[0]
            del members[c]
        members[pack[0]] = list(pack)
    # topological order, earliest calls first
    waits = {head: {whose[other] for c in pack for other in before[c]} for head, pack in members.items()}
    frees: dict[int, list[int]] = {head: [] for head in members}
    for head, others in waits.items():
        for other in others:
            frees[other].append(head)
    left = {head: len(others) for head, others in waits.items()}
    turn = {head: min(pack) for head, pack in members.items()}
    ready = [(turn[head], head) for head in members if not left[head]]
    heapify(ready)
    order: list[int] = []
    packs: list[tuple[int, int]] = []
    while ready:
        _, head = heappop(ready)
        if len(members[head]) > 1:
            packs.append((len(order), len(members[head])))
        order += members[head]
        for other in frees[head]:
            left[other] -= 1
            if not left[other]:
                heappush(ready, (turn[other], other))
    return order, tuple(packs)


PACK_ALIGNMENT = 8
"""Words to which a place of a pack is aligned."""


class _Entry(NamedTuple):
    """A call of a table: its function, and (offset, stride) of its places."""

    number: int
    pairs: list[tuple[int, int]]


def single_lane_plan(planned: Plan) -> Plan | None:
    """Return the plan of a library of one lane; None for a program without packs."""
    if not planned.packs or planned.program is None:
        return None
    layout = _Layout(planned, planned.program)
    entries = {name: list(_entries(*planned.tables[name])) for name in planned.tables}
    size, tape = layout.interleave(entries["again"])
    writer = _Tables(planned, layout)
    tables = {name: writer.table(name, own) for name, own in entries.items()}
    found = replace(
        planned,
        functions=tuple(planned.functions[number] for number in writer.numbers),
        shapes=tuple(writer.shapes),
        tables=tables,
        size=size,
        tape=tape,
    )
    differs = list(zip(writer.numbers, writer.shapes, map(sorted, found.moving()), strict=True))
    return replace(found, signature=hashlib.sha256(repr(differs).encode()).hexdigest())


def _entries(count: int, table: Ints) -> Iterator[_Entry]:
    words, at = table.tolist(), 0
    for _ in range(count):
        number, length = words[at], words[at + 1]
        pairs = words[at + 2 : at + length]
        yield _Entry(number, list(zip(pairs[::2], pairs[1::2], strict=True)))
        at += length


class _Layout:
    """The memory layout of a library of one lane: ``to`` maps the words of the program to their places."""

    def __init__(self, planned: Plan, program: Program) -> None:
        self._planned, self._program = planned, program
        self.to: Ints = np.arange(program.size + planned.tape)
        self._family = np.full(program.size, NONE, np.int64)
        self._lane = np.zeros(program.size, np.int64)

    def interleave(self, again: Sequence[_Entry]) -> tuple[int, int]:
        """Move what packs write to the end of the memory, and order the tape; returns the words of both."""
        families = self._families()
        size = -(-self._program.size // PACK_ALIGNMENT) * PACK_ALIGNMENT
        for family in families:
            self.to[family] = size + np.arange(family.size).reshape(family.shape[::-1]).T
            size += -(-family.size // PACK_ALIGNMENT) * PACK_ALIGNMENT
        return size, self._tape(again, size)

    def _families(self) -> list[Ints]:
        """Return the words (lanes, size) of each result of each pack whose accesses are all regular."""
        body, free = self._program.phases[1], self._program.scratch()
        found: list[Ints] = []
        for first, lanes in self._planned.packs:
            calls = np.arange(first, first + lanes)
            for r in range(int(np.diff(body.outputs.starts[first : first + 2])[0])):
                places = body.outputs.starts[calls] + r
                size = int(body.outputs.size[places[0]])
                words = body.outputs.offset[places][:, None] + np.arange(size)
                if size and free[words].all():
                    self._family[words], self._lane[words] = len(found), np.arange(lanes)[:, None]
                    found.append(words)
        while broken := self._broken():
            for number in broken:
                self._family[found[number]] = NONE
        return [words for number, words in enumerate(found) if self._family[words[0, 0]] == number]

    def _broken(self) -> set[int]:
        """Return families of which a place of a call has some words, besides others."""
        body, broken = self._program.phases[1], set[int]()
        places = np.concatenate([np.stack([spans.offset, spans.size]) for spans in (body.inputs, body.outputs)], axis=1)
        for offset, size in np.unique(places[:, places[1] > 0], axis=1).T.tolist():
            own, lanes = self._family[offset : offset + size], self._lane[offset : offset + size]
            if (own != own[0]).any() or (own[0] != NONE and (lanes != lanes[0]).any()):
                broken.update(own[own != NONE].tolist())
        return broken

    def _tape(self, again: Sequence[_Entry], begin: int) -> int:
        """Order the words of the tape as the calls write them."""
        at, planned, lanes_of = begin, self._planned, dict(self._planned.packs)
        calls, k = planned.callers["again"], 0
        while k < len(again):
            lanes = _pack_size(again, calls, k, lanes_of.get(int(calls[k]), 1))
            graph, form = planned.functions[again[k].number]
            offset = again[k].pairs[-1][0]
            if offset >= self._program.size and form.primal == len(graph.sizes):
                size = graph.result_sizes[-1]
                offsets = np.array([again[k + lane].pairs[-1][0] for lane in range(lanes)])
                at = -(-at // lanes) * lanes
                self.to[offsets[:, None] + np.arange(size)] = at + np.arange(size * lanes).reshape(size, lanes).T
                at += size * lanes
            k += lanes
        return -(-(at - begin) // PACK_ALIGNMENT) * PACK_ALIGNMENT


def _pack_size(entries: Sequence[_Entry], calls: Ints, k: int, lanes: int) -> int:
    """Return the number of lanes from the k-th entry on: those of its pack if all call one function, else 1."""
    own = entries[k : k + lanes]
    if len(own) < lanes or {entry.number for entry in own} != {own[0].number}:
        return 1
    return lanes if (np.abs(np.diff(calls[k : k + lanes])) == 1).all() else 1


class _Tables:
    """The tables of the new plan, and the functions that they call."""

    def __init__(self, planned: Plan, layout: _Layout) -> None:
        self._planned, self._layout = planned, layout
        self.numbers: list[int] = []
        self.shapes: list[Shape] = []
        self._numbers: dict[tuple[int, Shape], int] = {}

    def table(self, name: str, entries: Sequence[_Entry]) -> tuple[int, Ints]:
        """Return one table: calls, and their entries."""
        lanes_of = dict(self._planned.packs)
        backward = name == "back_body"
        if backward:
            lanes_of = {first + lanes - 1: lanes for first, lanes in lanes_of.items()}
        words: list[int] = []
        count = k = 0
        while k < len(entries):
            lanes, pack = 1, None
            if name in TABLES:
                calls = self._planned.callers[name]
                lanes = _pack_size(entries, calls, k, lanes_of.get(int(calls[k]), 1))
                own = entries[k : k + lanes]
                pack = self._pack_entry(own[::-1] if backward else own) if lanes > 1 else None
            for entry in [pack] if pack else [self._single(each) for each in entries[k : k + lanes]]:
                words += [entry.number, 2 + 2 * len(entry.pairs), *(x for pair in entry.pairs for x in pair)]
                count += 1
            k += lanes
        return count, np.array(words or [0], np.int64)

    def _number(self, number: int, shape: Shape) -> int:
        key = (number, shape)
        if key not in self._numbers:
            self._numbers[key] = len(self.numbers)
            self.numbers.append(number)
            self.shapes.append(shape)
        return self._numbers[key]

    def _placed(self, offset: int, size: int) -> tuple[int, int]:
        """Return the offset and the stride of a place."""
        to = self._layout.to
        first = int(to[offset]) if size else 0
        return first, int(to[offset + 1]) - first if size > 1 else 1

    def _sizes(self, number: int) -> list[int]:
        graph, _ = self._planned.functions[number]
        return [*graph.sizes, *graph.result_sizes]

    def _single(self, entry: _Entry) -> _Entry:
        pairs, accesses = [], []
        for (offset, stride), size in zip(entry.pairs, self._sizes(entry.number), strict=True):
            first, step = self._placed(offset, size)
            pairs.append((first, stride))
            accesses.append(Access(BROADCAST, (step,)))
        return _Entry(self._number(entry.number, Shape(1, tuple(accesses))), pairs)

    def _pack_entry(self, own: Sequence[_Entry]) -> _Entry | None:
        """Return one entry for all lanes; None where the order of what they add would not be kept."""
        lanes, pairs, accesses = len(own), [], []
        for i, size in enumerate(self._sizes(own[0].number)):
            strides = {entry.pairs[i][1] for entry in own}
            placed = [self._placed(entry.pairs[i][0], size) for entry in own]
            if len(strides) > 1:
                return None
            (stride,) = strides
            first, steps = map(list, zip(*placed, strict=True))
            if len(set(first)) == 1:
                kind = BROADCAST
            elif first == list(range(first[0], first[0] + lanes)) and (size == 1 or set(steps) == {lanes}):
                kind, steps = INTERLEAVED, [lanes] * lanes
            else:
                kind = GATHER if len(set(first)) == lanes else GATHER_ALIASED
            accesses.append(Access(kind, tuple(steps)))
            pairs += [(at, stride) for at in (first if kind in (GATHER, GATHER_ALIASED) else first[:1])]
        if not self._keeps_order(own):
            return None
        return _Entry(self._number(own[0].number, Shape(lanes, tuple(accesses))), pairs)

    def _keeps_order(self, own: Sequence[_Entry]) -> bool:
        """Whether each word is added to by one result, or in one lane, in the order of its words."""
        graph, form = self._planned.functions[own[0].number]
        if not form.adds:
            return True
        arguments = len(graph.sizes)
        seen: dict[int, set[tuple[int, int, int]]] = {}
        for r, size in enumerate(graph.result_sizes):
            for lane, entry in enumerate(own):
                offset, _ = entry.pairs[arguments + r]
                for j in range(size):
                    seen.setdefault(offset + j, set()).add((r, lane, j))
        for touched in seen.values():
            one_result = len({(r, j) for r, _, j in touched}) == 1
            one_lane = len({lane for _, lane, _ in touched}) == 1
            if not (one_result or one_lane):
                return False
        return True
