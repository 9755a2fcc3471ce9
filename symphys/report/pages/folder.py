"""All pages of a folder of runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from symphys.report.pages.batch import write_batch_report
from symphys.report.pages.run import write_run_report
from symphys.results.discovery import run_folders


def report(folder: str | Path) -> Path:
    """Make the report of a run folder, or of all runs below a folder, again. Also called as ``symphys.report``.

    Args:
        folder: what ``solve`` or ``solve_all`` with a ``folder``, or ``symphys solve --out``, has written.

    Returns:
        The page of the batch, index.html, which links to those of the runs; of a run folder its own, report.html.

    Raises:
        ReportError: there is no such folder, it holds no run folder, or it cannot be written to.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi", folder="reports")
        >>> symphys.report("reports").name
        'index.html'
    """
    *_, page = write_pages(Path(folder))
    return page


def write_pages(folder: Path) -> Iterator[Path]:
    """Write the pages of all runs at or below a folder, then that of the batch unless it is a run folder itself."""
    below = run_folders(folder)
    yield from map(write_run_report, below)
    if below != [folder]:
        yield write_batch_report(folder)
