"""Which rows are which recording, and which recordings are held back."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np
from numpy.typing import NDArray

from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.suggest import hint, quote
from symphys.types import Array

MOST = 100_000
"""Recordings of one table."""


def pieces(columns: RecordedColumns, starts: Array | None, split: str | None) -> list[tuple[int, int]]:
    """The first row of each recording and that after its last one.

    Args:
        columns: of a file.
        starts: (K + 1,) first rows, and the number of all rows; None: not given.
        split: a column whose value differs from recording to recording; None: one recording.
    """
    if starts is not None:
        edges = first_rows(columns, starts)
    elif split is not None:
        values = columns.numbers(split, "split")
        missing = np.flatnonzero(np.isnan(values))
        if missing.size:
            raise RecordingFault("split", f"{columns.where(int(missing[0]), split)}: there is no number")
        edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1, [columns.count]])
    else:
        edges = np.array([0, columns.count])
    if len(edges) - 1 > MOST:
        key = "rows" if starts is not None else "split"
        raise RecordingFault(key, f"{columns.label} makes {len(edges) - 1:,} recordings; at most {MOST:,} are allowed")
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def first_rows(columns: RecordedColumns, starts: Array) -> NDArray[np.intp]:
    """(K + 1,): the rows as integers, in order, and within the file."""
    label, n = columns.label, columns.count
    if starts.ndim != 1 or starts.size < 2 or not np.all(starts == np.round(starts)):
        raise RecordingFault("rows", f"{label}: first rows must be two or more whole numbers, such as [0, 80, 210]")
    edges = starts.astype(np.intp)
    if edges[0] < 0 or edges[-1] > n or np.any(np.diff(edges) <= 0):
        text = f"first rows must increase, from 0 or more to {n}, the number of rows; they are {shown(edges)}"
        raise RecordingFault("rows", f"{label}: {text}")
    return edges


def shown(edges: NDArray[np.intp]) -> str:
    """The first and the last of some whole numbers."""
    few = edges.tolist()
    return str(few) if len(few) <= 6 else f"[{', '.join(map(str, few[:3]))}, ..., {few[-1]}]"


def held_back(wanted: bool | float | Sequence[int | str], names: Sequence[Sequence[str]]) -> list[bool]:
    """Which recordings are not fitted to.

    Args:
        wanted: all or none, a share that is spread evenly over them, or numbers from 0 and names.
        names: by what each recording is known: its own name, its file.
    """
    count = len(names)
    if isinstance(wanted, bool):
        return [wanted] * count
    if isinstance(wanted, float):
        held = [floor((k + 1) * wanted + 1e-9) > floor(k * wanted + 1e-9) for k in range(count)]
        if 0 < wanted < 1 and len(set(held)) == 1:
            text = f"{wanted:g} of {count} recordings is {'all' if held[0] else 'none'} of them; give a list"
            raise RecordingFault("held_back", text)
        return held
    chosen = [False] * count
    for each in wanted:
        own = [k for k in range(count) if (each == k if isinstance(each, int) else each in names[k])]
        if not own and isinstance(each, int):
            raise RecordingFault("held_back", f"there is no recording {each}; they are counted from 0 to {count - 1}")
        if not own:
            valid = [name for known in names for name in known[:1]]
            raise RecordingFault("held_back", f"there is no recording {quote(str(each))}; {hint(str(each), valid)}")
        for k in own:
            chosen[k] = True
    return chosen
