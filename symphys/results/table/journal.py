"""The journal: rows cached beside the run folders, one JSON line each; any number of processes may append.

A line is written by a single append, and begins with a checksum. So a line that was torn, or written into by another
machine, is recognised and skipped: its run is read again. Of several lines of one run the last counts. A row counts
only as long as result.json has the size and the time of change that its line names, and only if its columns have the
types that ``row_of`` gives them. So the journal may be out of date, damaged or missing, and the table is right all the
same.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from symphys import files
from symphys.json_values import UNPRINTABLE
from symphys.records import dataclass
from symphys.results.file_names import RESULT
from symphys.results.table.columns import FIXED, MAX_EXACT_INTEGER, NUMBERS, numeric

JOURNAL_FILE = ".runs.jsonl"
"""The name of the journal, in the folder that `symphys solve --out` names."""
ROW_FORMAT = 1
"""The format of rows; lines of another format are skipped."""
LINE_PREFIX = b'{"crc":"'
"""The beginning of every line; eight digits follow, then ``",``, then the text of their checksum."""
BODY_START = len(LINE_PREFIX) + 10
"""The offset of the checksummed text."""
TEXTS = frozenset(FIXED) - NUMBERS - {"solved"}
"""Columns that hold texts."""
REQUIRED = ("problem", "case", "solver", "verdict")
"""Columns that every row has, besides "solved"."""
INFINITE = ("inf", "-inf")
"""Texts for numbers that JSON cannot write; nan has no entry."""
Stamp = tuple[int, int]
"""Time of change [ns] and size [bytes] of a result.json."""


@dataclass(frozen=True)
class Kept:
    """A row of a journal, and the stamp of the result.json that it was made from."""

    stamp: Stamp
    row: Mapping[str, Any]


@dataclass(frozen=True)
class Journal:
    """The journal of the runs below a folder; runs go by their paths below it, with forward slashes."""

    out: Path

    @property
    def path(self) -> Path:
        """Return the file."""
        return self.out / JOURNAL_FILE

    def add(self, folder: Path, written: tuple[dict[str, Any], dict[str, Any]] | None = None) -> None:
        """Keep the row of a run that has ended, once its result.json is written.

        ``written``: what config.json and result.json hold, if that is at hand; they are read otherwise.
        Never fails, and does nothing where nothing can be written: whoever needs the row reads it from the folder.
        """
        from symphys.results.table.row import (  # late: whoever finds rows in a journal needs none of that
            read_row,
            row_of,
        )

        try:
            stamp = stamp_of((folder / RESULT).stat())
            place = folder.absolute().relative_to(self.out.absolute()).as_posix()
        except (OSError, ValueError):
            return
        row = row_of(folder, *written) if written else read_row(folder)
        if "fault" not in row:
            self.append({place: Kept(stamp, row)})

    def append(self, found: Mapping[str, Kept]) -> bool:
        """Add lines by one write; return whether that succeeded. Lost rows are read from the folders."""
        text = b"".join(line(place, kept) for place, kept in found.items())
        try:
            handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        except OSError:
            return False
        try:
            return os.write(handle, text) == len(text)
        except OSError:
            return False
        finally:
            os.close(handle)

    def read(self) -> tuple[dict[str, Kept], int]:
        """Return the last row of every run, and how many lines the file has.

        Rows that it does not give, as the file is missing, damaged or cannot be read, are read from the folders.
        """
        found: dict[str, Kept] = {}
        count = 0
        with contextlib.suppress(OSError):
            files.check_regular(self.path)
            with self.path.open("rb") as file:
                for each in file:
                    count += 1
                    found.update(entry(each))
        return found, count

    def rewrite(self, found: Mapping[str, Kept]) -> None:
        """Replace the file, so that it has one line for each run; FileError if that cannot be.

        What others append meanwhile is lost, and read from their folders again.
        """
        files.write_bytes(self.path, b"".join(line(place, kept) for place, kept in found.items()))


def stamp_of(status: os.stat_result) -> Stamp:
    """Return the stamp by which a changed file is recognised."""
    return status.st_mtime_ns, status.st_size


def line(place: str, kept: Kept) -> bytes:
    """Return a line with its end."""
    content = {"rows": ROW_FORMAT, "run": place, "stamp": kept.stamp, "row": kept.row}
    try:
        text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    except ValueError:  # few rows have a number that is not finite
        text = json.dumps(files.strict(content), separators=(",", ":"), allow_nan=False)
    body = text[1:].encode()
    return LINE_PREFIX + b'%08x",' % zlib.crc32(body) + body + b"\n"


def entry(text: bytes) -> Iterable[tuple[str, Kept]]:
    """Return the run and its row in a line; nothing for a damaged one. A line after a torn one is found."""
    text = text[max(text.rfind(LINE_PREFIX), 0) :].rstrip(b"\n")
    body = text[BODY_START:]
    if not text.startswith(LINE_PREFIX) or text[len(LINE_PREFIX) : BODY_START] != b'%08x",' % zlib.crc32(body):
        return []
    try:
        match json.loads(b"{" + body):
            case {"rows": int(rows), "run": str(run), "stamp": [int(time), int(size)], "row": dict(row)}:
                return [(run, Kept((time, size), row))] if rows == ROW_FORMAT and sound(row) else []
    except (ValueError, RecursionError):  # a right checksum of what is no JSON, or is nested too deep
        return []
    return []


def sound(row: Mapping[str, Any]) -> bool:
    """Whether a row has the required columns with their types."""
    for column, value in row.items():
        kind = type(value)
        if kind is str:
            odd = value not in INFINITE if numeric(column) else value and UNPRINTABLE.search(value)
        elif kind is float:
            odd = column in TEXTS or not math.isfinite(value)
        elif kind is int:
            odd = column in TEXTS or abs(value) >= MAX_EXACT_INTEGER
        else:
            odd = kind is not bool or numeric(column) or column in TEXTS
        if odd or UNPRINTABLE.search(column):
            return False
    own = "run" in row or "fault" in row
    return not own and type(row.get("solved")) is bool and all(row.get(column) for column in REQUIRED)
