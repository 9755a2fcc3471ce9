"""Seeds for the Jacobian of an output: rows that share no variable share a lane (Curtis, Powell, Reid 1974)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.codegen import Kernel
from symphys.codegen.backends.interface import Function
from symphys.types import Array


@dataclass(frozen=True)
class Seeds:
    """Which rows of a Jacobian (m, n) go into which lane.

    Attributes:
        words: (lanes, seeded words) the seed of each lane.
        shape: (m, n).
        rows, columns: (nonzeros,) where the Jacobian may differ from zero, column after column.
        lanes: (nonzeros,) the lane that tells each.
    """

    words: Array
    shape: tuple[int, int]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    lanes: NDArray[np.int64]

    @classmethod
    def whole(cls, kernel: Kernel, name: str) -> Seeds:
        """A lane for each row."""
        m, n = kernel.program.outputs[name].size, kernel.program.z.size
        columns, rows = np.divmod(np.arange(m * n), m)
        return cls(_words(kernel, name, np.eye(m)), (m, n), rows, columns, rows)

    @classmethod
    def compressed(cls, kernel: Kernel, name: str, function: Callable[[], Function], index: int) -> Seeds:
        """Color the sparsity of the result ``index`` of ``function()`` into as few lanes as possible."""
        m, n = kernel.program.outputs[name].size, kernel.program.z.size
        if m <= kernel.report.lanes:
            return cls.whole(kernel, name)
        sparsity = function().jac_sparsity(index, 0)
        shared = sparsity.T.uni_coloring()  # (m, lanes): a nonzero where a row goes into a lane
        row, lane = (np.array(part, dtype=np.int64) for part in (shared.get_triplet()))
        lane_of = np.zeros(m, dtype=np.int64)
        lane_of[row] = lane
        seeds = np.zeros((shared.size2(), m))
        seeds[lane, row] = 1
        rows, columns = (np.array(part, dtype=np.int64) for part in sparsity.get_triplet())
        return cls(_words(kernel, name, seeds), (m, n), rows, columns, lane_of[rows])

    def spread(self, slopes: Array) -> Array:
        """(batch, m, n) the Jacobians from the lanes' gradients (batch, lanes, n)."""
        jacobian = np.zeros((len(slopes), *self.shape))
        jacobian[:, self.rows, self.columns] = slopes[:, self.lanes, self.columns]
        return jacobian


def _words(kernel: Kernel, name: str, seeds: Array) -> Array:
    """The seeds of one output among those of all that can be differentiated."""
    sizes = [kernel.program.outputs[other].size for other in kernel.seeded]
    start = sum(sizes[: kernel.seeded.index(name)])
    words = np.zeros((len(seeds), sum(sizes)))
    words[:, start : start + seeds.shape[1]] = seeds
    return words
