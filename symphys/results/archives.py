"""Archives of arrays in run folders (.npz)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from symphys import json_values as values
from symphys.archives import ArchiveError, TooLarge, read_arrays
from symphys.files import check_regular
from symphys.results.text_files import ReportError, reason


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
