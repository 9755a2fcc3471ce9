"""Which knots of the controls act in which step, and where each is decided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.shooting import StagedProblem

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class KnotStep:
    """The knots of one step, by their entries in z.

    Attributes:
        old: (o,) decided in steps before.
        new: (w,) decided here: it is the first step in which they act.
        weights: (m, o + w): u = weights @ z[old, new].
        kept: (o',) places among old and new of those that the next step has as its ``old``.
    """

    old: Indices
    new: Indices
    weights: Array
    kept: Indices

    @property
    def acting(self) -> Indices:
        """(o + w,)."""
        return np.concatenate([self.old, self.new])


def knot_steps(problem: StagedProblem) -> list[KnotStep]:
    """One for each step; knots that never act are in none."""
    steps, m = problem.steps, problem.input_size
    weights = problem.weights.tocsr()
    rows, columns = weights.nonzero()
    first, last = dict[int, int](), dict[int, int]()
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        k = row // max(m, 1)
        first[column] = min(k, first.get(column, k))
        last[column] = max(k, last.get(column, k))
    new = [np.array(sorted(c for c, k in first.items() if k == step), np.int64) for step in range(steps)]
    found: list[KnotStep] = []
    old = np.zeros(0, np.int64)
    for k in range(steps):
        acting = np.concatenate([old, new[k]])
        kept = np.array([i for i, column in enumerate(acting.tolist()) if last[column] > k], np.int64)
        block = weights[k * m : (k + 1) * m][:, acting].toarray()
        found.append(KnotStep(old, new[k], np.asarray(block, float), kept))
        old = acting[kept]
    return found
