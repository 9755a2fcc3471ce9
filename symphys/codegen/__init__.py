"""Rollouts as programs of calls, compiled to C that computes a block of lanes at once, with their gradients."""

from symphys.codegen.emit.source import Source
from symphys.codegen.errors import KernelUnavailable, ProgramError
from symphys.codegen.program.interpret import interpret
from symphys.codegen.program.layout import Layout
from symphys.codegen.program.nan_location import Bad
from symphys.codegen.program.program import Call, Fading, Place, Program
from symphys.codegen.runtime.fixed_addresses import Fixed
from symphys.codegen.runtime.kernel import Kernel, ProcessorKernel
from symphys.codegen.toolchain.build import compile_program, shared_library
from symphys.codegen.toolchain.cache import Cache, CacheInfo, default_cache
from symphys.codegen.toolchain.compiler import processors
from symphys.codegen.toolchain.report import Report

__all__ = [
    "Bad",
    "Cache",
    "CacheInfo",
    "Call",
    "Fading",
    "Fixed",
    "Kernel",
    "KernelUnavailable",
    "Layout",
    "Place",
    "ProcessorKernel",
    "Program",
    "ProgramError",
    "Report",
    "Source",
    "compile_program",
    "default_cache",
    "interpret",
    "processors",
    "shared_library",
]
