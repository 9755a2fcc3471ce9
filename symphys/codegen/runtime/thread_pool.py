"""Threads for blocks of lanes, and the memory in which they work."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from math import inf
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from symphys.codegen.runtime.library import Memory

MIN_PART = 2e-4
"""[s] that a part of a call takes at least where it is shared among threads: handing it over takes some 50 us."""
ALIGNMENT = 64
"""[bytes] Size of the widest vector."""
T = TypeVar("T")


class Pace:
    """The measured time of a block of lanes, and into how many parts for threads a call is cut by it."""

    def __init__(self) -> None:
        """Know nothing: the first call is cut as finely as may be."""
        self._block = inf

    def parts(self, blocks: int, most: int) -> int:
        """Return into how many parts to cut so many blocks, at most ``most``; 1 where sharing does not pay."""
        worth = min(blocks * self._block / MIN_PART, most) if blocks else 0
        return min(blocks, max(int(worth), 1))

    def measured(self, task: Callable[[Memory], None], blocks: int) -> Callable[[Memory], None]:
        """Return the task, which takes note of its time."""

        def run(memory: Memory) -> None:
            began = perf_counter()
            task(memory)
            took = (perf_counter() - began) / max(blocks, 1)
            self._block = min(took, 1.1 * self._block)  # the shortest of late: others waited for a processor

        return run


class MemoryPool:
    """Memories of one shape that are reused; a task has one for itself while it runs."""

    def __init__(self, words: int, lanes: int, real: Any, prepare: Callable[[Memory], None] | None = None) -> None:
        """Manage memories of (words, lanes) numbers of this type; ``prepare`` initialises one."""
        self._prepare = prepare
        self._shape, self._real = (words, lanes), np.dtype(real)
        self._free: list[Memory] = []

    def run(self, tasks: Sequence[Callable[[Memory], None]], threads: int) -> None:
        """Run all tasks, at most ``threads`` at once."""
        if threads == 1 or len(tasks) < 2:
            for task in tasks:
                self.lend(task)
        else:
            list(_executor(os.getpid(), threads).map(self.lend, tasks))

    def begin(self, tasks: Sequence[Callable[[Memory], None]], threads: int) -> list[Callable[[], None]]:
        """Start all tasks in their order, at most ``threads`` at once; return a function that waits for each.

        With one thread a task is run when it is waited for.
        """
        if threads == 1:
            return [partial(self.lend, task) for task in tasks]
        return [_executor(os.getpid(), threads).submit(self.lend, task).result for task in tasks]

    def lend(self, task: Callable[[Memory], T]) -> T:
        """Run one task here, in a memory of its own."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = self.new()
        try:
            return task(memory)
        finally:
            self._free.append(memory)

    def new(self) -> Memory:
        """Allocate a memory that belongs to the caller."""
        alignment = max(ALIGNMENT, self._shape[1] * self._real.itemsize)
        size = int(np.prod(self._shape)) * self._real.itemsize
        raw = np.empty(size + alignment, dtype=np.uint8)
        start = -raw.ctypes.data % alignment
        memory = raw[start : start + size].view(self._real).reshape(self._shape)
        if self._prepare is not None:
            self._prepare(memory)
        return memory


@cache
def _executor(process: int, threads: int) -> ThreadPoolExecutor:
    """Return the threads of this process: those of a parent do not survive in a child."""
    return ThreadPoolExecutor(threads, thread_name_prefix="symphys-kernel")
