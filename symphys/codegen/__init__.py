"""Rollouts as programs of calls, compiled to C that computes a block of lanes at once, with their gradients."""

from typing import TYPE_CHECKING

from symphys.later import later

if TYPE_CHECKING:
    from symphys.codegen.errors import KernelUnavailable, ProgramError
    from symphys.codegen.program.interpret import interpret
    from symphys.codegen.program.nan_location import Bad
    from symphys.codegen.program.program import AdjointDiscount, FunctionCall, MemoryLayout, Place, Program
    from symphys.codegen.runtime.kernel import BuildReport, Fixed, FixedBatch, Kernel, ProcessorKernel
    from symphys.codegen.toolchain.build import compile_program
    from symphys.codegen.toolchain.cache import Cache, CacheInfo, default_cache
    from symphys.codegen.toolchain.compiler import processors
    from symphys.codegen.toolchain.libraries import shared_library
    from symphys.codegen.toolchain.source_file import SourceFile

__all__ = [
    "AdjointDiscount",
    "Bad",
    "BuildReport",
    "Cache",
    "CacheInfo",
    "Fixed",
    "FixedBatch",
    "FunctionCall",
    "Kernel",
    "KernelUnavailable",
    "MemoryLayout",
    "Place",
    "ProcessorKernel",
    "Program",
    "ProgramError",
    "SourceFile",
    "compile_program",
    "default_cache",
    "interpret",
    "processors",
    "shared_library",
]

__getattr__ = later(
    __name__,
    {
        "emit.source": ("SourceFile",),
        "errors": ("KernelUnavailable", "ProgramError"),
        "program.interpret": ("interpret",),
        "program.nan_location": ("Bad",),
        "program.program": ("AdjointDiscount", "FunctionCall", "MemoryLayout", "Place", "Program"),
        "runtime.kernel": ("BuildReport", "Fixed", "FixedBatch", "Kernel", "ProcessorKernel"),
        "toolchain.build": ("compile_program",),
        "toolchain.libraries": ("shared_library",),
        "toolchain.cache": ("Cache", "CacheInfo", "default_cache"),
        "toolchain.compiler": ("processors",),
    },
)
