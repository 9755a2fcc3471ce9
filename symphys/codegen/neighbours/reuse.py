"""A crowd whose members use words of their work again: for values alone, since adjoints read what was computed before.

What fits a cache is computed faster: half of a pair's words hold for one of many sweeps.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace

from symphys.codegen.neighbours.program import (
    ONLY,
    Crowd,
    MemberCall,
    MemberLoop,
    MemberReference,
    Move,
    SightPlaces,
    Store,
)
from symphys.codegen.neighbours.references import with_references


@dataclass
class _Region:
    """Words of a room that are written together.

    Attributes:
        start, size: where they lie in the work of a member.
        first, last: when they are written and when they are read last.
    """

    start: int
    size: int
    first: int
    last: int


def reused(crowd: Crowd, alone: bool = False) -> Crowd:
    """The same crowd with less work; it has no adjoint. ``alone``: for one scene, ``with_references``."""
    begin = _begin(crowd)
    crowd = with_references(crowd) if alone else crowd
    places = _Places(crowd, begin)
    loops = tuple(_moved(loop, places) for loop in crowd.loops)
    species = len(crowd.sights)
    return replace(
        crowd,
        loops=loops,
        sieves=tuple(
            replace(sieve, places=tuple(places.of(sieve.room, at) for at in sieve.places)) for sieve in crowd.sieves
        ),
        rooms=tuple(replace(room, work=places.size(r)) for r, room in enumerate(crowd.rooms)),
        sights=tuple(
            SightPlaces(places.of(1 + s, each.position), places.of(1 + s, each.reach))
            for s, each in enumerate(crowd.sights)
        ),
        nears=tuple(tuple(places.of(1 + species + kind, at) for at in words) for kind, words in enumerate(crowd.nears)),
        striking=places.of(ONLY, crowd.striking),
    )


def _moved(loop: MemberLoop, places: _Places) -> MemberLoop:
    def move(each: Move) -> Move:
        own = replace(each, at=places.of(loop.room, each.at))
        return replace(own, offset=places.of(each.room, each.offset)) if each.store is Store.WORK else own

    def call(each: MemberCall) -> MemberCall:
        inputs = tuple(
            places.referred(at) if isinstance(at, MemberReference) else places.of(loop.room, at) for at in each.inputs
        )
        outputs = tuple(places.of(loop.room, at) for at in each.outputs)
        cleared = tuple((places.of(loop.room, at), size) for at, size in each.cleared)
        return replace(each, inputs=inputs, outputs=outputs, cleared=cleared)

    does = tuple(move(each) if isinstance(each, Move) else call(each) for each in loop.does)
    section = None if loop.section is None else places.of(ONLY, loop.section)
    return MemberLoop(loop.room, does, section, tuple(map(move, loop.instead)))


def _begin(crowd: Crowd) -> list[set[int]]:
    """By room, where regions begin: results of a call, and what is copied in."""
    found: list[set[int]] = [set() for _ in crowd.rooms]
    for loop in crowd.loops:
        for does in loop.does:
            if isinstance(does, MemberCall):
                found[loop.room].update(does.outputs[:1])
            elif not does.out:
                found[loop.room].add(does.at)
    return found


class _Places:
    """Where words of the work go."""

    def __init__(self, crowd: Crowd, begin: list[set[int]]) -> None:
        self._crowd = crowd
        self._starts = [sorted(starts) for starts in begin]
        self._regions: list[dict[int, _Region]] = [{} for _ in crowd.rooms]
        for time, room, at in self._touched():
            self._touch(time, room, at)
        self._to: list[dict[int, int]] = []
        self._sizes: list[int] = []
        for regions in self._regions:
            to, size = _packed(list(regions.values()))
            self._to.append(to)
            self._sizes.append(size)

    def of(self, room: int, at: int) -> int:
        """The new place of a word."""
        start = self._start(room, at)
        return self._to[room][start] + at - start

    def referred(self, to: MemberReference) -> MemberReference:
        """The same words elsewhere."""
        return to._replace(offset=self.of(to.room, to.offset)) if to.store is Store.WORK else to

    def size(self, room: int) -> int:
        """Words of a member."""
        return self._sizes[room]

    def _start(self, room: int, at: int) -> int:
        return self._starts[room][bisect_right(self._starts[room], at) - 1]

    def _touched(self) -> Iterator[tuple[int, int, int]]:
        """(time, room, word) of all that is written or read, in order."""
        crowd, time = self._crowd, 0
        for number, loop in enumerate(crowd.loops):
            if number == crowd.found:
                yield time, ONLY, crowd.striking
                for s, sight in enumerate(crowd.sights):
                    yield time, 1 + s, sight.position
                    yield time, 1 + s, sight.reach
            if number == crowd.looked:
                for kind, words in enumerate(crowd.nears):
                    yield from ((time, 1 + len(crowd.sights) + kind, at) for at in words)
            for sieve in crowd.sieves:
                if number == sieve.loop:
                    yield from ((time, sieve.room, at) for at in sieve.places)
            if loop.section is not None:
                yield time, ONLY, loop.section
            for does in (*loop.does, *loop.instead):
                time += 1
                places = (*does.inputs, *does.outputs) if isinstance(does, MemberCall) else (does.at,)
                yield from ((time, loop.room, at) for at in places if not isinstance(at, MemberReference))
                for each in (does,) if isinstance(does, Move) else places:
                    if isinstance(each, Move | MemberReference) and each.store is Store.WORK:
                        yield time, each.room, each.offset
            time += 1

    def _touch(self, time: int, room: int, at: int) -> None:
        start = self._start(room, at)
        region = self._regions[room].get(start)
        if region is None:
            starts = self._starts[room]
            after = bisect_right(starts, start)
            end = starts[after] if after < len(starts) else self._crowd.rooms[room].work
            self._regions[room][start] = _Region(start, end - start, time, time)
        else:
            region.last = time


def _packed(regions: list[_Region]) -> tuple[dict[int, int], int]:
    """New starts by old ones, and the words that are needed: each lies in the lowest gap that is free meanwhile."""
    to: dict[int, int] = {}
    size, held = 0, list[_Region]()
    for region in sorted(regions, key=lambda each: each.first):
        held = sorted((each for each in held if each.last >= region.first), key=lambda each: to[each.start])
        at = 0
        for each in held:
            if to[each.start] - at >= region.size:
                break
            at = max(at, to[each.start] + each.size)
        to[region.start] = at
        held.append(region)
        size = max(size, at + region.size)
    return to, size
