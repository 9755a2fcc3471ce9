"""A program on a device: a robot in each thread of a warp, several warps for the calls that run side by side."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from symphys.codegen.cuda.device import Device
from symphys.codegen.cuda.schedule import schedules
from symphys.codegen.cuda.source import device_sources
from symphys.codegen.cuda.tables import DeviceJob, Tables
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.kernel import BuildReport, Kernel
from symphys.codegen.runtime.library import RowSource
from symphys.codegen.toolchain.build import names_of

WARPS_PER_BLOCK = 4
"""Of a block. The table robot's step has 102 levels, whose dearest shares are 2.2 times less work than all calls with
4 warps, 2.6 times with 8, which leaves a thread half the registers."""
STEPS_PER_LAUNCH = 64
"""In one launch: between launches a user can interrupt, and a display can be drawn."""


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
