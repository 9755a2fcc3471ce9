"""Evaluations with arguments and results at fixed addresses: for callers in C, and for small batches in a loop."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from symphys.codegen.runtime.library import BatchData, Loaded, Memory
from symphys.codegen.runtime.widths import Widths
from symphys.types import Array


@dataclass(frozen=True)
class Fixed:
    """``evaluate(program, batch, memory)`` at ``address`` reads and writes these arrays; they live as long as this.

    Attributes:
        loaded: the kernel's library.
        batch: the driver's.
        memory: of its own.
        z, parameters: (n,) and (p,), read.
        outputs: (rows, width) all outputs in their order, written.
        gradient: (rows, n), written; empty where there is no seed.
        seed: (rows, s), read; empty likewise.
    """

    loaded: Loaded
    batch: BatchData
    memory: Memory
    z: Array
    parameters: Array
    outputs: Array
    gradient: Array
    seed: Array

    @property
    def addresses(self) -> tuple[int, int, int, int]:
        """Of the function, the program, the batch and the memory."""
        function, data = self.loaded.addresses
        return function, data, ctypes.addressof(self.batch), int(self.memory.ctypes.data)


@dataclass(frozen=True)
class FixedBatch:
    """A small batch that is evaluated again and again: ``run`` reads and writes these arrays, on one thread.

    Attributes:
        widths: the kernel's libraries.
        batch: the driver's.
        z, parameters: (rows, n) and (rows, p), read; 0 at first.
        outputs: (rows, width) all outputs in their order, written.
    """

    widths: Widths
    batch: BatchData
    z: Array
    parameters: Array
    outputs: Array

    def run(self) -> None:
        """Evaluate."""
        self.widths.run_part(self.batch)
