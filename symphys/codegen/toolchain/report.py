"""How a kernel was built."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.codegen.runtime.library import Loaded
from symphys.codegen.runtime.thread_pool import MemoryPool


@dataclass(frozen=True)
class BuildReport:
    """How a kernel was built.

    Attributes:
        compiler: its version, in its own words.
        flags: what it was called with.
        lanes: rollouts in one block.
        precision: "double" or "single".
        functions: C functions, forward and adjoint.
        operations: nodes of their graphs together.
        bytes_per_lane: memory of one rollout with its adjoint; a block of lanes takes as many times that.
        cached: whether it came from the cache.
        seconds: from the program to the loaded kernel.
        note: what the user should know, or empty.
        arena: words of 8 bytes of a block, for what its driver notes.
    """

    compiler: str
    flags: tuple[str, ...]
    lanes: int
    precision: str
    functions: int
    operations: int
    bytes_per_lane: int
    cached: bool
    seconds: float
    note: str
    arena: int = 0

    def memories(self, lanes: int, loaded: Loaded) -> MemoryPool:
        """Memories for blocks of so many lanes of a library."""
        real = np.dtype(np.float32 if self.precision == "single" else np.float64)
        words = loaded.words + -(-8 * self.arena // (lanes * real.itemsize))
        return MemoryPool(words, lanes, real, loaded.prepare)
