"""Start of a kernel that was built before, without building its program again.

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
from symphys.codegen.toolchain.build import BlockWidth, KeptLibraries, compiled, kernel_of, temporary_folder, width_of
from symphys.codegen.toolchain.cache import PLANS, Cache, default_cache
from symphys.codegen.toolchain.identity import identity_of, package_stamp
from symphys.codegen.toolchain.plans import KeptPlan

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
    wait: bool = True,
) -> ProcessorKernel:
    """Build or find the kernel of a source; those of ``seeded`` that the program has can be differentiated.

    See ``compile_program`` and ``build.compiled`` for the other arguments.
    """
    started, single = time.perf_counter(), precision == "single"
    cache, width = cache or default_cache(), BlockWidth(width_of("auto", single), single)
    key = None
    if source.identity is not None:
        key = identity_of(source.identity, package_stamp(), width.lanes, precision, tuple(seeded))
    if key is not None and (kept := _found(key[:32], source, cache)) is not None:
        libraries = KeptLibraries(kept, width, cache)
        if (loaded := libraries.find(width.lanes)) is not None:
            return kernel_of((width.lanes, loaded), libraries, threads, started)
    program = source.make()
    names = tuple(name for name in seeded if name in program.outputs)
    kernel, plan = compiled(program, names, width, cache, threads, wait=wait)
    if key is not None:
        _keep(key[:32], plan, cache)
    return kernel


def _found(key: str, source: ProgramSource, cache: Cache) -> KeptPlan | None:
    """Return the kept plan; None if there is none."""
    path = replace(cache, suffix=PLANS).find(key)
    if path is None:
        return None
    try:
        return KeptPlan.read(path, source.make)
    except (OSError, ValueError, KeyError):  # taken away meanwhile
        return None


def _keep(key: str, plan: KeptPlan, cache: Cache) -> None:
    """Store a plan, if that is possible."""
    with contextlib.suppress(OSError), temporary_folder("symphys-plan-") as folder:
        path = Path(folder) / "plan.npz"
        plan.write(path)
        replace(cache, suffix=PLANS).store(key, path)
