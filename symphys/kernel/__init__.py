"""Rollouts as programs of calls, compiled to C that computes a block of lanes at once, with their gradients."""

from symphys.kernel.build import compile_program, shared_library
from symphys.kernel.cache import Cache, CacheInfo, default_cache
from symphys.kernel.compiler import processors
from symphys.kernel.diagnosis import Bad
from symphys.kernel.errors import KernelUnavailable, ProgramError
from symphys.kernel.fixed import Fixed
from symphys.kernel.interpret import interpret
from symphys.kernel.kernel import Kernel, ProcessorKernel
from symphys.kernel.layout import Layout
from symphys.kernel.program import Call, Fading, Place, Program
from symphys.kernel.report import Report
from symphys.kernel.source import Source

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
