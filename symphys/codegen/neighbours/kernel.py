"""A compiled crowd: rollouts of many bodies and their adjoints, in batches over threads."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.emit.dialect import ONE_LANE, TEAM, VECTORS
from symphys.codegen.emit.shapes import EACH, Access, Shape
from symphys.codegen.emit.source import FILES, SourceFile, head_of, listed, resource, spread, team_head
from symphys.codegen.emit.writer import write
from symphys.codegen.errors import ProgramError
from symphys.codegen.neighbours.plan import CrowdPlan, Walk, crowd_plan
from symphys.codegen.neighbours.program import ONLY, Crowd, Store
from symphys.codegen.runtime.library import loaded
from symphys.codegen.runtime.thread_pool import MemoryPool
from symphys.codegen.toolchain.build import shared_library
from symphys.codegen.toolchain.cache import Cache, default_cache
from symphys.codegen.toolchain.compiler import processors
from symphys.codegen.toolchain.processor import processor
from symphys.codegen.toolchain.report import BuildReport

Array = NDArray[np.float64]
WORD = ctypes.c_int64
POINTER = ctypes.c_void_p
DRIVER = "crowd.h", "meetings.c", "neighbours.c"
MOST = 2**31 - 1
"""Words of a memory: places are numbers of 32 bits."""
SPARE = 1.25
"""Times as many pairs as are near, for which there is room from then on."""


class _Room(ctypes.Structure):
    _fields_ = tuple((name, WORD) for name in ("work", "state", "members", "base", "begin"))


class _Kind(ctypes.Structure):
    _fields_ = (
        *((name, WORD) for name in ("first", "second", "plane")),
        ("normal", ctypes.c_double * 3),
        ("offset", ctypes.c_double),
    )


class _Crowd(ctypes.Structure):
    _fields_ = (
        *((name, WORD) for name in ("rooms", "species", "loops", "words", "state", "given")),
        *((name, WORD) for name in ("found", "looked", "striking")),
        *((name, POINTER) for name in ("list", "order", "runs", "turns", "actions", "references")),
        ("length", WORD),
        *((name, POINTER) for name in ("entries", "back", "several")),
        ("sieves", WORD),
        *((name, POINTER) for name in ("sifts", "words_of", "kinds", "sight", "nears")),
    )


class _Scenes(ctypes.Structure):
    _fields_ = (
        *((name, WORD) for name in ("rows", "steps")),
        *((name, POINTER) for name in ("start", "given", "states", "slopes")),
        *((name, WORD) for name in ("shown", "start_size")),
        ("most", POINTER),
    )


class CrowdKernel:
    """Rollouts of many bodies.

    Attributes:
        crowd: with the room there is for pairs.
        report: how it was built.
        threads: blocks that are computed at once.
        most: by meeting, how many pairs have been near in a step at most.
        prepare: of new memories, which hold whatever was there.

    A state is that of all bodies, species by species, then what is there once. Forces of pairs stay in the kernel: a
    rollout begins without any.
    """

    def __init__(self, crowd: Crowd, planned: CrowdPlan, library: Any, report: BuildReport, threads: int) -> None:
        """Use ``compile_crowd``."""
        self.crowd, self.report, self.threads = crowd, report, threads
        self.prepare: Callable[[Any], None] | None = None
        self.most: NDArray[np.int64] = np.zeros(len(crowd.meetings), np.int64)
        self._planned = planned
        self._roll = library.roll
        self._roll.argtypes, self._roll.restype = (POINTER,) * 4, WORD
        self._pools: dict[tuple[int, bool], MemoryPool] = {}
        self._link()

    @property
    def shown(self) -> int:
        """Numbers of a state."""
        species = self.crowd.rooms[1 : 1 + len(self.crowd.sights)]
        return sum(room.members * room.state for room in species) + self.crowd.rooms[0].state

    def rollouts(self, starts: Array, given: Array, steps: int) -> Array:
        """(B, shown), (B, given) -> (B, steps + 1, shown): all states."""
        states = np.empty((len(starts), steps + 1, self.shown))
        self._run(starts, given, states, None)
        return states

    def adjoints(self, starts: Array, given: Array, weights: Array) -> tuple[Array, Array]:
        """All states, and for states weighed with (B, steps + 1, shown) the gradient by the start (B, shown)."""
        if np.ndim(weights) != 3 or np.shape(weights)[::2] != (len(starts), self.shown):
            raise ProgramError(f"weights have the shape {np.shape(weights)}, not ({len(starts)}, steps, {self.shown})")
        states, slopes = np.empty(weights.shape), np.array(weights, float, order="C")
        self._run(starts, given, states, slopes)
        return states, slopes[:, 0].copy()

    def _run(self, starts: Array, given: Array, states: Array, slopes: Array | None) -> None:
        starts, given = (np.ascontiguousarray(each, float) for each in (starts, given))
        for name, each, width in (("starts", starts, self.shown), ("given", given, self.crowd.given)):
            if each.shape != (len(starts), width):
                raise ProgramError(f"{name} have the shape {each.shape}; wanted is (batch, {width})")
        lanes = self.report.lanes
        blocks = -(-len(starts) // lanes)
        parts = min(blocks, self.threads)
        ends = [min(lanes * (blocks * i // parts), len(starts)) for i in range(parts + 1)]
        left = list(pairwise(ends))
        while left:
            steps = states.shape[1] - 1
            found: list[tuple[int, int]] = []
            memory = self._memory(steps, slopes is not None)
            arrays = starts, given, states, slopes
            memory.run([partial(self._part, arrays, a, b, found) for a, b in left], self.threads)
            if found:
                self._grow()
            left = found

    def _part(
        self, arrays: tuple[Array, Array, Array, Array | None], first: int, last: int, rest: list[Any], memory: Any
    ) -> None:
        starts, given, states, slopes = (None if each is None else each[first:last] for each in arrays)
        assert starts is not None and given is not None and states is not None
        most = np.zeros(max(len(self.most), 1), np.int64)
        addresses = [each.ctypes.data for each in (starts, given, states)]
        scenes = _Scenes(
            last - first, states.shape[1] - 1, *addresses, None if slopes is None else slopes.ctypes.data,
            self.shown, starts.shape[1], most.ctypes.data,
        )  # fmt: skip
        done = self._roll(*map(ctypes.byref, self._walks), ctypes.byref(scenes), memory.ctypes.data)
        np.maximum(self.most, most[: len(self.most)], out=self.most)
        if done < last - first:
            rest.append((first + done, last))

    def _grow(self) -> None:
        """Make room for as many pairs as have been near, and some more."""
        rooms, first = list(self.crowd.rooms), 1 + len(self.crowd.sights)
        for k, most in enumerate(self.most.tolist()):
            if most > rooms[first + k].members:
                rooms[first + k] = replace(rooms[first + k], members=int(SPARE * most) + 1)
        self.crowd = replace(self.crowd, rooms=tuple(rooms))
        self._pools.clear()
        self._link()

    def _memory(self, steps: int, gradient: bool) -> MemoryPool:
        if (steps, gradient) not in self._pools:
            crowd, lanes, (values, taped) = self.crowd, self.report.lanes, self._walks
            bodies = sum(room.members for room in crowd.rooms[1 : 1 + len(crowd.sights)])
            slots = sum(room.members for room in crowd.rooms[1 + len(crowd.sights) :])
            words = max(values.words, taped.words) + taped.words if gradient else values.words
            words += (1 + gradient) * (steps + 1) * values.state + values.given + values.length // 2 + 1
            bytes_ = steps * (12 * lanes * slots + 4 * len(crowd.meetings)) + 24 * slots + 92 * bodies + 512
            bytes_ += 4 * max(room.members for room in crowd.rooms)
            for sieve in crowd.sieves:
                bytes_ += 4 * (len(sieve.places) + (1 + 3 * len(sieve.places)) * crowd.rooms[sieve.room].members)
            total = words + bytes_ // (8 * lanes) + 2
            if total > MOST:
                raise ProgramError(f"neighbours: {steps} steps need {total} words of memory; there may be {MOST}")
            self._pools = {(steps, gradient): MemoryPool(total, lanes, np.float64, self.prepare)}
        return self._pools[steps, gradient]

    def _link(self) -> None:
        """What the driver walks, with room for so many members."""
        self._kept: list[Any] = []
        crowd, species = self.crowd, len(self.crowd.sights)
        begins, begin = [0] * len(crowd.rooms), 0
        for r in [*range(1, 1 + species), ONLY, *range(1 + species, len(crowd.rooms))]:
            begins[r] = begin
            begin += crowd.rooms[r].state * crowd.rooms[r].members
        kinds = (_Kind * max(len(crowd.meetings), 1))()
        for k, each in enumerate(crowd.meetings):
            plane = 0 if each.second < 0 else -1
            kinds[k] = _Kind(each.first, each.second, plane, (ctypes.c_double * 3)(*each.normal), each.offset)
        self._kept.append(kinds)
        walks = self._planned.values, self._planned.taped
        self._walks = tuple(self._walked(walk, begins, begin, ctypes.addressof(kinds)) for walk in walks)

    def _walked(self, walk: Walk, begins: Sequence[int], state: int, kinds: int) -> _Crowd:
        crowd, members = walk.crowd, [room.members for room in self.crowd.rooms]
        rooms = (_Room * len(members))()
        bases = np.cumsum([0, *(work * count for work, count in zip(walk.work, members, strict=True))])
        for r, room in enumerate(crowd.rooms):
            rooms[r] = _Room(walk.work[r], room.state, members[r], int(bases[r]), begins[r])
        self._kept.append(rooms)
        ends = 1 + len(crowd.nears) + np.cumsum([0, *map(len, crowd.nears)])
        actions, references = (self._placed(walk, each, begins, bases) for each in (walk.actions, walk.references))
        lists = walk.loops, walk.runs, walk.turns, actions, references
        places = [sieve.places for sieve in crowd.sieves]
        starts = np.cumsum([0, *map(len, places)]).tolist()
        sieves = [(s.room, at, len(s.places), s.loop) for s, at in zip(crowd.sieves, starts, strict=False)]
        return _Crowd(
            *(len(members), len(crowd.sights), len(walk.loops), int(bases[-1]), state, crowd.given),
            *(crowd.found, crowd.looked, crowd.striking),
            ctypes.addressof(rooms),
            *(self._put(each, np.int32) for each in lists),
            len(walk.entries) if len(walk.references) else 0,
            *(self._put(each, np.int32) for each in (walk.entries, walk.back, walk.several)),
            len(sieves),
            self._put(np.array(sieves), np.int32),
            self._put(np.array([at for own in places for at in own]), np.int32),
            kinds,
            self._put(np.array([(sight.position, sight.reach) for sight in crowd.sights]), np.int64),
            self._put(np.array([*ends, *(at for words in crowd.nears for at in words)]), np.int64),
        )

    def _placed(
        self, walk: Walk, rows: NDArray[np.int64], begins: Sequence[int], bases: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Actions or references with places in the memory in place of rooms."""
        if not rows.size:
            return rows
        states = np.array([room.state for room in walk.crowd.rooms])
        found = rows.copy()
        store, room = found[:, 0], found[:, 3].copy()
        kept = (store == Store.BEFORE) | (store == Store.AFTER)
        found[:, 3] = np.where(store == Store.WORK, np.array(walk.work)[room], np.where(kept, states[room], 0))
        found[:, 2] += np.where(store == Store.WORK, bases[room], np.where(kept, np.array(begins)[room], 0))
        return found

    def _put(self, values: NDArray[Any], kind: type[np.signedinteger[Any]]) -> int:
        values = np.ascontiguousarray(values, kind) if values.size else np.zeros(1, kind)
        self._kept.append(values)
        return int(values.ctypes.data)


def compile_crowd(
    crowd: Crowd, lanes: int | None = None, cache: Cache | None = None, threads: int | None = None
) -> CrowdKernel:
    """Build the kernel of a crowd in double precision, or take it from the cache.

    Args:
        crowd: what to compute.
        lanes: scenes in a block; None: what fills a register.
        cache: where kernels are kept; None: the user's.
        threads: how many blocks are computed at once; None: one for each processor.

    Raises:
        KernelUnavailable: with one line that says why.
    """
    started = time.perf_counter()
    lanes = processor().lanes(False) if lanes is None else lanes
    several = processor().lanes(False) if lanes == 1 else 0
    planned = crowd_plan(crowd, several)
    with shared_library(_sources(planned, lanes, several), cache or default_cache()) as built:
        library = loaded(built.path)
    report = BuildReport(
        compiler=built.compiler.version,
        flags=built.flags,
        lanes=lanes,
        precision="double",
        functions=len(planned.functions),
        operations=sum(len(graph.nodes) for graph, _ in planned.functions),
        bytes_per_lane=16 * sum(w * room.members for w, room in zip(planned.taped.work, crowd.rooms, strict=True)),
        cached=built.cached,
        seconds=time.perf_counter() - started,
        note=built.note,
    )
    return CrowdKernel(crowd, planned, library, report, processors() if threads is None else threads)


def _sources(planned: CrowdPlan, lanes: int, several: int) -> list[SourceFile]:
    """The C files; ``several``: calls that functions for several members do at once."""
    dialect = ONE_LANE if lanes == 1 else VECTORS
    head, found = head_of(lanes, single=False, dialect=dialect), list[SourceFile]()
    dialect, team = (replace(each, dense=True) for each in (dialect, TEAM))
    numbers = range(len(planned.functions))
    for backward in (False, True):
        own = [i for i in numbers if planned.functions[i][1].backward == backward and i not in planned.wide]
        found += _files(planned, own, head, [write(f"f{i}", *planned.functions[i], dialect, ()) for i in own])
    wide, texts = sorted(planned.wide), list[str]()
    for i in wide:
        graph, form = planned.functions[i]
        accesses = (Access(EACH, (1,) * several),) * (len(graph.sizes) + len(graph.results))
        texts.append(write(f"f{i}", graph, form, team, (), Shape(several, accesses)))
    gathering = _files(planned, wide, team_head(several, single=False), texts)
    found += (replace(file, gathers=True) for file in gathering)
    driver = [head, f"#define SEVERAL {several}\n" if wide else "", listed(len(numbers), dialect)]
    return [*found, SourceFile("".join([*driver, *map(resource, DRIVER)]))]


def _files(planned: CrowdPlan, numbers: Sequence[int], head: str, texts: Sequence[str]) -> Iterator[SourceFile]:
    for group in spread(texts, [len(planned.functions[i][0].nodes) for i in numbers], FILES):
        yield SourceFile("\n".join([head, *group]), straight=True)
