"""A kernel that was built before, without building its program again.

Beside each kernel lies its plan, under a checksum of all that the program is made from: the problem's data, the sources
of this package and the versions of what it builds with. Where that is not known (a Python function in the problem) the
program is built.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from symphys.codegen.program.program import Program
from symphys.codegen.runtime.kernel import ProcessorKernel
from symphys.codegen.toolchain.build import compiled, kernel_of, library_key, temporary_folder, width_of
from symphys.codegen.toolchain.cache import PLANS, Cache, default_cache
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.codegen.toolchain.identity import identity_of, package_stamp
from symphys.codegen.toolchain.plans import KeptPlan
from symphys.codegen.toolchain.processor import processor

Precision = Literal["double", "single"]


@dataclass(frozen=True)
class ProgramSource:
    """A program that need not be made where its kernel and its plan are kept.

    Attributes:
        make: makes it.
        identity: equal for equal programs, whichever process makes them; None: not known.
    """

    make: Callable[[], Program]
    identity: str | None = None


def compile_source(
    source: ProgramSource,
    seeded: Sequence[str],
    threads: int | None = None,
    precision: Precision = "double",
    cache: Cache | None = None,
) -> ProcessorKernel:
    """The kernel of a source; those of ``seeded`` that the program has can be differentiated.

    See ``compile_program`` for the other arguments.
    """
    started, single = time.perf_counter(), precision == "single"
    cache, width = cache or default_cache(), width_of("auto", single)
    key = None
    if source.identity is not None:
        key = identity_of(source.identity, package_stamp(), width, precision, tuple(seeded))
    if key is not None and (kept := _found(key[:32], source, cache)) is not None:
        plan, path = kept
        return kernel_of(path, plan, width, single, threads, started)
    program = source.make()
    names = tuple(name for name in seeded if name in program.outputs)
    kernel, plan = compiled(program, names, width, single, cache, threads)
    if key is not None:
        _keep(key[:32], plan, cache)
    return kernel


def _found(key: str, source: ProgramSource, cache: Cache) -> tuple[KeptPlan, Path] | None:
    """The plan that is kept, and the library that belongs to it."""
    path = replace(cache, suffix=PLANS).find(key)
    if path is None:
        return None
    try:
        plan = KeptPlan.read(path, source.make)
    except (OSError, ValueError, KeyError):  # taken away meanwhile
        return None
    compiler = find_compiler()
    library = cache.find(library_key(plan.texts, compiler, compiler.flags(processor())))
    return None if library is None else (plan, library)


def _keep(key: str, plan: KeptPlan, cache: Cache) -> None:
    """Store a plan; where that cannot be it is made again next time."""
    with contextlib.suppress(OSError), temporary_folder("symphys-plan-") as folder:
        path = Path(folder) / "plan.npz"
        plan.write(path)
        replace(cache, suffix=PLANS).store(key, path)
