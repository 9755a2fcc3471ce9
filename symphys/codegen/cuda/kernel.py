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
from symphys.codegen.cuda.schedule import Schedule, schedules
from symphys.codegen.emit import source
from symphys.codegen.emit.alternatives import LEFT_OUT
from symphys.codegen.emit.dialect import DEVICE
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.writer import write
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.kernel import BuildReport, Kernel
from symphys.codegen.runtime.library import WORD, List, RowSource, data_places, program_fields, strided
from symphys.codegen.toolchain.build import names_of
from symphys.types import Ints

ROOM = "symphys.codegen.cuda"
MAX_FILES = 24
SIGNATURE = "(V *m, V *b, const word *t, word k)"
WARPS_PER_BLOCK = 4
"""Of a block. The table robot's step has 102 levels, whose dearest shares are 2.2 times less work than all calls with
4 warps, 2.6 times with 8, which leaves a thread half the registers."""
STEPS_PER_LAUNCH = 64
"""In one launch: between launches a user can interrupt, and a display can be drawn."""


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
        """The address of a copy."""
        self._kept.append(self.device.put(words if words.size else np.zeros(1, np.int64)))
        return self.device.address(self._kept[-1])


def interleaved(entries: Ints, lanes: int) -> Ints:
    """Entries whose offsets and strides count the words of all lanes; those of what is copied count robots' words."""
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
        sizes = [len(result) for result in graph.results]
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
    """The texts of a plan's kernels, for blocks of so many robots and warps; the last one is the driver's."""
    head = f"#define LANES {lanes}\n#define WARPS {warps}\n#define SINGLE {int(single)}\n{resource('device.h')}"
    apart = results_apart(planned, steps)
    texts = [
        write(f"f{number}", graph, form, DEVICE, apart=apart[number] if form.adds else ())
        for number, (graph, form) in enumerate(planned.functions)
    ]
    work = [len(graph.nodes) for graph, _ in planned.functions]
    names = [f"f{number}" for number in range(len(texts))]
    declared = "".join(f"{DEVICE.entry} {name}{SIGNATURE};\n" for name in names)
    cases = "".join(f"    case {number}: {name}(m, b, t, k); break;\n" for number, name in enumerate(names))
    call = (
        "static __device__ __forceinline__ void call(word number, V *m, V *b, const word *t, word k) {\n"
        f"  switch (number) {{\n{cases}  }}\n}}\n"
    )
    driver = "\n".join([head, declared, call, source.resource("program.h"), resource("driver.cu")])
    return [*("\n".join([head, *group]) for group in source.spread(texts, work, MAX_FILES)), driver]


def resource(name: str) -> str:
    """The text of a file of this room."""
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
        """Blocks of a wave, at most as many as are wanted, in memory that is kept."""
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
        """Rows from start to end."""
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
        """Kernels with the steps that they are for."""
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
        operations=sum(len(graph.nodes) for graph, _ in planned.functions),
        bytes_per_lane=(2 * program.size + planned.tape) * (4 if single else 8),
        cached=cached,
        seconds=time.perf_counter() - began,
        note=note,
    )
    tables = Tables(device, program, planned, names, schedules(planned, program, warps), warps)
    return DeviceKernel(program, report, names, device, module, tables)
