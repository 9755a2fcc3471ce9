"""Files of a run folder that somebody else may have written: texts, tables, archives of arrays."""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.archives import ArchiveError, TooLarge, read_arrays
from symphys.errors import SymphysError
from symphys.files import check_regular, emptied
from symphys.json_values import name, table, words

LARGE_FIELDS = ("z", "trust")
"""The largest objects of result.json, which no table shows."""
READ_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
MAX_READ_BYTES = 2**20
"""Largest number of bytes of one read."""


class ReportError(SymphysError):
    """Raised for a folder or file from which no report can be made."""


def read_words(path: Path) -> str:
    """Read the text of a file; bytes that are no UTF-8 are replaced. Raises ReportError."""
    try:
        check_regular(path)
        return words(path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise ReportError(f"{path.name}: {reason(error)}") from error


def read_table(path: Path) -> dict[str, object]:
    """Read the JSON object in a file. Raises ReportError that names the file and the fault."""
    try:
        check_regular(path)
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ReportError(f"{path.name}: {reason(error)}") from error
    except (ValueError, RecursionError) as error:
        raise ReportError(f"{path.name}: not valid JSON, perhaps half written ({name(str(error))})") from error
    if not isinstance(content, dict):
        raise ReportError(f"{path.name}: a JSON object is expected, this is a {type(content).__name__}")
    return table(content)


def read_light_table(path: Path | str) -> dict[str, Any]:
    """Read the JSON object in a file of this program, with empty tables for ``LARGE_FIELDS``.

    Such tables are cut out of the text before it is parsed. Raises ReportError, as ``read_table`` does.
    """
    try:
        content = json.loads(emptied(_read_regular(path), LARGE_FIELDS))
    except (OSError, ValueError, RecursionError):
        return read_table(Path(path))
    return content if isinstance(content, dict) else read_table(Path(path))


def _read_regular(path: Path | str) -> bytes:
    """Read a regular file; OSError for anything else, which is not waited for.

    Paths and files of the standard library's own classes take as long as all the rest of reading a run.
    """
    number = os.open(path, READ_FLAGS)
    try:
        about = os.fstat(number)
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, "a regular file is needed", str(path))
        parts = [os.read(number, about.st_size + 1)]
        while parts[-1]:
            parts.append(os.read(number, MAX_READ_BYTES))
        return b"".join(parts)
    finally:
        os.close(number)


def reason(error: OSError) -> str:
    """Say why a file could not be read, without its path."""
    return "there is no such file" if isinstance(error, FileNotFoundError) else (error.strerror or "cannot be read")


def read_archive(path: Path, only: Sequence[str] = ()) -> dict[str, Any]:
    """Read every array of an archive, or ``only`` those of these names that it has.

    Raises:
        ReportError: no such file, not an archive of plain arrays, or arrays of more than MOST_BYTES.
    """
    try:
        check_regular(path)
        with path.open("rb") as file:
            return read_arrays(file, only or None)[1]
    except TooLarge as error:
        raise ReportError(f"{path.name}: {values.name(str(error))}") from error
    except ArchiveError as error:
        raise ReportError(f"{path.name}: not an archive of plain arrays ({values.name(str(error))})") from error
    except OSError as error:
        raise ReportError(f"{path.name}: {reason(error)}") from error
