"""From a program to a kernel: plan, source, key, then the cache or the compiler."""

from __future__ import annotations

import hashlib
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from symphys.kernel.cache import Cache, default_cache
from symphys.kernel.compiler import Compiler, find_compiler
from symphys.kernel.errors import ProgramError
from symphys.kernel.kernel import Kernel
from symphys.kernel.library import Loaded
from symphys.kernel.plan import plan
from symphys.kernel.processor import processor
from symphys.kernel.program import Program
from symphys.kernel.report import Report
from symphys.kernel.source import sources

CONTRACT = "off"
"""-ffp-contract: products and sums are fused."""


def compile_program(
    program: Program,
    lanes: int | Literal["auto"] = "auto",
    precision: Literal["double", "single"] = "double",
    cache: Cache | None = None,
    seeded: Sequence[str] | None = None,
    threads: int | None = None,
) -> Kernel:
    """Build the kernel of a program, or take it from the cache.

    Args:
        program: what to compile.
        lanes: rollouts in one block, a power of two; "auto": what fills a vector register.
        precision: of the arithmetic; arguments and results are double always.
        cache: where kernels are kept; None: the user's.
        seeded: names of the outputs that can be differentiated; None: all.
        threads: how many blocks are computed at once; None: one for each processor.

    Raises:
        KernelUnavailable: with one line that says why; the caller falls back.
    """
    started = time.perf_counter()
    names = tuple(program.outputs if seeded is None else seeded)
    if unknown := [name for name in names if name not in program.outputs]:
        raise ProgramError(f"no output is called {unknown[0]!r}; there are {', '.join(program.outputs)}")
    single = precision == "single"
    width = processor().lanes(single) if lanes == "auto" else lanes
    planned = plan(program, names)
    built = _library(sources(planned, width, single), cache or default_cache())
    loaded = Loaded(built.path, program, planned, names)
    built.release()
    report = Report(
        compiler=built.compiler.version,
        flags=built.flags,
        lanes=width,
        precision=precision,
        functions=len(planned.functions),
        operations=sum(len(graph.nodes) for graph, _ in planned.functions),
        bytes_per_lane=2 * program.size * (4 if single else 8),
        cached=built.cached,
        seconds=time.perf_counter() - started,
        note=built.note,
    )
    return Kernel(program, loaded, report, names, threads)


@dataclass
class _Built:
    """A library on disk, and how it came there."""

    path: Path
    compiler: Compiler
    flags: tuple[str, ...]
    cached: bool
    note: str = ""
    folder: tempfile.TemporaryDirectory[str] | None = None

    def release(self) -> None:
        """Remove the temporary folder, once the library is loaded."""
        if self.folder is not None:
            self.folder.cleanup()


def _library(texts: Sequence[str], cache: Cache) -> _Built:
    compiler = find_compiler()
    flags = compiler.flags(processor(), CONTRACT)
    key = hashlib.sha256("\0".join([*texts, *compiler.command, compiler.version, *flags]).encode()).hexdigest()[:32]
    if (path := cache.find(key)) is not None:
        return _Built(path, compiler, flags, cached=True)
    with cache.building(key):
        if (path := cache.find(key)) is not None:
            return _Built(path, compiler, flags, cached=True)
        folder = tempfile.TemporaryDirectory(prefix="symphys-kernel-", ignore_cleanup_errors=True)
        path, note = compiler.build(texts, flags, Path(folder.name)), ""
        try:
            path = cache.store(key, path)
        except OSError as error:
            note = f"the kernel was not kept in {cache.folder} ({error.strerror}); it will be compiled again next time"
    return _Built(path, compiler, flags, cached=False, note=note, folder=folder)
