"""Columns of numbers over time: from a CSV file with a header, an NPZ file, or a table; faults name row and column."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from symphys.archives import ArchiveError, read_arrays
from symphys.errors import ProblemError
from symphys.files import check_regular
from symphys.problem.reading.range_of_numbers import LARGEST, TOO_LARGE
from symphys.problem.reading.source import read_source
from symphys.problem.schema.checks import IDENTIFIER
from symphys.suggest import quote
from symphys.types import Array

TIME = "time"
LEAST_ROWS, MOST_ROWS = 2, 1000
"""Each row is looked at in every evaluation of a formula."""
MOST_BYTES = 10**7
"""[bytes] Largest memory of the arrays of an NPZ file: a thousand rows of a thousand columns."""


class SeriesError(ValueError):
    """Why columns are no time series."""


def series_text(path: Path) -> str:
    """The content of a file as text of a CSV file; SeriesError if there is no such file, or one of another kind."""
    try:
        if path.suffix.lower() != ".npz":
            return read_source(path)
        check_regular(path)
        with path.open("rb") as file:
            _, columns = read_arrays(file, most=MOST_BYTES)
    except ProblemError as error:
        raise SeriesError(f"{path}: {error.issues[0].message}") from None
    except (OSError, ArchiveError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SeriesError(f"{path} cannot be read: {reason}") from None
    for name, column in columns.items():
        if column.dtype.kind not in "fiu" or column.ndim != 1:
            raise SeriesError(f"{path}, array {quote(name)}: must be numbers, one for each time, not {column.shape}")
        if column.size > MOST_ROWS:
            raise SeriesError(f"{path} has {column.size} rows of numbers; {LEAST_ROWS} to {MOST_ROWS} are allowed")
    return written({name: column.tolist() for name, column in columns.items()}, str(path))


def written(columns: Mapping[str, Sequence[float]], file: str) -> str:
    """The text of a CSV file with these columns."""
    if len({len(column) for column in columns.values()}) > 1:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in columns.items())
        raise SeriesError(f"{file}: all columns need as many numbers; there are: {sizes}")
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def read_series(text: str, file: str) -> tuple[Array, dict[str, Array]]:
    """Times (n,) [s], and by name the numbers (n,) at these times, of the text of a CSV file."""
    lines = [line for line in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in line)]
    header = [cell.strip() for cell in lines[0]]
    for name in header:
        if not re.fullmatch(IDENTIFIER, name):
            raise SeriesError(f"{file}, row 1: {quote(name)} is no name of a column; write time,hip,knee")
    if len(set(header)) < len(header) or TIME not in header or len(header) < 2:
        raise SeriesError(f"{file}, row 1: the columns are {', '.join(header)}; one {TIME} and others are needed")
    if not LEAST_ROWS <= len(lines) - 1 <= MOST_ROWS:
        raise SeriesError(f"{file} has {len(lines) - 1} rows of numbers; {LEAST_ROWS} to {MOST_ROWS} are allowed")
    values = np.empty((len(lines) - 1, len(header)))
    for k, line in enumerate(lines[1:]):
        if len(line) != len(header):
            raise SeriesError(f"{file}, row {k + 2}: {len(line)} numbers, but the header has {len(header)} columns")
        for place, (name, cell) in enumerate(zip(header, line, strict=True)):
            values[k, place] = number(cell, f"{file}, row {k + 2}, column {quote(name)}")
    time = values[:, header.index(TIME)]
    for k in np.flatnonzero(np.diff(time) <= 0)[:1]:
        raise SeriesError(f"{file}, row {k + 3}: the time {time[k + 1]:g} does not come after {time[k]:g}")
    columns = {name: values[:, column] for column, name in enumerate(header) if name != TIME}
    for name, column in columns.items():
        with np.errstate(over="ignore"):
            rates = np.abs(np.diff(column)) / np.diff(time)
        for k in np.flatnonzero(~((rates <= LARGEST) & (np.diff(time) >= 1 / LARGEST)))[:1]:
            text = f"{column[k]:g} becomes {column[k + 1]:g} within {time[k + 1] - time[k]:g} s"
            raise SeriesError(f"{file}, row {k + 3}, column {quote(name)}: {text}, too fast to be computed with")
    return time, columns


def number(cell: str, where: str) -> float:
    """A finite number; SeriesError that says where it is none."""
    try:
        value = float(cell)
    except ValueError:
        raise SeriesError(f"{where}: {quote(cell.strip())} is no number") from None
    if not np.isfinite(value):
        raise SeriesError(f"{where}: {quote(cell.strip())} is not finite")
    if abs(value) > LARGEST:
        raise SeriesError(f"{where}: {quote(cell.strip())} {TOO_LARGE}")
    return value
