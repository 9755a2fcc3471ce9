"""Kernels by the name of a backend, on the processor or on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from symphys.kernel import Kernel, Program, compile_program

PRECISIONS: dict[str, Literal["double", "single"]] = {
    "simd": "double",
    "simd32": "single",
    "cuda": "double",
    "cuda32": "single",
}
"""Of the backends that are kernels."""
IN_PLACE = {"cuda": "simd", "cuda32": "simd32"}
"""What evaluates where there is no GPU."""


def build_kernel(name: str, program: Program, seeded: Sequence[str], threads: int) -> Kernel:
    """The kernel of a program, whose outputs ``seeded`` can be differentiated; KernelUnavailable if that cannot be.

    ``threads`` share the blocks of a batch on the processor.
    """
    if name not in IN_PLACE:
        return compile_program(program, seeded=seeded, threads=threads, precision=PRECISIONS[name])
    from symphys.cuda import compile_on, find_gpu

    return compile_on(find_gpu(), program, PRECISIONS[name], seeded)
