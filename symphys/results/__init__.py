"""What a run folder holds: one definition of each of its files, which writers and readers import.

``symphys.results(folder)`` is the table of all runs below a folder, ``symphys.results.best(folder)`` the best of them,
and ``symphys.results.diff(one, other)`` says what differs between two.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symphys.verbs import make_callable

if TYPE_CHECKING:
    from symphys.results.table.difference import Difference


def results(folder: str | Path, where: str | Sequence[str] = (), sort: str = "") -> Any:
    """All runs below a folder as a pandas.DataFrame: see ``symphys.results.table.writing.frame``."""
    from symphys.results.table.writing import frame  # late: most that read run folders make no table

    return frame(folder, where, sort)


def best(folder: str | Path, by: str = "objective", overall: bool = False) -> Any:
    """The best run of each case, or of all, as a pandas.DataFrame: by its verdict, then by the column ``by``."""
    from symphys.results.table.writing import best_frame

    return best_frame(folder, by, overall)


def diff(first: str | Path, second: str | Path) -> list[Difference]:
    """What differs between two run folders: settings, options, problem, results, versions; printed by ``print``."""
    from symphys.results.table.difference import differences

    return differences(Path(first), Path(second))


make_callable(__name__, results)
