"""A compiled Jacobian: batches of points over threads."""

from __future__ import annotations

import ctypes
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.codegen.emit.codes import SLOPES_DRIVER, codes_of, interpreter
from symphys.codegen.emit.source import MAX_FILES, listed, spread
from symphys.codegen.emit.writer import write
from symphys.codegen.errors import KernelUnavailable, ProgramError
from symphys.codegen.program.collection import uncollected
from symphys.codegen.program.program import Program
from symphys.codegen.runtime.kernel import BuildReport
from symphys.codegen.runtime.library import LinkedCodes
from symphys.codegen.runtime.thread_pool import MemoryPool, Pace
from symphys.codegen.slopes.kept import KeptSlopes
from symphys.codegen.slopes.plan import SlopePlan, slope_plan
from symphys.codegen.toolchain.build import waits
from symphys.codegen.toolchain.cache import Cache, default_cache
from symphys.codegen.toolchain.compiler import processor, processors
from symphys.codegen.toolchain.libraries import Built, kept_library, loaded, shared_library, texts_of
from symphys.codegen.toolchain.processes import Background
from symphys.codegen.toolchain.source_file import SourceFile, resource
from symphys.codegen.toolchain.warm_start import ProgramSource, found, keep
from symphys.types import Array, Ints

WORD = ctypes.c_int64
POINTER = ctypes.c_void_p
SHARED = "#define ALL(x) ((R)(x) - (V){0})\n"
"""A number of the memory in all lanes: unlike the S of a constant it needs no sum."""
ITEM_BYTES = 40
"""Bytes of what is done for a block of rows: the driver's ``item``."""
PARTS_PER_THREAD = 4
"""Parts of a batch for each thread; see ``RolloutBatch``."""


class _Block(ctypes.Structure):
    _fields_ = (("taken", POINTER), ("rows", POINTER), ("left", WORD), ("words", POINTER))


class _Slopes(ctypes.Structure):
    _fields_ = (
        *((name, WORD) for name in ("size", "tape", "adjoints", "height", "width", "result")),
        *((name, WORD) for name in ("z", "z_size", "parameters", "parameters_size")),
        ("seeds", POINTER),
        ("length", WORD),
        ("entries", POINTER),
        *((name, WORD) for name in ("pulls", "items")),
        *((name, POINTER) for name in ("back", "calls", "copies", "uses", "cells")),
        ("cell_count", WORD),
        ("blocks", WORD),
        ("rows", POINTER),
        *((name, WORD) for name in ("kept", "reads")),
        ("read", POINTER),
    )


class _Points(ctypes.Structure):
    _fields_ = (
        ("points", WORD),
        *((name, POINTER) for name in ("z", "parameters")),
        *((name, WORD) for name in ("shared", "columns")),
        ("jacobian", POINTER),
    )


class LoadedSlopes:
    """A library of Jacobians with the tables that it walks.

    Attributes:
        data: the driver's.
        words: of its memory.
    """

    def __init__(self, path: Path, kept: KeptSlopes, output: str, lanes: int, codes: LinkedCodes | None = None) -> None:
        """Load the library; KernelUnavailable if the system refuses. ``codes``: for an interpreter."""
        library = loaded(path)
        self._evaluate = library.jacobians
        self._evaluate.argtypes, self._evaluate.restype = (POINTER, POINTER, POINTER), None
        self._kept: list[Any] = [codes]
        self._codes = codes
        self.data = self._slopes(kept.program, kept.plan, kept.program.outputs[output].size, lanes)
        listed = (ITEM_BYTES * self.data.items + self.data.cell_count) // (8 * lanes) + 1
        self.words = kept.program.size + kept.plan.tape + self.data.kept + kept.plan.adjoints + listed

    def evaluate(self, points: _Points, memory: Any) -> None:
        """Compute Jacobians in this memory."""
        self._evaluate(ctypes.byref(self.data), ctypes.byref(points), memory.ctypes.data)

    def _slopes(self, program: Program, planned: SlopePlan, height: int, lanes: int) -> _Slopes:
        blocks = (_Block * max(len(planned.blocks), 1))()
        for block, plan in zip(blocks, planned.blocks, strict=False):
            numbers = [*plan.rows, *[-1] * (lanes - len(plan.rows))]
            block.taken, block.rows = self._put(plan.taken), self._words(numbers)
            block.left, block.words = len(plan.left), self._words(plan.left)
        self._kept.append(blocks)
        z, parameters, back = program.z, program.parameters, planned.backward
        return _Slopes(
            *(program.size, planned.tape, planned.adjoints, height, z.size, planned.result),
            *(z.offset, z.size, parameters.offset, parameters.size),
            self._words(planned.seeds),
            len(planned.forward),
            self._entries(planned.forward),
            len(back.calls) - 1,
            len(back.calls) + len(back.copies) + len(back.uses),
            self._entries(back.entries),
            *map(self._words, (back.calls, back.copies, back.uses, back.cells)),
            len(back.cells),
            len(planned.blocks),
            ctypes.addressof(blocks),
            int(planned.read[:, 1].sum()),
            len(planned.read),
            self._words(planned.read),
        )

    def _entries(self, entries: Ints) -> int:
        return self._words(entries if self._codes is None else self._codes.linked(entries))

    def _words(self, values: ArrayLike) -> int:
        words = np.ascontiguousarray(values, np.int64).ravel()
        return self._put(words if words.size else np.zeros(1, np.int64))

    def _put(self, values: NDArray[Any]) -> int:
        self._kept.append(values)
        return int(values.ctypes.data)


class SlopeKernel:
    """The Jacobian of one output of a program by its z. A point's numbers do not depend on the other points.

    Attributes:
        program, output: of what.
        report: on how it was built.
        threads: that share a batch.
        library: what evaluates; that of an interpreter until the kernel is compiled.
    """

    def __init__(
        self, program: Program, output: str, library: LoadedSlopes, report: BuildReport, threads: int | None
    ) -> None:
        """Use ``compile_slopes``."""
        self.program, self.output, self.report, self.library = program, output, report, library
        self.threads = processors() if threads is None else threads
        self._pool, self._pace = MemoryPool(library.words, report.lanes, np.float64), Pace()
        self._compiling: Background | None = None

    def compile(self, parts: Sequence[SourceFile], kept: KeptSlopes, cache: Cache) -> None:
        """Compile the library in the background, and change over to it once it is there; see ``Background``."""

        def done(path: Path) -> None:
            self.library = LoadedSlopes(path, kept, self.output, self.report.lanes)

        def failed(why: str) -> None:
            logging.getLogger("symphys").warning("an interpreter evaluates Jacobians, which is slower: %s", why)

        self._compiling = Background(parts, kept.texts, cache, done, failed)

    def finish(self) -> None:
        """Wait for the library that is being compiled, if there is one."""
        if self._compiling is not None:
            self._compiling.finish()

    def jacobians(self, Z: ArrayLike, parameters: ArrayLike, columns: int | None = None) -> Array:
        """(B, n) and (B, p), or (p,) for all points -> (B, outputs, columns): by the first of z; None: by all."""
        z, given, found = self._arguments(Z, parameters, columns)
        parts = self._parts(len(z), 1 if self.threads == 1 else PARTS_PER_THREAD * self.threads)
        self._pool.run(self._tasks(parts, z, given, found), self.threads)
        return found

    def jacobians_from_end(self, Z: ArrayLike, parameters: ArrayLike, columns: int | None = None) -> Iterator[Array]:
        """Yield Jacobians in a few runs of points, the last run first; all runs start at once."""
        z, given, found = self._arguments(Z, parameters, columns)
        runs = self._parts(len(z), PARTS_PER_THREAD * self.threads)[::-1]
        waits = self._pool.begin(self._tasks(runs, z, given, found), self.threads)
        return (found[a:b] for (a, b), wait in zip(runs, waits, strict=True) if wait() is None)

    def _parts(self, points: int, most: int) -> list[tuple[int, int]]:
        """Return first and last of at most so many parts of whole blocks."""
        lanes = self.report.lanes
        blocks = -(-points // lanes)
        parts = self._pace.parts(blocks, most)
        return [*pairwise(min(lanes * (blocks * i // parts), points) for i in range(parts + 1))] if parts else []

    def _tasks(
        self, parts: Sequence[tuple[int, int]], z: Array, given: Array, found: Array
    ) -> list[Callable[[Any], None]]:
        """Return what computes each part."""
        lanes = self.report.lanes
        return [self._pace.measured(partial(self._run, z, given, found, a, b), -(-(b - a) // lanes)) for a, b in parts]

    def _arguments(self, Z: ArrayLike, parameters: ArrayLike, columns: int | None) -> tuple[Array, Array, Array]:
        """Check both; return them and the array of the Jacobians."""
        z, given = (np.ascontiguousarray(each, float) for each in (Z, parameters))
        self._check("Z", z, (2,), self.program.z.size)
        self._check("parameters", given, (1, 2), self.program.parameters.size)
        if given.ndim == 2 and len(given) != len(z):
            raise ProgramError(f"the batch sizes {len(z)} of Z and {len(given)} of parameters differ")
        data = self.library.data
        return z, given, np.empty((len(z), data.height, data.width if columns is None else columns))

    def _run(self, z: Array, given: Array, found: Array, first: int, last: int, memory: Any) -> None:
        shared = given.ndim == 1
        row = given if shared else given[first:]
        addresses = z[first:].ctypes.data, row.ctypes.data, int(shared), found.shape[2], found[first:].ctypes.data
        batch = _Points(last - first, *addresses)
        self.library.evaluate(batch, memory)

    def _check(self, name: str, values: Array, dimensions: tuple[int, ...], size: int) -> None:
        if values.ndim not in dimensions or values.shape[-1] != size:
            raise ProgramError(f"{name} has the shape {values.shape}; wanted is (batch, {size})")


def compile_slopes(
    program: Program | ProgramSource,
    output: str,
    cache: Cache | None = None,
    threads: int | None = None,
    wait: bool = True,
    before: Callable[[], None] | None = None,
) -> SlopeKernel:
    """Build the Jacobian of an output of a program by z, in double precision, or take it from the cache.

    Args:
        program: of one step. A source is not asked for its program where the Jacobian is kept.
        output: which of its outputs.
        cache: where kernels are kept; None: the user's.
        threads: how many blocks of points are computed at once; None: one for each processor.
        wait: for the compiler; else see ``build.compiled``.
        before: called before the compiler starts, to wait for kernels that are compiled first; None: for none.

    Raises:
        KernelUnavailable: with one line that says why; the caller falls back.
    """
    started, lanes, cache = time.perf_counter(), processor().lanes(False), cache or default_cache()
    source = program if isinstance(program, ProgramSource) else ProgramSource(lambda: program)
    key = source.key(lanes, "slopes", output)
    kept = None if key is None else found(key, lambda path: KeptSlopes.read(path, source.make), cache)
    built = None if kept is None else kept_library(kept.texts, cache)
    if kept is not None and built is not None:
        return _kernel(kept, built, LoadedSlopes(built.path, kept, output, lanes), output, lanes, started, threads)
    # plan the Jacobian, and keep the plan
    whole = source.make()
    with uncollected():
        planned = slope_plan(whole, output, lanes)
        if whole.zeroed or whole.constants:
            raise ProgramError("slopes are of programs without constants")
        parts = _sources(planned, lanes)
    operations = sum(len(graph) for graph, _ in planned.functions)
    kept = KeptSlopes(whole, planned, texts_of(parts), len(planned.functions), operations)
    if key is not None:
        keep(key, kept.write, cache)
    if before is not None:
        before()
    # begin with an interpreter where the compiler takes long
    if not waits(operations, wait) and kept_library(kept.texts, cache) is None:
        with suppress(KernelUnavailable):
            codes = LinkedCodes(codes_of(planned.functions), lanes, np.float64)
            with shared_library([interpreter(lanes, False, SLOPES_DRIVER)], cache) as built:
                if built.note:
                    raise KernelUnavailable(built.note)
                library = LoadedSlopes(built.path, kept, output, lanes, codes)
            kernel = _kernel(kept, replace(built, cached=False), library, output, lanes, started, threads)
            kernel.compile(parts, kept, cache)
            return kernel
    with shared_library(parts, cache, kept.texts) as built:
        library = LoadedSlopes(built.path, kept, output, lanes)
    return _kernel(kept, built, library, output, lanes, started, threads)


def _kernel(
    kept: KeptSlopes, built: Built, library: LoadedSlopes, output: str, lanes: int, started: float, threads: int | None
) -> SlopeKernel:
    """Make the kernel of a library and its plan."""
    program, planned = kept.program, kept.plan
    report = BuildReport(
        compiler=built.compiler.version,
        flags=built.flags,
        lanes=lanes,
        precision="double",
        functions=kept.functions,
        operations=kept.operations,
        bytes_per_lane=8 * (program.size + planned.tape + planned.adjoints),
        cached=built.cached,
        seconds=time.perf_counter() - started,
        note=built.note,
    )
    return SlopeKernel(program, output, library, report, threads)


def _sources(planned: SlopePlan, lanes: int) -> list[SourceFile]:
    """Return the C files. Values have no fused products, so that they are casadi's to the bit."""
    head = f"#define LANES {lanes}\n#define SINGLE 0\n{resource('vector.h')}{SHARED}"
    texts = [write(f"f{number}", graph, form) for number, (graph, form) in enumerate(planned.functions)]
    found = []
    for backward in (False, True):
        mine = [i for i, (_, form) in enumerate(planned.functions) if form.backward == backward]
        work = [len(planned.functions[i][0]) for i in mine]
        for group in spread([texts[i] for i in mine], work, MAX_FILES):
            found.append(SourceFile("\n".join([head, *group]), straight=True, broadcasts=True))
    return [*found, SourceFile(head + listed(len(planned.functions)) + resource("slopes.c"))]
