"""Rollouts as programs of calls, compiled to C that computes a block of lanes at once, with their gradients."""

from symphys.kernel.build import compile_program
from symphys.kernel.cache import Cache, CacheInfo, default_cache
from symphys.kernel.diagnosis import Bad
from symphys.kernel.errors import KernelUnavailable, ProgramError
from symphys.kernel.interpret import interpret
from symphys.kernel.kernel import Kernel
from symphys.kernel.layout import Layout
from symphys.kernel.program import Call, Place, Program
from symphys.kernel.report import Report

__all__ = [
    "Bad",
    "Cache",
    "CacheInfo",
    "Call",
    "Kernel",
    "KernelUnavailable",
    "Layout",
    "Place",
    "Program",
    "ProgramError",
    "Report",
    "compile_program",
    "default_cache",
    "interpret",
]
