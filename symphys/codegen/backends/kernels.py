"""Kernels by the name of a backend, on the processor or on a GPU."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING, Literal

from symphys.codegen import Kernel, KernelUnavailable, ProcessorKernel, Program, compile_program
from symphys.codegen.backends.interface import Description, joined, no_note
from symphys.codegen.backends.precision import PrecisionCheck
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source

if TYPE_CHECKING:
    from symphys.codegen.cuda import DeviceKernel

if TYPE_CHECKING:
    from symphys.codegen.cuda import DeviceKernel


MIN_GPU_ROWS = 512
"""Rows below which no GPU is asked. A rollout there waits for its longest chain of calls, however few robots there are;
16 cores with AVX-512 do 128 robots in one go."""
Kind = tuple[bool, int]
"""With a gradient or without; the power of two of the rows."""


class FastestKernel(ProcessorKernel):
    """The processor, or a GPU for batches of a size for which it was faster when the first of that size came."""

    def __init__(self, kernel: ProcessorKernel, build: Callable[[], DeviceKernel], large: int = MIN_GPU_ROWS) -> None:
        """``build`` makes the same for a GPU, when a batch of ``large`` rows comes, or raises KernelUnavailable."""
        super().__init__(kernel.program, kernel.widths, kernel.report, kernel.seeded, kernel.threads)
        self._build, self._large, self._sought = build, large, False
        self._device: DeviceKernel | None = None
        self._gains: dict[Kind, float] = {}
        self._name = self._refused = ""

    @property
    def chosen(self) -> str:
        """Return the decision in one line; empty if there is none yet."""
        parts = ", ".join(_comparison_text(*each) for each in sorted(self._gains.items()))
        return joined(super().chosen, parts and f"{self._name} against the processor: {parts}", self._refused)

    def _run(self, batch: RolloutBatch) -> None:
        kind = "gradient" in batch.results, batch.rows.bit_length() - 1
        device = self._reached() if batch.rows >= self._large and self._gains.get(kind, inf) > 1 else None
        try:
            if device is None:
                super()._run(batch)
            elif kind in self._gains:
                device._run(batch)
            else:
                self._gains[kind] = self._expected(batch) / _seconds(lambda: device._run(batch))
        except KernelUnavailable as error:
            self._device, self._refused = None, str(error)
            super()._run(batch)

    def _reached(self) -> DeviceKernel | None:
        """Return the GPU's kernel, if there is a GPU; it is looked for once."""
        if not self._sought:
            self._sought = True
            try:
                self._device = self._build()
                self._name = self._device.device.name
            except KernelUnavailable:
                return None  # most machines have no GPU, and nobody asked for it
        return self._device

    def _expected(self, batch: RolloutBatch) -> float:
        """Return the expected time [s] of the processor, from a block for each thread."""
        self.widths.finish()  # an interpreter says nothing of the processor
        width = self.widths.ready(batch.rows)
        lanes, rows = width.lanes, min(batch.rows, self.threads * width.lanes)
        blocks = [batch.part(first, min(first + lanes, rows)) for first in range(0, rows, lanes)]
        tasks = [partial(width.loaded.evaluate, block) for block in blocks]
        return _seconds(lambda: width.pool.run(tasks, self.threads)) * batch.rows / rows


def _seconds(call: Callable[[], None]) -> float:
    began = perf_counter()
    call()
    return perf_counter() - began


def _comparison_text(kind: Kind, gain: float) -> str:
    gradient, power = kind
    what = "gradients" if gradient else "values"
    return f"{what} of {2**power} to {2 ** (power + 1) - 1} rollouts {gain:.2g} times as fast"


BEST = "auto"
PRECISIONS: dict[str, Literal["double", "single"]] = {
    BEST: "double",
    "simd": "double",
    "simd32": "single",
    "cuda": "double",
    "cuda32": "single",
}
"""Precisions of the backends that are kernels."""
ON_DEVICE = ("cuda", "cuda32")


def build_kernel(
    name: str, program: Program | ProgramSource, seeded: Sequence[str], threads: int, wait: bool = False
) -> Kernel:
    """Build the kernel of a program, whose outputs ``seeded`` can be differentiated, or raise KernelUnavailable.

    Where there is no GPU for it, it is one for the processor, and the note of its report says why. ``threads`` share
    the blocks of a batch there. Of a source those of ``seeded`` that it has. "auto" is the processor's, which takes
    large batches to a GPU where that is faster. ``wait``: for the compiler of a source too; else see ``compiled``.
    The first gradients in single precision are compared with those in double; see ``precision``.
    """
    kernel = _built(name, program, seeded, threads, wait)
    if kernel.report.precision == "single" and kernel.seeded:
        kernel.check = PrecisionCheck(program, kernel.seeded)
    return kernel


def _built(name: str, program: Program | ProgramSource, seeded: Sequence[str], threads: int, wait: bool) -> Kernel:
    note, precision = "", PRECISIONS[name]
    if name in ON_DEVICE:
        try:
            return _on_device(program, precision, seeded)
        except KernelUnavailable as error:
            note = f"the processor evaluates: {error}"
    if isinstance(program, ProgramSource):
        kernel = compile_source(program, seeded, threads, precision, wait=wait)
    else:
        kernel = compile_program(program, seeded=seeded, threads=threads, precision=precision)
    kernel.report = replace(kernel.report, note=joined(note, kernel.report.note))
    if name == BEST:
        return FastestKernel(kernel, lambda: _on_device(program, precision, seeded))
    return kernel


def _on_device(
    program: Program | ProgramSource, precision: Literal["double", "single"], seeded: Sequence[str]
) -> DeviceKernel:
    from symphys.codegen.cuda import compile_on, find_gpu

    gpu = find_gpu()
    if isinstance(program, ProgramSource):
        program = program.make()
        seeded = [name for name in seeded if name in program.outputs]
    return compile_on(gpu, program, precision, seeded)


def require_kernels(name: str) -> None:
    """Raise KernelUnavailable, with the package to install, if nothing here compiles kernels for a backend.

    Nothing is compiled. ``name``: of ``PRECISIONS``.
    """
    refused = ""
    if name in ON_DEVICE:
        from symphys.codegen.cuda import find_gpu

        try:
            find_gpu()
        except KernelUnavailable as error:
            refused = str(error)
        else:
            return
    try:
        find_compiler()
    except KernelUnavailable as error:
        raise KernelUnavailable(joined(refused, str(error))) from error


def described(kernel: Kernel, seconds: float, precision: str | None = None, note: str = "") -> Description:
    """Describe a kernel for results; ``precision``: where it is not the kernel's alone."""
    report, wanted = kernel.report, precision or kernel.report.precision
    kind = "simd" if isinstance(kernel, ProcessorKernel) else "cuda"
    return Description(
        name=kind if wanted == "double" else f"{kind}32",
        lanes=report.lanes,
        threads=kernel.threads,
        precision=wanted,
        compiler=report.compiler,
        flags=report.flags,
        cached=report.cached,
        seconds=seconds,
        note=joined(report.note, note),
        later=lambda: kernel.chosen,
        doubt=lambda: kernel.doubt,
        finish=kernel.widths.finish if isinstance(kernel, ProcessorKernel) else no_note,
    )
