"""The two libraries of one program, of one lane and of all: which one computes a call, and when it is made.

One rollout in a block of 8 lanes wastes 7 of them, so calls of one row have a library of their own. Both give the same
bits.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Protocol

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.runtime.batch import RolloutBatch
from symphys.codegen.runtime.library import BatchData, Loaded, Memory
from symphys.codegen.runtime.thread_pool import MemoryPool, Pace
from symphys.codegen.toolchain.cache import Cache
from symphys.codegen.toolchain.processes import Background
from symphys.codegen.toolchain.source_file import SourceFile
from symphys.records import dataclass

COMPILE_TIME = 2.0, 1e-4
"""Estimate of the time of compiling: [s], and [s] for each operation of the kernel."""


class Libraries(Protocol):
    """Source of the libraries of a program."""

    def find(self, lanes: int) -> Loaded | None:
        """Return the library that was built before, or None; KernelUnavailable if it cannot be loaded."""

    def build(self, lanes: int) -> Loaded:
        """Build a new library; KernelUnavailable if that cannot be."""


@dataclass(frozen=True)
class LoadedWidth:
    """A library, memories for its blocks, and how long one takes."""

    lanes: int
    loaded: Loaded
    pool: MemoryPool
    pace: Pace


Choice = tuple[LoadedWidth, int]
"""The library for a call, and the lanes that would suit it better; 0: none."""


def suited(rows: int, full: int) -> int:
    """Return the lanes that suit a call: one for one row, otherwise ``full``, those of a vector register."""
    return 1 if rows == 1 else full


class Widths:
    """The libraries of one program that are loaded.

    A call runs on the best library that is loaded or kept in the cache. A better one is compiled once calls without it
    have taken as long as compiling takes, so that nobody waits for a library that pays too little.
    """

    def __init__(
        self,
        full: int,
        first: tuple[int, Loaded],
        pool: Callable[[int, Loaded], MemoryPool],
        libraries: Libraries | None,
        patience: float,
    ) -> None:
        """Begin with one library.

        Args:
            full: lanes of a vector register.
            first: lanes and library.
            pool: makes memories for a library of so many lanes.
            libraries: where others come from; None: there are no others.
            patience: [s] that calls may take before a library that suits them better is compiled.
        """
        self.full, self.patience = full, patience
        self._pool, self._libraries = pool, libraries
        self._widths: dict[int, LoadedWidth] = {}
        self._choices: dict[int, Choice] = {}
        self._sought, self._spent = {first[0]}, dict[int, float]()
        self._lock = threading.Lock()
        self._compiling: Background | None = None
        self._begin: Callable[[], None] | None = None
        self._called = False
        self._note = ""
        self._add(*first)

    @property
    def loaded(self) -> dict[int, LoadedWidth]:
        """Return the loaded libraries, by lanes."""
        return dict(self._widths)

    @property
    def note(self) -> str:
        """Return a message for the user on the library that was compiled meanwhile, or empty."""
        return self._note

    def compile(self, parts: Sequence[SourceFile], texts: str, cache: Cache, load: Callable[[Path], Loaded]) -> None:
        """Compile the library of all lanes in the background, and change over to it once it is there.

        It begins with the second call: what is called once costs less than its library. See ``Background``; ``load``
        loads it.
        """

        def done(path: Path) -> None:
            loaded = load(path)
            with self._lock:
                self._spent.clear()  # of an interpreter
                self._add(self.full, loaded)

        def failed(why: str) -> None:
            self._note = f"an interpreter evaluates, which is slower: {why}"

        def begin() -> None:
            try:
                self._compiling = Background(parts, texts, cache, done, failed)
            except KernelUnavailable as error:
                failed(str(error))

        self._begin = begin

    def begin(self) -> None:
        """Begin to compile the library of all lanes, if that was put off."""
        with self._lock:
            begin, self._begin = self._begin, None
        if begin is not None:
            begin()

    def finish(self) -> None:
        """Wait for the library that is being compiled, if there is one."""
        self.begin()
        if self._compiling is not None:
            self._compiling.finish()

    def ready(self, rows: int) -> LoadedWidth:
        """Return the library that computes a call of ``rows`` at present; nothing is compiled."""
        return self._chosen(rows)[0]

    def run(self, batch: RolloutBatch, threads: int) -> None:
        """Compute a batch, its blocks spread over threads."""
        width, missing = self._chosen(batch.rows)
        self._timed(width, missing, batch.parts(width.lanes, threads, width.pace), threads)

    def run_part(self, part: BatchData) -> None:
        """Compute a part of a batch on this thread."""
        self._timed(*self._chosen(part.rows), [part], 1)

    def _chosen(self, rows: int) -> Choice:
        """Return the library for calls of ``rows``, and the lanes that would suit them better; 0: none."""
        choices = self._choices  # a library that comes meanwhile begins new ones
        if (choice := choices.get(rows)) is not None:
            return choice
        lanes = suited(rows, self.full)
        if self._libraries is not None and lanes not in self._sought:
            self._seek(lanes, self._libraries)
        widths = self._widths
        width = widths.get(lanes) or next(iter(widths.values()))
        missing = 0 if self._libraries is None or width.lanes == lanes else lanes
        choices[rows] = width, missing
        return width, missing

    def _timed(self, width: LoadedWidth, missing: int, parts: Sequence[BatchData], threads: int) -> None:
        """Compute parts, and build a better library once calls without it have taken as long as compiling does."""
        if self._begin is not None and self._called:
            self.begin()
        self._called, began = True, perf_counter()
        tasks: list[Callable[[Memory], None]] = [partial(width.loaded.evaluate, part) for part in parts]
        if threads > 1:
            pairs = zip(tasks, parts, strict=True)
            tasks = [width.pace.measured(task, -(-part.rows // width.lanes)) for task, part in pairs]
        width.pool.run(tasks, threads)
        if missing and self._libraries is not None:
            self._spent[missing] = self._spent.get(missing, 0.0) + perf_counter() - began
            if self._spent[missing] >= self.patience and not (self._compiling and self._compiling.running):
                self._build(missing, self._libraries)

    def _seek(self, lanes: int, libraries: Libraries) -> None:
        """Load a library that was built before; it is looked for once."""
        with self._lock:
            if lanes in self._sought:
                return
            self._sought.add(lanes)
            with suppress(KernelUnavailable):
                if (found := libraries.find(lanes)) is not None:
                    self._add(lanes, found)

    def _build(self, lanes: int, libraries: Libraries) -> None:
        """Compile a library, unless another thread does or it cannot be made."""
        if not self._lock.acquire(blocking=False):
            return
        try:
            if lanes not in self._widths:
                self._add(lanes, libraries.build(lanes))
            self._choices = {}
        except KernelUnavailable:
            self._spent[lanes] = -inf
        finally:
            self._lock.release()

    def _add(self, lanes: int, loaded: Loaded) -> None:
        self._widths = {**self._widths, lanes: LoadedWidth(lanes, loaded, self._pool(lanes, loaded), Pace())}
        self._choices = {}
