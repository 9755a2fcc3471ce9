"""A kernel that takes large batches to a GPU where that is faster, by what it measures."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING

from symphys.codegen import KernelUnavailable, ProcessorKernel
from symphys.codegen.backends.interface import joined
from symphys.codegen.runtime.batch import RolloutBatch

if TYPE_CHECKING:
    from symphys.codegen.cuda import DeviceKernel

LARGE = 512
"""Rows below which no GPU is asked. A rollout there waits for its longest chain of calls, however few robots there are;
16 cores with AVX-512 do 128 robots in one go."""
Kind = tuple[bool, int]
"""With a gradient or without; the power of two of the rows."""


class FastestKernel(ProcessorKernel):
    """The processor, or a GPU for batches of a size for which it was faster when the first of that size came."""

    def __init__(self, kernel: ProcessorKernel, build: Callable[[], DeviceKernel], large: int = LARGE) -> None:
        """``build`` makes the same for a GPU, when a batch of ``large`` rows comes, or raises KernelUnavailable."""
        super().__init__(kernel.program, kernel.widths, kernel.report, kernel.seeded, kernel.threads)
        self._build, self._large, self._sought = build, large, False
        self._device: DeviceKernel | None = None
        self._gains: dict[Kind, float] = {}
        self._name = self._refused = ""

    @property
    def chosen(self) -> str:
        """What was decided so far, in a line, or empty."""
        parts = ", ".join(_told(*each) for each in sorted(self._gains.items()))
        return joined(super().chosen, parts and f"{self._name} against the processor: {parts}", self._refused)

    def _run(self, batch: RolloutBatch) -> None:
        kind = "gradient" in batch.results, batch.rows.bit_length() - 1
        device = self._reached() if batch.rows >= self._large and self._gains.get(kind, inf) > 1 else None
        try:
            if device is None:
                super()._run(batch)
            elif kind in self._gains:
                device._run(batch)
            else:
                self._gains[kind] = self._expected(batch) / _seconds(lambda: device._run(batch))
        except KernelUnavailable as error:
            self._device, self._refused = None, str(error)
            super()._run(batch)

    def _reached(self) -> DeviceKernel | None:
        """The GPU's kernel, if there is a GPU; it is looked for once."""
        if not self._sought:
            self._sought = True
            try:
                self._device = self._build()
                self._name = self._device.device.name
            except KernelUnavailable:
                return None  # most machines have no GPU, and nobody asked for it
        return self._device

    def _expected(self, batch: RolloutBatch) -> float:
        """[s] of the processor, from a block for each thread."""
        self.widths.finish()  # an interpreter says nothing of the processor
        width = self.widths.ready(batch.rows)
        lanes, rows = width.lanes, min(batch.rows, self.threads * width.lanes)
        blocks = [batch.part(first, min(first + lanes, rows)) for first in range(0, rows, lanes)]
        tasks = [partial(width.loaded.evaluate, block) for block in blocks]
        return _seconds(lambda: width.pool.run(tasks, self.threads)) * batch.rows / rows


def _seconds(call: Callable[[], None]) -> float:
    began = perf_counter()
    call()
    return perf_counter() - began


def _told(kind: Kind, gain: float) -> str:
    gradient, power = kind
    what = "gradients" if gradient else "values"
    return f"{what} of {2**power} to {2 ** (power + 1) - 1} rollouts {gain:.2g} times as fast"
