"""The spaces in which a search moves: all variables, or deviations from its start that are splines of few knots.

A motion over time is found among few numbers sooner than among the many knots of its controls: hats of two to eight
knots over time are smooth enough to move a body, and too few to search in for long (spline-based predictive sampling,
Howell et al. 2022, arXiv 2212.00541).
"""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.shooting import ShootingProblem, VariableBlock
from symphys.types import Array

BOUNDED_SHARE, FREE_SCALES, FREE_SPREADS = 0.25, 2.0, 3.0
"""Unit of a deviation: this share of the distance of bounds; without them the larger multiple of scale or spread."""


@dataclass(frozen=True)
class SearchSpace:
    """An affine space of z, with coordinates x (d,).

    Attributes:
        start: (n,) z where a search begins.
        origin: (d,) x of it.
        scale: (d,) typical changes of x.
        lower, upper: (d,) bounds of x; equal where x is held.
        columns: (n, d) z = start + columns x; None: z = x.
    """

    start: Array
    origin: Array
    scale: Array
    lower: Array
    upper: Array
    columns: Array | None = None

    def z(self, x: Array) -> Array:
        """Return z (n,) of x (d,); perhaps outside the bounds of z."""
        return x if self.columns is None else self.start + self.columns @ x


def search_space(problem: ShootingProblem, start: Array, knots: int) -> SearchSpace:
    """Return the space of a search from ``start`` (n,); ``knots``: 0 for all variables, see ``CmaOptions``."""
    if not knots:
        bounds = problem.stacked("scale"), problem.stacked("lower"), problem.stacked("upper")
        return SearchSpace(start, start, *bounds)
    found = [column for block in problem.blocks for column in _columns(block, problem.n, knots)]
    columns = np.array(found).reshape(-1, problem.n).T
    ones = np.ones(columns.shape[1])
    return SearchSpace(start, 0 * ones, ones, -np.inf * ones, np.inf * ones, columns)


def _columns(block: VariableBlock, n: int, knots: int) -> list[Array]:
    """Return the columns (n,) of a block: for each component that is free as many as ``knots``, or as it has."""
    components, count = block.shape
    few = min(count, knots)
    at = np.linspace(0, few - 1, count) if few > 1 else np.zeros(count)
    hats = np.maximum(0, 1 - np.abs(at[:, None] - np.arange(few)))
    width = block.upper - block.lower
    free = np.maximum(FREE_SCALES * block.scale, FREE_SPREADS * block.spread)
    unit = np.where(np.isfinite(width), BOUNDED_SHARE * width, free)
    found = []
    for component in range(components):
        entries = block.start + component + components * np.arange(count)
        units = unit[component::components]
        for hat in hats.T:
            if (hat * units).any():
                column = np.zeros(n)
                column[entries] = hat * units
                found.append(column)
    return found
