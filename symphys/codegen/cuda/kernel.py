"""A program on a device: a robot in each thread of a warp, several warps for the calls that run side by side.

The CUDA C++ has the same functions as the C for processors, and a driver. Functions are spread over several texts that
are linked later: a compiler's time grows far faster than its text. The driver reads structures of addresses.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, Literal

import numpy as np

from symphys.codegen.cuda.device import Device
from symphys.codegen.emit import source
from symphys.codegen.emit.alternatives import (
    ALWAYS,
    LEFT_OUT,
    Alternatives,
    Span,
    entries_of,
    of_adjoint,
    of_call,
    word_of,
)
from symphys.codegen.emit.dialect import DEVICE
from symphys.codegen.emit.guarding import TABLES as GUARDED
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.writer import write
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.program.program import FunctionCall, Program
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.kernel import BuildReport, Kernel
from symphys.codegen.runtime.library import TABLES, WORD, List, RowSource, data_places, program_fields, strided
from symphys.codegen.toolchain import source_file
from symphys.codegen.toolchain.build import names_of
from symphys.records import dataclass
from symphys.types import Ints

ROOM = "symphys.codegen.cuda"
MAX_FILES = 24
SIGNATURE = "(V *m, V *b, const word *t, word k)"
WARPS_PER_BLOCK = 4
"""Warps of a block. The table robot's step has 102 levels, whose dearest shares are 2.2 times less work than all calls
with 4 warps, 2.6 times with 8, which leaves a thread half the registers."""
STEPS_PER_LAUNCH = 64
"""Steps in one launch: between launches a user can interrupt, and a display can be drawn."""
LOOPED = ("body", "again", "back_body")
"""Phases of every step."""
CALL_COST = 40
"""Cost of a call besides its operations, in operations: a jump, its table entry."""


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
    """A call to be scheduled: its words at step 0, its strides, and its alternatives."""

    entry: list[int]
    cost: int
    reads: Ints
    writes: Ints
    places: tuple[Span, ...]
    alternatives: Alternatives


def schedules(planned: Plan, program: Program, warps: int) -> dict[str, Schedule]:
    """Schedule all phases of a planned program: levels of calls that meet in no word that one of them writes.

    The calls of a robot's step form a graph: legs do not touch each other, nor do contacts of different bodies. A block
    of the device has several warps, each with a thread for every robot of the block; a warp takes its share of a level,
    then all synchronise. The calls of each word stay in the order of the program, so numbers do not depend on the count
    of warps. Before calls with a section or a guard stands an entry that skips them where that word is 0 for all robots
    of the block (``alternatives``).
    """
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
    """Return the entries of a warp's calls of a level; those that are left out together follow one another."""
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
        sizes = [*graph.sizes, *graph.result_sizes]
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
            costs[number] = CALL_COST + graph.operations
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
    """Put each call as early as the words allow; one by one where places move through time at different speeds."""
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
    """Distribute the calls of a level, each to the warp with the least work: those that always run, dearest first."""
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


class DevicePhase(ctypes.Structure):
    """The driver's ``phase``."""

    _fields_ = (("levels", WORD), ("spans", ctypes.c_void_p), ("entries", ctypes.c_void_p))


class DeviceProgram(ctypes.Structure):
    """The driver's ``program``."""

    _fields_ = program_fields(DevicePhase)


class DeviceJob(ctypes.Structure):
    """The driver's ``job``."""

    _fields_ = (
        ("program", ctypes.c_void_p),
        ("memory", ctypes.c_void_p),
        *((name, WORD) for name in ("rows", "first", "end")),
        *((name, RowSource) for name in ("z", "parameters", "seed")),
        *((name, ctypes.c_void_p) for name in ("outputs", "gradient", "trajectory")),
        *((name, WORD) for name in ("offset", "size", "stride", "count")),
        ("discount", ctypes.c_double),
    )


class Tables:
    """A program's data in the memory of a device.

    Attributes:
        address: of the driver's ``program``.
        warps: of a block.
    """

    def __init__(
        self,
        device: Device,
        program: Program,
        planned: Plan,
        seeded: Sequence[str],
        phases: Mapping[str, Schedule],
        warps: int,
    ) -> None:
        """Copy everything there."""
        self.device, self.warps = device, warps
        data = DeviceProgram(program.size, planned.tape, program.steps)
        values = [x for _, row in program.constants for x in row]
        self._kept = [device.put(np.array(values or [0], float))]
        data.values = device.address(self._kept[0])
        for name, places in data_places(program, seeded).items():
            words = np.array([x for place in places for x in (place.offset, place.size)], np.int64)
            setattr(data, name, List(len(places), self._put(words)))
        for name, each in phases.items():
            spans, entries = self._put(each.spans.ravel()), self._put(interleaved(each.entries, device.lanes))
            setattr(data, name, DevicePhase(len(each.spans), spans, entries))
        written = [place for call in program.body for place in call.outputs if place.stride]
        data.written = List(len(written), self._put(strided(written)))
        if program.discounted is not None:
            state, kept = program.discounted.state, program.discounted.kept
            data.discounted = (WORD * 3)(state.offset, state.size, state.stride)
            data.kept = (WORD * 2)(*((kept.offset, kept.stride) if kept else (0, 0)))
        self._kept.append(device.put(np.frombuffer(bytes(data), np.uint8)))
        self.address = device.address(self._kept[-1])

    def _put(self, words: Ints) -> int:
        """Return the address of a copy."""
        self._kept.append(self.device.put(words if words.size else np.zeros(1, np.int64)))
        return self.device.address(self._kept[-1])


def interleaved(entries: Ints, lanes: int) -> Ints:
    """Return entries whose offsets and strides count the words of all lanes.

    Those of what is copied count robots' words.
    """
    found, at = entries.copy(), 0
    while at < len(found):
        length = int(found[at + 1])
        found[at + 2 : at + length] *= 1 if found[at] == LEFT_OUT else lanes
        at += length
    return found


def results_apart(planned: Plan, steps: int) -> list[set[int]]:
    """Return the choice for each function; everything for a function without calls."""
    calls: list[list[Ints]] = [[] for _ in planned.functions]
    for count, table in planned.tables.values():
        at = 0
        for _ in range(count):
            calls[int(table[at])].append(table[at + 2 : at + table[at + 1]].reshape(-1, 2))
            at += int(table[at + 1])
    found = []
    for (graph, _), own in zip(planned.functions, calls, strict=True):
        met: set[int] = set()
        sizes = graph.result_sizes
        places = np.array([call[len(graph.sizes) :] for call in own]).reshape(len(own), len(sizes), 2)
        for a, b in zip(*np.triu_indices(len(sizes), 1), strict=True):
            if sizes[a] and sizes[b] and _meet(places[:, a], sizes[a], places[:, b], sizes[b], steps):
                met |= {int(a), int(b)}
        found.append(set(range(len(sizes))) - met)
    return found


def _meet(a: Ints, size: int, b: Ints, other: int, steps: int) -> bool:
    """Whether places, (calls, 2) offsets and strides, have a word in common in any step of any call."""
    offset, stride = (b - a).T
    ends = [offset, offset + stride * (steps - 1)]
    least, most = np.minimum(*ends), np.maximum(*ends)  # of the distance, over time: what lies between counts as met
    return bool(((least < size) & (most > -other)).any())


def device_sources(planned: Plan, steps: int, lanes: int, warps: int, single: bool) -> list[str]:
    """Return the texts of a plan's kernels, for blocks of so many robots and warps; the last one is the driver's."""
    head = f"#define LANES {lanes}\n#define WARPS {warps}\n#define SINGLE {int(single)}\n{resource('device.h')}"
    apart = results_apart(planned, steps)
    texts = [
        write(f"f{number}", graph, form, DEVICE, apart=apart[number] if form.adds else ())
        for number, (graph, form) in enumerate(planned.functions)
    ]
    work = [len(graph) for graph, _ in planned.functions]
    names = [f"f{number}" for number in range(len(texts))]
    declared = "".join(f"{DEVICE.entry} {name}{SIGNATURE};\n" for name in names)
    cases = "".join(f"    case {number}: {name}(m, b, t, k); break;\n" for number, name in enumerate(names))
    call = (
        "static __device__ __forceinline__ void call(word number, V *m, V *b, const word *t, word k) {\n"
        f"  switch (number) {{\n{cases}  }}\n}}\n"
    )
    driver = "\n".join([head, declared, call, source_file.resource("program.h"), resource("driver.cu")])
    return [*("\n".join([head, *group]) for group in source.spread(texts, work, MAX_FILES)), driver]


def resource(name: str) -> str:
    """Return the text of a file of this room."""
    return files(ROOM).joinpath(name).read_text(encoding="utf-8")


class DeviceKernel(Kernel):
    """Waves of blocks, as many as the device's memory takes; states stay there for the way back."""

    def __init__(
        self, program: Program, report: BuildReport, seeded: Sequence[str], device: Device, module: Any, tables: Tables
    ) -> None:
        """Use ``compile_on``."""
        super().__init__(program, report, seeded)
        self.device, self.module, self.tables = device, module, tables
        self.real = np.dtype(np.float32 if report.precision == "single" else np.float64)
        self._memory: Any = None
        self._blocks = 0

    def _run(self, batch: RolloutBatch) -> None:
        if not batch.rows:
            return
        lanes = self.device.lanes
        wave = lanes * self._room(-(-batch.rows // lanes))
        for start in range(0, batch.rows, wave):
            self._wave(batch, start, min(start + wave, batch.rows))

    def _room(self, wanted: int) -> int:
        """Return blocks of a wave, at most as many as are wanted, in memory that is kept."""
        if wanted > self._blocks:
            self._memory, self._blocks = None, 0  # before the device is asked what is free
            device = self.device
            free, each = device.free(), device.lanes * self.report.bytes_per_lane
            found = min(wanted, free // each)
            if not found:
                raise KernelUnavailable(
                    f"{device.name} has {free / 2**30:.1f} GiB free, and {device.lanes} rollouts take "
                    f"{each / 2**30:.1f} GiB"
                )
            self._memory, self._blocks = device.empty((found * each // self.real.itemsize,), self.real), found
        return min(wanted, self._blocks)

    def _wave(self, batch: RolloutBatch, start: int, end: int) -> None:
        """Run the rows from start to end."""
        device, rows, kept = self.device, end - start, []
        job = DeviceJob(program=self.tables.address, memory=device.address(self._memory), rows=rows)
        for name, array in batch.inputs.items():
            kept.append(device.put(array[start:end] if array.ndim == 2 else array))
            setattr(job, name, RowSource(device.address(kept[-1]), array.shape[1] if array.ndim == 2 else 0))
        results = {name: device.empty((rows, *array.shape[1:]), float) for name, array in batch.results.items()}
        for name, array in results.items():
            setattr(job, name, device.address(array))
        place = batch.place
        job.offset, job.size, job.stride, job.count = place.offset, place.size, place.stride, batch.count
        job.discount = batch.discount
        for name, first, last in self._phases(self.program.steps - batch.skipped, "gradient" in results):
            job.first, job.end = first, last
            self._launch(name, -(-rows // device.lanes), job)
        for name, array in results.items():
            batch.results[name][start:end] = device.get(array)

    def _phases(self, steps: int, gradient: bool) -> Iterator[tuple[str, int, int]]:
        """Yield kernels with the steps that they are for."""
        chunks = [(first, min(first + STEPS_PER_LAUNCH, steps)) for first in range(0, steps, STEPS_PER_LAUNCH)]
        skipped = [(steps, steps)] * (steps < self.program.steps)
        yield "begin", 0, 0
        yield from (("advance", *chunk) for chunk in chunks)
        yield from (("rest", *each) for each in skipped)
        yield "finish", 0, 0
        if gradient:
            yield "seed", 0, 0
            yield from (("rested", *each) for each in skipped)
            yield from (("retreat", *chunk) for chunk in reversed(chunks))
            yield "collect", 0, 0

    def _launch(self, name: str, blocks: int, job: DeviceJob) -> None:
        held = self.device.put(np.frombuffer(bytes(job), np.uint8))
        self.device.launch(self.module, name, blocks, (self.device.lanes, self.tables.warps), held)
        self.device.wait()


def compile_on(
    device: Device,
    program: Program,
    precision: Literal["double", "single"] = "double",
    seeded: Sequence[str] | None = None,
    warps: int = WARPS_PER_BLOCK,
) -> DeviceKernel:
    """Build a program's kernels for a device.

    Args:
        device: such as ``find_gpu()``.
        program: what to compile.
        precision: of the arithmetic; arguments and results are double always.
        seeded: names of the outputs that can be differentiated; None: all.
        warps: of a block: numbers do not depend on it.

    Raises:
        KernelUnavailable: with one line that says why.
    """
    began, single = time.perf_counter(), precision == "single"
    names = names_of(program, seeded)
    planned = plan(program, names, FAST_MEMORY, noted=False)  # without a tape: memory is what a device waits for
    texts = device_sources(planned, program.steps, device.lanes, warps, single)
    module, compiler, cached, note = device.load(texts)
    report = BuildReport(
        compiler=compiler,
        flags=(),
        lanes=device.lanes,
        precision=precision,
        functions=len(planned.functions),
        operations=sum(len(graph) for graph, _ in planned.functions),
        bytes_per_lane=(2 * program.size + planned.tape) * (4 if single else 8),
        cached=cached,
        seconds=time.perf_counter() - began,
        note=note,
    )
    tables = Tables(device, program, planned, names, schedules(planned, program, warps), warps)
    return DeviceKernel(program, report, names, device, module, tables)
