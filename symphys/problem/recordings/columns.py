"""Columns of numbers by name, from CSV and NPZ files, and where a row of them lies in a message.

Of a CSV file, ten million rows are read in seconds: whole chunks go through numpy's parser. A chunk that it refuses is
read cell by cell, which is slower, knows other words for a missing number, and names the row and the column of a fault.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from symphys.archives import ArchiveError, read_arrays
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

CHUNK_BYTES = 1 << 23
"""Bytes."""
MAX_LINE_BYTES = 1 << 20
"""Bytes; a longer one is no line of a table."""
DELIMITERS = ",;\t"
MISSING_WORDS = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none"})
"""Cells that are a missing number, in small letters."""
MAX_BYTES = 2**29
"""[bytes] Largest memory of the arrays of one recording: some 67 million numbers."""


class RecordingFault(ValueError):
    """Numbers that are no recording.

    Attributes:
        key: of the [[recording]] table that it concerns, or the place below that table.
    """

    def __init__(self, key: str | tuple[str | int, ...], message: str) -> None:
        """Keep the key, and the message for the user."""
        self.key = (key,) if isinstance(key, str) else key
        super().__init__(message)


@dataclass(frozen=True, eq=False)
class RecordedColumns:
    """Columns of n numbers, NaN where one is missing.

    Attributes:
        label: the file, or "table".
        values: by name (n,), or (n, k) of an array.
        names: of all columns that there are, those that were not read too.
        first: how messages count the first row: 2 in a CSV file, below its header; 0 in arrays.
        from_zero: whether they count from 0, which they then say.
    """

    label: str
    values: Mapping[str, Array] = field(repr=False)
    names: tuple[str, ...]
    first: int
    from_zero: bool = False

    @property
    def count(self) -> int:
        """n."""
        return next((len(values) for values in self.values.values()), 0)

    def part(self, first: int, last: int) -> RecordedColumns:
        """The rows from ``first`` to before ``last``."""
        values = {name: column[first:last] for name, column in self.values.items()}
        return RecordedColumns(self.label, values, self.names, self.first + first, self.from_zero)

    def where(self, row: int, name: str = "") -> str:
        """``a.csv, row 17, column "x"``: a row, counted here from 0, as a message names it."""
        counted = " (from 0)" if self.from_zero else ""
        column = f", column {quote(name)}" if name else ""
        return f"{self.label}, row {row + self.first}{counted}{column}"

    def require(self, names: Iterable[str], key: str | tuple[str | int, ...]) -> None:
        """RecordingFault with the nearest names where one of these is missing."""
        for name in names:
            if name not in self.names:
                nearest = hint(name, self.names)
                raise RecordingFault(key, f"{self.label} has no column {quote(name)}; {nearest}")

    def numbers(self, name: str, key: str | tuple[str | int, ...]) -> Array:
        """(n,): a column with one number in each row."""
        self.require([name], key)
        values = self.values[name]
        if values.ndim == 2 and values.shape[1] == 1:
            return values[:, 0]
        if values.ndim != 1:
            text = f"has {values.shape[1]} numbers in each row; one is wanted"
            raise RecordingFault(key, f"{self.label}: {quote(name)} {text}")
        return values

    def side_by_side(self, names: Sequence[str], key: str | tuple[str | int, ...]) -> Array:
        """(n, m): columns and arrays beside each other, a copy."""
        self.require(names, key)
        return np.column_stack([self.values[name] for name in names])


@dataclass(frozen=True)
class Header:
    """The first line: the delimiter, and all names of columns."""

    delimiter: str
    names: tuple[str, ...]


def read_csv(stream: BinaryIO, label: str, wanted: set[str]) -> RecordedColumns:
    """The columns of a CSV file with a header.

    Args:
        stream: the file, from its beginning, which can seek.
        label: what messages call it.
        wanted: the names of columns that are used; others may hold texts. If one is missing, no column is read.

    Raises:
        RecordingFault: names row and column.
    """
    header = read_header(stream, label)
    if not wanted <= set(header.names):
        return RecordedColumns(label, {}, header.names, 2)
    places = [k for k, name in enumerate(header.names) if name in wanted]
    begins = stream.tell()
    most = sum(part.count(b"\n") for part in iter(lambda: stream.read(CHUNK_BYTES), b"")) + 1
    stream.seek(begins)
    values, filled = np.empty((most, len(places))), 0
    for chunk in whole_lines(stream, label):
        rows = parsed(chunk, header, places, label, filled)
        values[filled : filled + len(rows)] = rows
        filled += len(rows)
    if not filled:
        raise RecordingFault("files", f"{label} has a header, but no row of numbers")
    found = {header.names[k]: values[:filled, column] for column, k in enumerate(places)}
    return RecordedColumns(label, found, header.names, 2)


def read_header(stream: BinaryIO, label: str) -> Header:
    """The first line, of names that differ; the stream then stands at the second."""
    line = stream.readline(MAX_LINE_BYTES)
    try:
        text = line.decode("utf-8-sig").strip("\r\n").removeprefix("#")  # numpy.savetxt writes one
    except UnicodeDecodeError:
        raise RecordingFault(
            "files", f"{label}, row 1: this is no UTF-8 text; a CSV file with a header is wanted"
        ) from None
    if not text.strip():
        what = "is empty" if not line else "begins with an empty line"
        raise RecordingFault("files", f"{label} {what}; the first row must name the columns: time,x,y,z")
    delimiter = max(DELIMITERS, key=text.count)
    try:
        names = [name.strip() for name in next(csv.reader([text], delimiter=delimiter, strict=True))]
    except (csv.Error, StopIteration):
        raise RecordingFault("files", f"{label}, row 1: this is no row of a CSV file; time,x,y,z is wanted") from None
    numbers = [name for name in names if is_number(name)]
    if numbers:
        text = f"{quote(numbers[0])} is a number; the first row must name the columns: time,x,y,z"
        raise RecordingFault("files", f"{label}, row 1: {text}")
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice is not None:
        raise RecordingFault("files", f"{label}, row 1: two columns have the name {quote(twice)}")
    return Header(delimiter, tuple(names))


def is_number(text: str) -> bool:
    """Whether it is a number, NaN too."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def whole_lines(stream: BinaryIO, label: str) -> Iterator[bytes]:
    """The rest of the file in chunks that end with a line."""
    rest = b""
    while chunk := stream.read(CHUNK_BYTES):
        end = chunk.rfind(b"\n") + 1
        if not end and len(rest) > MAX_LINE_BYTES:
            raise RecordingFault("files", f"{label} has a line of over {MAX_LINE_BYTES:,} bytes; it is no CSV file")
        if end:
            yield rest + chunk[:end]
            rest = b""
        rest += chunk[end:]
    if rest.strip():
        yield rest


def parsed(chunk: bytes, header: Header, places: Sequence[int], label: str, before: int) -> Array:
    """(rows, len(places)): the numbers of a chunk; ``before``: how many rows came before it."""
    plain = chunk.replace(b"\r\n", b"\n") if b"\r" in chunk else chunk
    mark = header.delimiter.encode()
    if places and b'"' not in plain and even(plain, mark, len(header.names)):
        try:
            with np.errstate(all="ignore"):
                rows = np.loadtxt(
                    io.BytesIO(filled_in(plain, mark)),
                    delimiter=header.delimiter,
                    comments=None,
                    usecols=places,
                    ndmin=2,
                )
        except ValueError:
            rows = None
        if rows is not None and not np.isinf(rows).any():
            return rows
    return cell_by_cell(plain, header, places, label, before)


def even(chunk: bytes, mark: bytes, columns: int) -> bool:
    """Whether every line has as many cells as the header; a chunk with empty lines has not."""
    letters = np.frombuffer(chunk, np.uint8)
    marks, ends = (np.flatnonzero(letters == ord(each)) for each in (mark, b"\n"))
    ends = ends if chunk.endswith(b"\n") else np.append(ends, len(letters))
    if len(marks) != (columns - 1) * len(ends):
        return False
    return columns == 1 or bool(np.all(np.searchsorted(marks, ends) == (columns - 1) * np.arange(1, len(ends) + 1)))


def filled_in(chunk: bytes, mark: bytes) -> bytes:
    """The chunk with "nan" in its empty cells."""
    for _ in range(2):
        if mark + mark in chunk:
            chunk = chunk.replace(mark + mark, mark + b"nan" + mark)
    if b"\n" + mark in chunk:
        chunk = chunk.replace(b"\n" + mark, b"\nnan" + mark)
    if mark + b"\n" in chunk:
        chunk = chunk.replace(mark + b"\n", mark + b"nan\n")
    return (b"nan" if chunk.startswith(mark) else b"") + chunk + (b"nan" if chunk.endswith(mark) else b"")


def cell_by_cell(chunk: bytes, header: Header, places: Sequence[int], label: str, before: int) -> Array:
    """(rows, len(places)): the same, and RecordingFault where a cell is no number."""
    try:
        text = chunk.decode("utf-8")
    except UnicodeDecodeError as error:
        row = before + chunk[: error.start].count(b"\n") + 2
        raise RecordingFault("files", f"{label}, row {row}: this is no UTF-8 text") from None
    found = list[list[float]]()
    try:
        for cells in csv.reader(io.StringIO(text, newline=""), delimiter=header.delimiter):
            if not any(cell.strip() for cell in cells) and len(cells) <= 1:
                continue
            where = f"{label}, row {before + len(found) + 2}"
            if len(cells) != len(header.names):
                advice = "; numbers are written 0.5, not 0,5" if header.delimiter == "," else ""
                text = f"has {len(cells)} cells, but the header has {len(header.names)}{advice}"
                raise RecordingFault("files", f"{where} {text}")
            found.append([number(cells[k], f"{where}, column {quote(header.names[k])}") for k in places])
    except csv.Error as error:
        raise RecordingFault("files", f"{label}, row {before + len(found) + 2}: {error}") from None
    return np.array(found, float).reshape(len(found), len(places))


def number(cell: str, where: str) -> float:
    """A finite number, NaN where it is missing; RecordingFault that says where it is none."""
    text = cell.strip()
    if text.lower() in MISSING_WORDS:
        return np.nan
    try:
        value = float(text) if "_" not in text else None
    except ValueError:
        value = None
    if value is None:
        point = text.replace(",", ".", 1)
        advice = f"write {point}" if point != text and is_number(point) else "leave the cell empty where one is missing"
        raise RecordingFault("files", f"{where}: {quote(text)} is no number; {advice}")
    if np.isinf(value):
        raise RecordingFault(
            "files", f"{where}: {quote(text)} is not finite; leave the cell empty where one is missing"
        )
    return value


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
        names, arrays = read_arrays(stream, wanted if rows is None else {*wanted, rows}, MAX_BYTES)
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
