"""Builds the kernel of a program: plan, source, key, then the cache or the compiler."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from symphys.codegen.errors import KernelUnavailable, ProgramError
from symphys.codegen.program.collection import uncollected
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.kernel import BuildReport, ProcessorKernel
from symphys.codegen.runtime.library import LinkedCodes, Loaded
from symphys.codegen.runtime.widths import COMPILE_TIME, Widths, suited
from symphys.codegen.toolchain.cache import Cache, default_cache
from symphys.codegen.toolchain.compiler import find_compiler, processor
from symphys.codegen.toolchain.libraries import Built, library_key, shared_library, texts_of
from symphys.codegen.toolchain.plans import KeptPlan
from symphys.codegen.toolchain.source_file import SourceFile
from symphys.records import dataclass

if TYPE_CHECKING:  # what writes C is imported where it is called: a second start writes none
    from symphys.codegen.emit.planned import Plan

MIN_LONG_OPERATIONS = 2_000
"""Operations from which a kernel takes half a second or more to compile, and begins with an interpreter."""
MIN_ANNOUNCED_TIME = 30.0
"""[s] Estimated time of compiling from which it is announced."""


def compile_program(
    program: Program,
    lanes: int | Literal["auto"] = "auto",
    precision: Literal["double", "single"] = "double",
    cache: Cache | None = None,
    seeded: Sequence[str] | None = None,
    threads: int | None = None,
    rows: int | None = None,
    wait: bool = True,
) -> ProcessorKernel:
    """Build the kernel of a program, or take it from the cache.

    Args:
        program: what to compile.
        lanes: rollouts in one block, a power of two; "auto": what fills a vector register, and fewer for calls of few
            rows.
        precision: of the arithmetic; arguments and results are double always.
        cache: where kernels are kept; None: the user's.
        seeded: names of the outputs that can be differentiated; None: all.
        threads: how many blocks are computed at once; None: one for each processor.
        rows: how many rollouts most calls will have. What suits them is compiled at once, and what suits other calls
            when these have taken as long as compiling takes. None: many.
        wait: for the compiler; else see ``compiled``.

    Raises:
        KernelUnavailable: with one line that says why; the caller falls back.
    """
    single = precision == "single"
    width = BlockWidth(width_of(lanes, single), single, several=lanes == "auto")
    return compiled(program, names_of(program, seeded), width, cache or default_cache(), threads, rows, wait)[0]


@dataclass(frozen=True)
class BlockWidth:
    """The width of the blocks of a kernel.

    Attributes:
        lanes: rollouts in one block.
        single: whether in single precision.
        several: whether calls of one row have a library of one lane.
    """

    lanes: int
    single: bool
    several: bool = True

    @property
    def real(self) -> int:
        """Return the bytes of a number."""
        return 4 if self.single else 8


def compiled(
    program: Program,
    names: tuple[str, ...],
    width: BlockWidth,
    cache: Cache,
    threads: int | None,
    rows: int | None = None,
    wait: bool = True,
) -> tuple[ProcessorKernel, KeptPlan]:
    """Build the kernel of a program, or take it from the cache; return also its plan, to be kept.

    ``wait``: for the compiler; else a kernel of at least ``MIN_LONG_OPERATIONS`` operations begins with an interpreter,
    which is compiled from its second call on, and changes over once it is there. With $SYMPHYS_WAIT all wait.
    """
    from symphys.codegen.emit.packs import single_lane_plan
    from symphys.codegen.emit.plan import plan
    from symphys.codegen.emit.source import sources

    started = time.perf_counter()
    with uncollected():
        planned = plan(program, names, width.lanes * width.real)
        parts = sources(planned, width.lanes, width.single)
        own = single_lane_plan(planned) if width.several and width.lanes > 1 else None
    operations = sum(len(graph) for graph, _ in planned.functions)
    kept = KeptPlan(program, planned, names, texts_of(parts), len(planned.functions), operations, own)
    libraries = KeptLibraries(kept, width, cache)
    lanes = suited(rows, width.lanes) if rows is not None and width.several else width.lanes
    if lanes != width.lanes:
        parts = sources(own or planned, lanes, width.single, narrow=True)
    if not waits(operations, wait or lanes != width.lanes) and libraries.find(lanes) is None:
        with suppress(KernelUnavailable):
            first = lanes, libraries.interpreter(planned)
            kernel = kernel_of(first, libraries, threads, started, cached=False)
            kernel.widths.compile(parts, kept.texts, cache, partial(libraries.load, lanes=lanes))
            return kernel, kept
    announce(operations, libraries.find(lanes) is not None)
    with libraries.built(lanes, parts) as built:
        first = lanes, libraries.load(built.path, lanes)
        return kernel_of(first, libraries, threads, started, built.cached, built.note), kept


def waits(operations: int, wait: bool) -> bool:
    """Whether to wait for the compiler of a kernel of so many operations, which is asked for with ``wait`` or not."""
    return wait or operations < MIN_LONG_OPERATIONS or bool(os.environ.get("SYMPHYS_WAIT"))


def double_reference(program: Program, names: tuple[str, ...]) -> ProcessorKernel:
    """Build a kernel in double precision for a few rows; an interpreter where compiling would take long.

    Raises:
        KernelUnavailable: there is no compiler, or no cache for the interpreter.
    """
    from symphys.codegen.emit.plan import plan

    started, cache, width = time.perf_counter(), default_cache(), BlockWidth(width_of("auto", False), False, False)
    with uncollected():
        planned = plan(program, names, width.lanes * width.real)
    operations = sum(len(graph) for graph, _ in planned.functions)
    if operations < MIN_LONG_OPERATIONS:
        return compiled(program, names, width, cache, 1)[0]
    kept = KeptPlan(program, planned, names, "", len(planned.functions), operations, None)
    libraries = KeptLibraries(kept, width, cache)
    return kernel_of((width.lanes, libraries.interpreter(planned)), libraries, 1, started, cached=False)


def announce(operations: int, kept: bool) -> None:
    """Log a warning before a long compilation, unless the library is kept."""
    seconds = COMPILE_TIME[0] + COMPILE_TIME[1] * operations
    if seconds >= MIN_ANNOUNCED_TIME and not kept:
        text = "compiling %s operations takes about %.0f s of a processor; it is done once, and kept"
        logging.getLogger("symphys").warning(text, f"{operations:,}", seconds)


def kernel_of(
    first: tuple[int, Loaded],
    libraries: KeptLibraries,
    threads: int | None,
    started: float,
    cached: bool = True,
    note: str = "",
) -> ProcessorKernel:
    """Make a kernel that begins with the library ``first``, given with its lanes; ``cached``: whether it was kept."""
    kept, width, compiler = libraries.kept, libraries.width, find_compiler()
    report = BuildReport(
        compiler=compiler.version,
        flags=compiler.flags(processor()),
        lanes=width.lanes,
        precision="single" if width.single else "double",
        functions=kept.functions,
        operations=kept.operations,
        bytes_per_lane=(2 * kept.program.size + kept.plan.tape) * width.real,
        cached=cached,
        seconds=time.perf_counter() - started,
        note=note,
        arena=kept.plan.guarding.arena if kept.plan.guarding else 0,
    )
    patience = COMPILE_TIME[0] + COMPILE_TIME[1] * kept.operations
    widths = Widths(width.lanes, first, report.memories, libraries if width.several else None, patience)
    return ProcessorKernel(kept.program, widths, report, kept.names, threads)


@dataclass(frozen=True)
class KeptLibraries:
    """The libraries of one plan, which have the same functions and tables and differ in their lanes.

    Attributes:
        kept: the plan.
        width: the full one, for which it was planned.
        cache: where libraries are kept.
    """

    kept: KeptPlan
    width: BlockWidth
    cache: Cache

    def find(self, lanes: int) -> Loaded | None:
        """Return the library that was built before, or None; see ``widths.Libraries``."""
        compiler = find_compiler()
        path = self.cache.find(library_key(self._texts(lanes), compiler, compiler.flags(processor())))
        return None if path is None else self.load(path, lanes)

    def build(self, lanes: int) -> Loaded:
        """Build the library of ``lanes``; see ``widths.Libraries``."""
        from symphys.codegen.emit.packs import single_lane_plan
        from symphys.codegen.emit.plan import plan
        from symphys.codegen.emit.source import sources

        kept, width = self.kept, self.width
        with uncollected():
            planned = plan(kept.program, kept.names, width.lanes * width.real)
            planned = (single_lane_plan(planned) if lanes == 1 and kept.single_lane else None) or planned
            parts = sources(planned, lanes, width.single, lanes != width.lanes)
        with self.built(lanes, parts) as built:
            return self.load(built.path, lanes)

    def built(self, lanes: int, parts: Sequence[SourceFile]) -> AbstractContextManager[Built]:
        """Build the library of these C files; see ``shared_library``."""
        return shared_library(parts, self.cache, self._texts(lanes))

    def interpreter(self, planned: Plan) -> Loaded:
        """Return an interpreter of a plan's functions; KernelUnavailable without a cache to keep it in."""
        from symphys.codegen.emit.codes import codes_of, interpreter

        lanes, single = self.width.lanes, self.width.single
        codes = LinkedCodes(codes_of(planned.functions), lanes, np.float32 if single else np.float64)
        with shared_library([interpreter(lanes, single)], self.cache) as built:
            if built.note:
                raise KernelUnavailable(built.note)
            return Loaded(built.path, self.kept.program, self.kept.plan, self.kept.names, codes)

    def load(self, path: Path, lanes: int) -> Loaded:
        """Load the library of a file."""
        return Loaded(path, self.kept.program, self._plan(lanes), self.kept.names)

    def _plan(self, lanes: int) -> Plan:
        return self.kept.single_lane if lanes == 1 and self.kept.single_lane else self.kept.plan

    def _texts(self, lanes: int) -> str:
        """Return the identity of the C files, which differ by lanes, dialect and packing."""
        if lanes == self.width.lanes:
            return self.kept.texts
        from symphys.codegen.emit.source import forms_of

        return f"{self.kept.texts} {lanes} {forms_of(lanes)} {self._plan(lanes).signature}"


def names_of(program: Program, seeded: Sequence[str] | None) -> tuple[str, ...]:
    """Return the outputs that can be differentiated; None: all. ProgramError names one that does not exist."""
    names = tuple(program.outputs if seeded is None else seeded)
    if unknown := [name for name in names if name not in program.outputs]:
        raise ProgramError(f"no output is called {unknown[0]!r}; there are {', '.join(program.outputs)}")
    return names


def width_of(lanes: int | Literal["auto"], single: bool) -> int:
    """Return the number of lanes of a block."""
    if lanes == "auto":
        return processor().lanes(single)
    if lanes not in range(1, 65) or lanes & (lanes - 1):
        raise ProgramError(f"lanes must be a power of two from 1 to 64, not {lanes}")
    return lanes
