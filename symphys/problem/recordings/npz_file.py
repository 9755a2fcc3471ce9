"""Arrays of an NPZ file as columns."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from symphys.archives import ArchiveError, read_arrays
from symphys.problem.recordings.columns import RecordedColumns, RecordingFault
from symphys.suggest import quote
from symphys.types import Array

MOST_BYTES = 2**29
"""[bytes] Largest memory of the arrays of one recording: some 67 million numbers."""


def read_npz(stream: BinaryIO, label: str, wanted: set[str], rows: str | None) -> tuple[RecordedColumns, Array | None]:
    """The columns, and (K + 1,) the first rows of recordings that follow each other, and the number of all rows.

    Args:
        stream: the file.
        label: what messages call it.
        wanted: the names of arrays that are used. Those that are missing are left out.
        rows: the name of the array of first rows; None: one recording.

    Raises:
        RecordingFault: names the array.
    """
    try:
        names, arrays = read_arrays(stream, wanted if rows is None else {*wanted, rows}, MOST_BYTES)
    except OSError as error:
        raise RecordingFault("files", f"{label} cannot be read: {error.strerror or 'it is no NPZ file'}") from None
    except ArchiveError as error:
        raise RecordingFault("files", f"{label} cannot be read: {error}") from None
    checked = {name: numbers(array, name, label) for name, array in arrays.items()}
    found = {name: values for name, values in checked.items() if name in wanted}
    starts = None if rows is None else checked.get(rows)
    counts = {name: len(values) for name, values in found.items()}
    if len(set(counts.values())) > 1:
        sizes = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise RecordingFault("files", f"{label}: all arrays need as many rows; there are: {sizes}")
    if 0 in counts.values():
        raise RecordingFault("files", f"{label} has no row of numbers")
    columns = RecordedColumns(label, found, names, 0, from_zero=True)
    if rows is not None:
        columns.require([rows], "rows")
    return columns, starts


def numbers(array: NDArray[np.generic], name: str, label: str) -> Array:
    """(n,) or (n, k): an array of finite numbers and NaN."""
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2) or (array.ndim == 2 and not array.shape[1]):
        kind = "numbers" if array.dtype.kind in "fiub" else f"{array.dtype}"
        text = f"must be numbers, a row for each time, not {kind} of shape {array.shape}"
        raise RecordingFault("files", f"{label}, array {quote(name)}: {text}")
    found = np.asarray(array, float)
    infinite = np.isinf(found)
    if infinite.any():
        row = int(np.argwhere(infinite)[0][0])
        raise RecordingFault("files", f"{label}, array {quote(name)}, row {row} (from 0): is not finite")
    return found
