"""One rollout alone: the calls of a team become one call, whose lanes are those of a vector.

What teams write is interleaved: the first word of each lane, then the second of each. So what a team hands on to a team
is loaded and stored as vectors. What it reads elsewhere is one word for all lanes, or one from a place for each.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symphys.codegen.emit.guarding import TABLES
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.shapes import ALL, BESIDE, EACH, TURNS, Access, Shape
from symphys.codegen.program.program import Program
from symphys.types import Ints

NONE = -1
ALIGNED = 8
"""Words to which a place of a team is aligned."""


class _Entry(NamedTuple):
    """A call of a table: its function, and (offset, stride) of its places."""

    number: int
    pairs: list[tuple[int, int]]


def alone(planned: Plan) -> Plan | None:
    """The plan of a library of one lane; None where no calls are side by side."""
    if not planned.teams or planned.program is None:
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
    """Where the words of a program lie: ``to`` has their places, by those that the program gives them."""

    def __init__(self, planned: Plan, program: Program) -> None:
        self._planned, self._program = planned, program
        self.to: Ints = np.arange(program.size + planned.tape)
        self._family = np.full(program.size, NONE, np.int64)
        self._lane = np.zeros(program.size, np.int64)

    def interleave(self, again: Sequence[_Entry]) -> tuple[int, int]:
        """Move what teams write to the end of the memory, and order the tape; returns the words of both."""
        families = self._families()
        size = -(-self._program.size // ALIGNED) * ALIGNED
        for family in families:
            self.to[family] = size + np.arange(family.size).reshape(family.shape[::-1]).T
            size += -(-family.size // ALIGNED) * ALIGNED
        return size, self._tape(again, size)

    def _families(self) -> list[Ints]:
        """Return the words (lanes, size) of each result of each team whose accesses are all regular."""
        body, free = self._program.phases[1], self._program.scratch()
        found: list[Ints] = []
        for first, lanes in self._planned.teams:
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
        """Families of which a place of a call has some words, besides others."""
        body, broken = self._program.phases[1], set[int]()
        places = np.concatenate([np.stack([spans.offset, spans.size]) for spans in (body.inputs, body.outputs)], axis=1)
        for offset, size in np.unique(places[:, places[1] > 0], axis=1).T.tolist():
            own, lanes = self._family[offset : offset + size], self._lane[offset : offset + size]
            if (own != own[0]).any() or (own[0] != NONE and (lanes != lanes[0]).any()):
                broken.update(own[own != NONE].tolist())
        return broken

    def _tape(self, again: Sequence[_Entry], begin: int) -> int:
        """Order the words of the tape as the calls write them."""
        at, planned, lanes_of = begin, self._planned, dict(self._planned.teams)
        calls, k = planned.callers["again"], 0
        while k < len(again):
            lanes = _together(again, calls, k, lanes_of.get(int(calls[k]), 1))
            graph, form = planned.functions[again[k].number]
            offset = again[k].pairs[-1][0]
            if offset >= self._program.size and form.primal == len(graph.sizes):
                size = len(graph.results[-1])
                offsets = np.array([again[k + lane].pairs[-1][0] for lane in range(lanes)])
                at = -(-at // lanes) * lanes
                self.to[offsets[:, None] + np.arange(size)] = at + np.arange(size * lanes).reshape(size, lanes).T
                at += size * lanes
            k += lanes
        return -(-(at - begin) // ALIGNED) * ALIGNED


def _together(entries: Sequence[_Entry], calls: Ints, k: int, lanes: int) -> int:
    """Return the number of entries from the k-th on that are one team's calls of a function: the whole team, or 1."""
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
        """One table: calls, and their entries."""
        lanes_of = dict(self._planned.teams)
        backward = name == "back_body"
        if backward:
            lanes_of = {first + lanes - 1: lanes for first, lanes in lanes_of.items()}
        words: list[int] = []
        count = k = 0
        while k < len(entries):
            lanes, team = 1, None
            if name in TABLES:
                calls = self._planned.callers[name]
                lanes = _together(entries, calls, k, lanes_of.get(int(calls[k]), 1))
                own = entries[k : k + lanes]
                team = self._team(own[::-1] if backward else own) if lanes > 1 else None
            for entry in [team] if team else [self._single(each) for each in entries[k : k + lanes]]:
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
        return [*graph.sizes, *map(len, graph.results)]

    def _single(self, entry: _Entry) -> _Entry:
        pairs, accesses = [], []
        for (offset, stride), size in zip(entry.pairs, self._sizes(entry.number), strict=True):
            first, step = self._placed(offset, size)
            pairs.append((first, stride))
            accesses.append(Access(ALL, (step,)))
        return _Entry(self._number(entry.number, Shape(1, tuple(accesses))), pairs)

    def _team(self, own: Sequence[_Entry]) -> _Entry | None:
        """One entry for all lanes; None where the order of what they add would not be kept."""
        lanes, pairs, accesses = len(own), [], []
        for i, size in enumerate(self._sizes(own[0].number)):
            strides = {entry.pairs[i][1] for entry in own}
            placed = [self._placed(entry.pairs[i][0], size) for entry in own]
            if len(strides) > 1:
                return None
            (stride,) = strides
            first, steps = map(list, zip(*placed, strict=True))
            if len(set(first)) == 1:
                kind = ALL
            elif first == list(range(first[0], first[0] + lanes)) and (size == 1 or set(steps) == {lanes}):
                kind, steps = BESIDE, [lanes] * lanes
            else:
                kind = EACH if len(set(first)) == lanes else TURNS
            accesses.append(Access(kind, tuple(steps)))
            pairs += [(at, stride) for at in (first if kind in (EACH, TURNS) else first[:1])]
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
        for r, result in enumerate(graph.results):
            for lane, entry in enumerate(own):
                offset, _ = entry.pairs[arguments + r]
                for j in range(len(result)):
                    seen.setdefault(offset + j, set()).add((r, lane, j))
        for touched in seen.values():
            one_result = len({(r, j) for r, _, j in touched}) == 1
            one_lane = len({lane for _, lane, _ in touched}) == 1
            if not (one_result or one_lane):
                return False
        return True
