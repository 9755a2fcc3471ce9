"""The table of runs as files and as data frames: CSV, JSON, Parquet, pandas."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys.errors import SymphysError, install_advice
from symphys.results.table.choosing import best, chosen, ordered
from symphys.results.table.columns import FIXED, Row, columns, numeric
from symphys.results.table.rows import Progress, Rows, read_rows

CSV, PARQUET = "runs.csv", "runs.parquet"
"""The names of the files, in the folder that `symphys solve --out` names."""
NEEDED = "this needs {0}: pip install {0}, or for every package of tables " + install_advice("tables")


class MissingPackage(SymphysError):
    """Raised for a missing optional package; says how to install it."""


def write_table(out: Path, tell: Progress | None = None) -> list[Path]:
    """Write the rows of all runs below a folder as runs.csv, and as runs.parquet where pyarrow is installed.

    Args:
        out: the folder that `symphys solve --out` names.
        tell: is called with how many folders are read, of how many that must be.

    Returns:
        The paths of the files, each of which appears at once and whole.

    Raises:
        FileError: there is no such folder, or a file cannot be written.
    """
    rows = read_rows(out, tell).rows
    names = columns(rows)
    files.write_text(out / CSV, csv_text(rows, names))
    try:
        content = parquet_bytes(rows, names)
    except MissingPackage:
        return [out / CSV]
    files.write_bytes(out / PARQUET, content)
    return [out / CSV, out / PARQUET]


def csv_text(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return a line for each row under a header; empty where unknown, ``true`` and ``false`` for booleans."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([cell(row.get(name)) for name in names] for row in rows)
    return buffer.getvalue()


def cell(value: object) -> object:
    """Return a value as CSV, with every digit of a number."""
    return str(value).lower() if isinstance(value, bool) else value


def json_lines(rows: Sequence[Row], names: Sequence[str]) -> Iterator[str]:
    """Return a JSON list, an object for each row on a line of its own; unknown values are left out."""
    yield "["
    for number, row in enumerate(rows, 1):
        known = {name: row[name] for name in names if name in row}
        end = "," if number < len(rows) else ""
        yield json.dumps(files.strict(known), ensure_ascii=False, allow_nan=False) + end
    yield "]"


def data(rows: Sequence[Row], names: Sequence[str]) -> dict[str, list[Any]]:
    """Return the columns: numbers, booleans or texts, and None where unknown."""
    return {name: alike(name, [row.get(name) for row in rows]) for name in names}


def alike(name: str, values: list[Any]) -> list[Any]:
    """Return the values of a column, all of one type or None: a setting may be a number or a text."""
    known = [value for value in values if value is not None]
    kinds = {type(value) for value in known}
    if kinds == {bool} or (kinds == {int} and len(known) == len(values)):
        return values
    if numeric(name) or (kinds and kinds <= {int, float}):
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(cell(value)) for value in values]


def parquet_bytes(rows: Sequence[Row], names: Sequence[str]) -> bytes:
    """Return the content of a Parquet file. Raises MissingPackage without pyarrow."""
    try:
        import pyarrow as arrow  # late: most need none, and it takes its time
        from pyarrow import parquet
    except ImportError:
        raise MissingPackage(NEEDED.format("pyarrow")) from None
    buffer = io.BytesIO()
    types = dict.fromkeys(FIXED, str) | {"solved": bool} | {name: float for name in names if numeric(name)}
    arrays = {name: packed(arrow, column, types.get(name)) for name, column in data(rows, names).items()}
    parquet.write_table(arrow.table(arrays), buffer)
    return buffer.getvalue()


def packed(arrow: Any, column: Sequence[Any], kind: type | None) -> Any:
    """Return a column as an array of Arrow; ``kind``: of its values, None for that of the first that is known.

    It is made of buffers, since ``arrow.array`` imports pandas, which takes longer than all else that is done here.
    """
    known = np.array([value is not None for value in column], bool)
    kind = kind or next((type(value) for value in column if value is not None), None)
    if kind is None:
        return arrow.nulls(len(column))
    mask = arrow.py_buffer(np.packbits(known, bitorder="little").tobytes())
    filled = [kind() if value is None else value for value in column]
    if kind is str:
        texts = [value.encode() for value in filled]
        ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        buffers = [mask, arrow.py_buffer(ends.tobytes()), arrow.py_buffer(b"".join(texts))]
        return arrow.Array.from_buffers(arrow.string(), len(column), buffers)
    if kind is bool:
        content, of = np.packbits(np.array(filled, bool), bitorder="little"), arrow.bool_()
    else:
        content = np.array(filled, np.int64 if kind is int else np.float64)
        of = arrow.int64() if kind is int else arrow.float64()
    return arrow.Array.from_buffers(of, len(column), [mask, arrow.py_buffer(content.tobytes())])


def frame(folder: str | Path, where: str | Sequence[str] = (), sort: str = "") -> Any:
    """Read all runs below a folder into a pandas.DataFrame, as ``symphys.results.runs`` does."""
    found = read_rows(Path(folder))
    rows = chosen(found.rows, [where] if isinstance(where, str) else where)
    return framed(ordered(rows, sort) if sort else rows, found)


def best_frame(folder: str | Path, by: str = "objective", overall: bool = False) -> Any:
    """Return the best runs below a folder as a pandas.DataFrame, as ``symphys.results.table.best`` selects them."""
    found = read_rows(Path(folder))
    return framed(best(found.rows, by, overall), found)


def framed(rows: Sequence[Row], found: Rows) -> Any:
    """Return some of the rows that were found as a pandas.DataFrame with all of their columns."""
    try:
        import pandas as pd  # late, as above
    except ImportError:
        raise MissingPackage(NEEDED.format("pandas")) from None
    table = pd.DataFrame(data(rows, columns(found.rows)))
    table.attrs["faults"] = list(found.faults)
    return table
