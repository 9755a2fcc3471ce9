"""Tables of the numbers that a chart shows, thinned where it is drawn thinned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symphys.types import Array, Ints

Column = Array | Sequence[str] | Sequence[float]
"""Numbers, or words."""
Table = Mapping[str, Column]
"""Columns by name, with the unit, ``"ball.position.x [m]"``; the first is what the others are over."""
TIME = "time [s]"


def thin(time: Array, columns: Array, points: int = 700) -> tuple[Array, Array]:
    """Keep at most about ``points`` samples of (rows, k): the lowest and highest value of every stretch."""
    if len(time) <= points:
        return time, columns
    chosen = kept_rows(columns, points)
    return time[chosen], columns[chosen]


def thinned(columns: Table, points: int) -> Table:
    """Keep at most about ``points`` rows of a table of numbers, as ``thin`` does; all of one with words."""
    first, *others = (np.asarray(column) for column in columns.values())
    if len(first) <= points or first.dtype.kind == "U":
        return columns
    chosen = kept_rows(np.stack(others or [first], axis=1).astype(float), points)
    return {name: np.asarray(column)[chosen] for name, column in columns.items()}


def kept_rows(columns: Array, points: int) -> Ints:
    """Return the indices of the first, the last, and the extreme rows of every stretch of (rows, k) numbers."""
    rows = len(columns)
    stretches = np.array_split(np.arange(rows), max(points // (2 * columns.shape[1]), 30))
    filled = np.nan_to_num(columns, nan=0.0, posinf=0.0, neginf=0.0)
    kept = {0, rows - 1}
    for stretch in stretches:
        part = filled[stretch]
        kept.update(int(i) for i in stretch[np.concatenate([part.argmin(axis=0), part.argmax(axis=0)])])
    return np.array(sorted(kept))


def vector(name: str, unit: str, values: Array, components: str = "xyz") -> dict[str, Array]:
    """Return the columns of (rows, k) values by name: ``ball.position.x [m]``, ..."""
    end = f" [{unit}]" if unit else ""
    return {f"{name}.{component}{end}": values[:, k] for k, component in enumerate(components)}
