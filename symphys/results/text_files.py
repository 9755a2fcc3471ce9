"""Files of a run folder that somebody else may have written: their text, or the table in them."""

from __future__ import annotations

import json
from pathlib import Path

from symphys.errors import SymphysError
from symphys.files import check_regular
from symphys.json_values import name, table, words


class ReportError(SymphysError):
    """A folder or file from which no report can be made."""


def read_words(path: Path) -> str:
    """The text of a file; bytes that are no UTF-8 are replaced. Raises ReportError."""
    try:
        check_regular(path)
        return words(path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise ReportError(f"{path.name}: {reason(error)}") from error


def read_table(path: Path) -> dict[str, object]:
    """The JSON object in a file. Raises ReportError that names the file and the fault."""
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


def reason(error: OSError) -> str:
    """Why a file could not be read, without its path."""
    return "there is no such file" if isinstance(error, FileNotFoundError) else (error.strerror or "cannot be read")
