"""From a program to a kernel: plan, source, key, then the cache or the compiler."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from symphys.codegen.emit.plan import plan
from symphys.codegen.emit.source import SourceFile, sources
from symphys.codegen.errors import KernelUnavailable, ProgramError
from symphys.codegen.program.collection import uncollected
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.kernel import ProcessorKernel
from symphys.codegen.runtime.library import Loaded
from symphys.codegen.toolchain.cache import Cache, default_cache
from symphys.codegen.toolchain.compiler import Compiler, find_compiler
from symphys.codegen.toolchain.plans import KeptPlan
from symphys.codegen.toolchain.processes import ELSEWHERE
from symphys.codegen.toolchain.processor import processor
from symphys.codegen.toolchain.report import BuildReport
from symphys.codegen.toolchain.temporary import TemporaryFolder


def compile_program(
    program: Program,
    lanes: int | Literal["auto"] = "auto",
    precision: Literal["double", "single"] = "double",
    cache: Cache | None = None,
    seeded: Sequence[str] | None = None,
    threads: int | None = None,
) -> ProcessorKernel:
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
    single = precision == "single"
    names, width = names_of(program, seeded), width_of(lanes, single)
    return compiled(program, names, width, single, cache or default_cache(), threads)[0]


def compiled(
    program: Program, names: tuple[str, ...], width: int, single: bool, cache: Cache, threads: int | None
) -> tuple[ProcessorKernel, KeptPlan]:
    """The kernel of a program, and what is to be kept of it; see ``compile_program``."""
    started = time.perf_counter()
    with uncollected():
        planned = plan(program, names, width * (4 if single else 8))
        parts = sources(planned, width, single)
    operations = sum(len(graph.nodes) for graph, _ in planned.functions)
    kept = KeptPlan(program, planned, names, texts_of(parts), len(planned.functions), operations)
    with shared_library(parts, cache) as built:
        return kernel_of(built.path, kept, width, single, threads, started, built), kept


def kernel_of(
    path: Path,
    kept: KeptPlan,
    width: int,
    single: bool,
    threads: int | None,
    started: float,
    built: Built | None = None,
) -> ProcessorKernel:
    """A kernel from its library; ``built``: how that came there, None: it was kept."""
    loaded = Loaded(path, kept.program, kept.plan, kept.names)
    compiler = find_compiler()
    report = BuildReport(
        compiler=compiler.version,
        flags=compiler.flags(processor()),
        lanes=width,
        precision="single" if single else "double",
        functions=kept.functions,
        operations=kept.operations,
        bytes_per_lane=(2 * kept.program.size + kept.plan.tape) * (4 if single else 8),
        cached=built is None or built.cached,
        seconds=time.perf_counter() - started,
        note="" if built is None else built.note,
        arena=kept.plan.guarding.arena if kept.plan.guarding else 0,
    )
    return ProcessorKernel(kept.program, loaded, report, kept.names, threads)


def names_of(program: Program, seeded: Sequence[str] | None) -> tuple[str, ...]:
    """The outputs that can be differentiated; None: all. ProgramError names one that does not exist."""
    names = tuple(program.outputs if seeded is None else seeded)
    if unknown := [name for name in names if name not in program.outputs]:
        raise ProgramError(f"no output is called {unknown[0]!r}; there are {', '.join(program.outputs)}")
    return names


def width_of(lanes: int | Literal["auto"], single: bool) -> int:
    """How many lanes a block has."""
    if lanes == "auto":
        return processor().lanes(single)
    if lanes not in range(1, 65) or lanes & (lanes - 1):
        raise ProgramError(f"lanes must be a power of two from 1 to 64, not {lanes}")
    return lanes


@dataclass(frozen=True)
class Built:
    """A library on disk, and how it came there."""

    path: Path
    compiler: Compiler
    flags: tuple[str, ...]
    cached: bool
    note: str = ""


@contextmanager
def shared_library(parts: Sequence[SourceFile], cache: Cache) -> Iterator[Built]:
    """The library of these sources; what does not go into the cache lasts as long as the context."""
    compiler = find_compiler()
    flags = compiler.flags(processor())
    key = library_key(texts_of(parts), compiler, flags)
    if (path := cache.find(key)) is not None:
        yield Built(path, compiler, flags, cached=True)
        return
    with temporary_folder("symphys-kernel-") as folder:
        with cache.building(key):
            found = cache.find(key)  # another process may have built it meanwhile
            path, note = (found, "") if found else _kept(cache, key, compiler.build(parts, flags, Path(folder)))
        yield Built(path, compiler, flags, found is not None, note)


def texts_of(parts: Sequence[SourceFile]) -> str:
    """A checksum of C files."""
    return hashlib.sha256("\0".join(f"{part.fused} {part.text}" for part in parts).encode()).hexdigest()


def library_key(texts: str, compiler: Compiler, flags: Sequence[str]) -> str:
    """What the library of C files with that checksum is kept under."""
    return hashlib.sha256("\0".join([texts, *compiler.command, compiler.version, *flags]).encode()).hexdigest()[:32]


def _kept(cache: Cache, key: str, path: Path) -> tuple[Path, str]:
    """The library in the cache, or where it is and why."""
    try:
        return cache.store(key, path), ""
    except OSError as error:
        why = f"the kernel was not kept in {cache.folder} ({error.strerror}); it will be compiled again next time"
        return path, why


def temporary_folder(kind: str) -> TemporaryFolder:
    """See ``TemporaryFolder``; KernelUnavailable if there is no room for one."""
    try:
        return TemporaryFolder(kind)
    except OSError as error:
        where = f"the temporary folder {error.filename}" if error.filename else "a temporary folder"
        raise KernelUnavailable(f"{where} cannot be made: {error.strerror or error}; {ELSEWHERE}") from error
