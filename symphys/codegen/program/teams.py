"""Teams: equal calls of a body that do not wait for one another, such as those of four legs.

One rollout alone computes a team in the lanes of a vector. For that the calls of a team follow one another in the
program. So the body is put into an order in which they do, whatever its lanes: adjoints add up in that order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush

import numpy as np

from symphys.codegen.program.phase_calls import PhaseCalls
from symphys.codegen.program.program import Program

NONE = -1
SIZES = (4, 2)
"""Calls in a team."""
MOST = 5000
"""Calls of a body that is looked at: a robot has a thousand."""


@dataclass(frozen=True)
class Teamed:
    """A program whose teams stand together.

    Attributes:
        program: with its body in the new order.
        teams: (first call, calls) of each.
    """

    program: Program
    teams: tuple[tuple[int, int], ...] = ()


def teamed(program: Program) -> Teamed:
    """Look for teams; bodies with guards or sections, whose order means something, stay as they are."""
    body = program.phases[1]
    if program.in_order or not 1 < len(body) <= MOST or any(call.guard or call.section for call in program.body):
        return Teamed(program)
    before = _before(program, body)
    if before is None:
        return Teamed(program)
    found = list(_teams(body, before))
    if not found:
        return Teamed(program)
    order, teams = _ordered(before, found)
    return Teamed(replace(program, body=tuple(program.body[c] for c in order), in_order=True), teams)


def _before(program: Program, body: PhaseCalls) -> list[list[int]] | None:
    """Return the calls that each call depends on; None if places move through time at different strides."""
    places = [np.stack([spans.offset, spans.size, spans.stride]) for spans in (body.inputs, body.outputs)]
    taken = np.full(program.size, NONE, np.int64)
    for offset, size, stride in np.unique(np.concatenate(places, axis=1), axis=1).T.tolist():
        steps = np.arange(program.steps if stride else 1)
        own = np.arange(offset, offset + size) + stride * steps[:, None]
        if ((taken[own] != NONE) & (taken[own] != stride)).any():
            return None
        taken[own] = stride
    words, calls, _ = body.outputs.words()
    turn = np.lexsort((calls, words))
    words, calls = words[turn], calls[turn]
    writer = np.full(program.size, NONE, np.int64)
    writer[words] = calls
    again = words[1:] == words[:-1]
    read, reader, _ = body.inputs.words()
    edges = np.stack([np.append(writer[read], calls[:-1][again]), np.append(reader, calls[1:][again])])
    edges = np.unique(edges[:, edges[0] != NONE], axis=1)
    if (edges[0] >= edges[1]).any():
        return None
    before: list[list[int]] = [[] for _ in range(len(body))]
    for first, then in edges.T.tolist():
        before[then].append(first)
    return before


def _teams(body: PhaseCalls, before: Sequence[Sequence[int]]) -> Iterator[list[int]]:
    """The calls of each team, by their lanes."""
    sets = _equal(body, before)
    work = Counter[int]()
    for calls in sets:
        work[len(calls)] += len(calls)
    limbs = max(work, key=lambda n: work[n], default=0)
    limb = _limbs(sets, before, limbs, len(body))
    for calls in sets:
        own = {k: [c for c in calls if limb[c] == k] for k in sorted({limb[c] for c in calls})}
        rest = own.pop(NONE, [])
        rounds = max(map(len, own.values()), default=0)
        for r in range(rounds):
            rest_of_round = [mine[r] for mine in own.values() if r < len(mine)]
            yield from _cut(rest_of_round)
        yield from _cut(rest)


def _cut(calls: list[int]) -> Iterator[list[int]]:
    for size in SIZES:
        while len(calls) >= size:
            yield calls[:size]
            calls = calls[size:]


def _equal(body: PhaseCalls, before: Sequence[Sequence[int]]) -> list[list[int]]:
    """Calls of one function that may run at once, two or more; earlier ones first."""
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


def _limbs(sets: Sequence[Sequence[int]], before: Sequence[Sequence[int]], limbs: int, count: int) -> list[int]:
    """Assign each call to a chain, -1 for none: the chain of the calls that it reads, or that read it."""
    limb = [NONE] * count
    after: list[list[int]] = [[] for _ in range(count)]
    for c, own in enumerate(before):
        for other in own:
            after[other].append(c)

    def told(c: int, near: Sequence[Sequence[int]]) -> int:
        votes = Counter(limb[other] for other in near[c] if limb[other] != NONE)
        if not votes:
            return NONE
        first, *others = votes.most_common(2)
        return NONE if others and others[0][1] == first[1] else first[0]

    for calls in sets:
        if len(calls) == limbs:
            heard = [told(c, before) for c in calls]
            if sorted(heard) != list(range(limbs)):
                heard = list(range(limbs))
            for c, k in zip(calls, heard, strict=True):
                limb[c] = k
    others = [calls for calls in sets if len(calls) != limbs]
    for near, turn in ((before, others), (after, others[::-1]), (before, others)):
        for calls in turn:
            for c in calls:
                if limb[c] == NONE:
                    limb[c] = told(c, near)
    return limb


def _ordered(
    before: Sequence[Sequence[int]], found: Sequence[Sequence[int]]
) -> tuple[list[int], tuple[tuple[int, int], ...]]:
    """Calls in their order as far as teams allow, and where the teams begin."""
    whose = list(range(len(before)))
    members = {c: [c] for c in whose}
    for team in found:
        for c in team:
            whose[c] = team[0]
            del members[c]
        members[team[0]] = list(team)
    waits = {head: {whose[other] for c in team for other in before[c]} for head, team in members.items()}
    frees: dict[int, list[int]] = {head: [] for head in members}
    for head, others in waits.items():
        for other in others:
            frees[other].append(head)
    left = {head: len(others) for head, others in waits.items()}
    turn = {head: min(team) for head, team in members.items()}
    ready = [(turn[head], head) for head in members if not left[head]]
    heapify(ready)
    order: list[int] = []
    teams: list[tuple[int, int]] = []
    while ready:
        _, head = heappop(ready)
        if len(members[head]) > 1:
            teams.append((len(order), len(members[head])))
        order += members[head]
        for other in frees[head]:
            left[other] -= 1
            if not left[other]:
                heappush(ready, (turn[other], other))
    return order, tuple(teams)
