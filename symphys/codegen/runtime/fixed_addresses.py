"""One evaluation with its arguments and results at fixed addresses, for callers in C."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from symphys.codegen.runtime.batch import Array
from symphys.codegen.runtime.library import BatchData, Loaded, Memory


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
