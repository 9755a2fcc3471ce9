"""The contents of a run folder: one definition of each of its files, for writers and readers.

``runs`` is the table of all runs below a folder, ``best`` the best of them, and ``diff`` says what differs between two.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from symphys.results.table.difference import Difference


def runs(folder: str | Path, where: str | Sequence[str] = (), sort: str = "") -> Any:
    """Read all runs below a folder into a pandas.DataFrame, a row each.

    Args:
        folder: what ``symphys solve --out`` has written, or any folder above or below.
        where: conditions that a run must meet, such as ``"objective<0.5"`` or ``["solver=cma", "seed>3"]``.
        sort: the column to sort by, ``-`` before it for the largest first; by problem, case, solver and seed if empty.

    Returns:
        The columns are those of ``symphys ls``; ``attrs["faults"]`` lists the folders that could not be read.

    Raises:
        SymphysError: no such folder, a condition that cannot be read, an unknown column, or no pandas.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi", folder="reports")
        >>> table = symphys.results.runs("reports", where="problem=ball_throw")
        >>> list(table["verdict"]), int(table["seed"].max())
        (['solved'], 0)
    """
    from symphys.results.table.writing import frame  # late: most that read run folders make no table

    return frame(folder, where, sort)


def best(folder: str | Path, by: str = "objective", overall: bool = False) -> Any:
    """Read the best run of each case into a pandas.DataFrame: the best verdict, then the least of a column.

    Args:
        folder: as in ``runs``.
        by: the column that ranks runs of the same verdict.
        overall: the best of all cases together.

    Raises:
        SymphysError: no such folder, an unknown column, or no pandas.
    """
    from symphys.results.table.writing import best_frame

    return best_frame(folder, by, overall)


def diff(first: str | Path, second: str | Path) -> list[Difference]:
    """List what differs between two run folders: settings, options, problem, results, versions.

    Raises:
        SymphysError: one of them is no run folder.
    """
    from symphys.results.table.difference import differences

    return differences(Path(first), Path(second))
