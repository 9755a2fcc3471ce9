"""Kernels by the name of a backend, on the processor or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from symphys.codegen import Kernel, KernelUnavailable, ProcessorKernel, Program, compile_program
from symphys.codegen.backends.fastest import FastestKernel
from symphys.codegen.backends.interface import Description, joined, nothing
from symphys.codegen.backends.precision import PrecisionCheck
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source

if TYPE_CHECKING:
    from symphys.codegen.cuda import DeviceKernel

BEST = "auto"
PRECISIONS: dict[str, Literal["double", "single"]] = {
    BEST: "double",
    "simd": "double",
    "simd32": "single",
    "cuda": "double",
    "cuda32": "single",
}
"""Of the backends that are kernels."""
ON_DEVICE = ("cuda", "cuda32")


def build_kernel(
    name: str, program: Program | ProgramSource, seeded: Sequence[str], threads: int, wait: bool = False
) -> Kernel:
    """The kernel of a program, whose outputs ``seeded`` can be differentiated; KernelUnavailable if that cannot be.

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
    """KernelUnavailable, with what to install, if this machine has nothing that compiles kernels for a backend.

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
    """A kernel for results; ``precision``: where it is not the kernel's alone."""
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
        finish=kernel.widths.finish if isinstance(kernel, ProcessorKernel) else nothing,
    )
