"""Threads for blocks of lanes, and the memory in which they work."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any, TypeVar

import numpy as np

from symphys.codegen.runtime.library import Memory

ALIGNMENT = 64
"""[bytes] Size of the widest vector."""
T = TypeVar("T")


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
