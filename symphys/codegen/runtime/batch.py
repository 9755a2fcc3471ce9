"""The arrays of a batch of rollouts, checked, and cut into parts for threads."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen.errors import ProgramError
from symphys.codegen.program.program import Place
from symphys.codegen.runtime.library import INPUTS, RESULTS, BatchData, RowSource
from symphys.codegen.runtime.thread_pool import Pace
from symphys.types import Array

PARTS_PER_THREAD = 4
"""Parts for each thread: small enough that one slow processor does not keep the others waiting."""


class RolloutBatch:
    """The arrays of one call; arrays of one row serve all lanes.

    Attributes:
        inputs: by the names "z", "parameters" and "seed", (rows, words), or (words,) for all.
        results: by the names "outputs", "gradient" and "trajectory", rows first.
        place, count: of the trajectory.
        discount, skipped: see ``Kernel.gradient``.
        rows: how many.
    """

    def __init__(self, inputs: Mapping[str, tuple[ArrayLike, int]]) -> None:
        """Check name -> (values, words in a row); ProgramError names the shape that is needed."""
        self.inputs: dict[str, Array] = {}
        self.results: dict[str, Array] = {}
        self.place, self.count, self.discount, self.skipped = Place(0, 0), 0, 0.0, 0
        for name, (values, size) in inputs.items():
            array = np.ascontiguousarray(values, dtype=np.float64)
            if array.ndim not in (1, 2) or array.shape[-1] != size:
                raise ProgramError(f"{name} has the shape {array.shape}; wanted is (batch, {size}) or ({size},)")
            self.inputs[name] = array
        lengths = {len(array) for array in self.inputs.values() if array.ndim == 2}
        if len(lengths) > 1:
            raise ProgramError(f"the batch sizes {sorted(lengths)} of {', '.join(self.inputs)} differ")
        self.rows = lengths.pop() if lengths else 1

    def outputs(self, width: int) -> Array:
        """Ask for the outputs; return the array that they will be written to."""
        return self._result("outputs", (self.rows, width))

    def gradient(self, width: int) -> Array:
        """Ask for the gradient; return its array."""
        return self._result("gradient", (self.rows, width))

    def trajectory(self, place: Place, count: int) -> Array:
        """Ask for the words of a place at ``count`` steps; return their array."""
        self.place, self.count = place, count
        return self._result("trajectory", (self.rows, count, place.size))

    def _result(self, name: str, shape: tuple[int, ...]) -> Array:
        self.results[name] = np.empty(shape)
        return self.results[name]

    def parts(self, lanes: int, threads: int, pace: Pace) -> list[BatchData]:
        """Cut the batch into parts of whole blocks: a few for each thread, one where all is done at once."""
        blocks = -(-self.rows // lanes)
        count = 1 if threads == 1 else pace.parts(blocks, PARTS_PER_THREAD * threads)
        ends = [lanes * (blocks * i // count) for i in range(count)]
        return [self.part(a, min(b, self.rows)) for a, b in zip(ends, [*ends[1:], self.rows], strict=True)]

    def part(self, start: int, end: int) -> BatchData:
        """Return the rows from start to end; the arrays must outlive it."""
        sources = [_rows(self.inputs.get(name), start) for name in INPUTS]
        arrays = [self.results.get(name) for name in RESULTS]
        results = [None if each is None else each.ctypes.data + start * each.strides[0] for each in arrays]
        place = self.place
        numbers = place.offset, place.size, place.stride, self.count, self.discount, self.skipped
        return BatchData(end - start, *sources, *results, *numbers)


def _rows(array: Array | None, start: int) -> RowSource:
    if array is None:
        return RowSource(None, 0)
    stride = array.shape[1] if array.ndim == 2 else 0
    return RowSource(array.ctypes.data + 8 * start * stride, stride)
