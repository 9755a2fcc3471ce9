"""All pages of a folder of runs: those of the runs, then that of the batch."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path

from symphys.interrupts import Interrupts
from symphys.records import dataclass
from symphys.report.making.run_pages import PageFault, attempt, make_run_pages
from symphys.report.making.stamps import BATCH_PAGE, batch_digest, folder_digest, is_current
from symphys.report.pages.batch import write_batch_figures, write_batch_report
from symphys.report.pages.identification import (
    identification_folders,
    write_identification_figures,
    write_identification_page,
)
from symphys.report.pages.run import PAGE
from symphys.results.discovery import run_folders
from symphys.results.file_names import FIGURES
from symphys.results.text_files import ReportError

MOST_NAMED = 3

Progress = Callable[[int], None]
"""Receives how many pages of runs are done; all of them: that of the batch begins."""


@dataclass(frozen=True)
class MadePages:
    """The pages that were made, and those that could not be.

    Attributes:
        page: that of the batch; of a single run folder its own. It is not new where ``faults`` names it.
        runs: the pages of runs that were made, in their order.
        faults: the pages that could not be made.
        kept: how many pages of runs are as they were, since nothing that they show has changed.
    """

    page: Path
    runs: tuple[Path, ...]
    faults: tuple[PageFault, ...]
    kept: int = 0


def outdated(folder: Path) -> bool:
    """Whether the page of a run folder is missing, or made from other files or by other code."""
    return not is_current(folder / PAGE, folder_digest(folder))


@dataclass(frozen=True)
class WantedPages:
    """The pages to make.

    Attributes:
        root: the folder of the batch.
        runs: run folders at or below it whose pages are made.
        batch: whether there is a page of the batch.
        remake: whether that is made although nothing that it shows has changed.
        kept: how many pages of runs stay as they are.
    """

    root: Path
    runs: tuple[Path, ...]
    batch: bool = True
    remake: bool = False
    kept: int = 0


def wanted_below(root: Path, remake: bool = False) -> WantedPages:
    """The pages at or below a folder that are missing or ``outdated``; all of them with ``remake``.

    Raises:
        ReportError: there is no such folder, or there is no run in it.
    """
    below = run_folders(root)
    if not below:
        raise ReportError(f"{root}: no run folder at or below it; `symphys solve --out` writes them")
    runs = [folder for folder in below if remake or outdated(folder)]
    return WantedPages(root, tuple(runs), below != [root], remake, len(below) - len(runs))


def make_pages(
    wanted: WantedPages,
    jobs: int = 1,
    tell: Progress = lambda _: None,
    limit: float = math.inf,
    figures: bool = False,
) -> MadePages:
    """Make the pages of runs, then that of the batch, which links to them.

    Args:
        wanted: which.
        jobs: how many processes make them.
        tell: receives how far it is.
        limit: [s] that the page of a run may take.
        figures: whether the figures of these runs are written as files too.

    Raises:
        ReportError: there is no such folder. Pages that cannot be made are faults instead.
    """
    if not wanted.root.is_dir():
        raise ReportError(f"{wanted.root}: there is no such folder")
    faults: dict[Path, PageFault] = {}
    over = 0

    def done(folder: Path, fault: PageFault | None) -> None:
        nonlocal over
        over += 1
        if fault is not None:
            faults[folder] = fault
        tell(over)

    make_run_pages(wanted.runs, figures, jobs, done, limit)
    made = tuple(folder / PAGE for folder in wanted.runs if folder not in faults)
    found = [faults[folder] for folder in wanted.runs if folder in faults]
    tell(len(wanted.runs))
    if not wanted.batch:
        return MadePages(wanted.root / PAGE, made, tuple(found), wanted.kept)
    index = wanted.root / BATCH_PAGE
    if not (wanted.remake or found) and is_current(index, batch_digest(wanted.root)):
        return MadePages(index, made, tuple(found), wanted.kept)
    unmade = {fault.page.parent: fault.reason for fault in found}
    with Interrupts().listening() as interrupted:
        fault = attempt(index, lambda: write_batch_report(wanted.root, unmade))
        if fault is None and figures:
            fault = attempt(index, lambda: write_batch_figures(wanted.root, wanted.root / FIGURES))
        if fault is not None:
            found.append(fault)
    if interrupted():
        raise KeyboardInterrupt
    return MadePages(index, made, tuple(found), wanted.kept)


def write_report(
    folder: str | Path, pages: str | None = None, jobs: int = 1, remake: bool = False, figures: bool = False
) -> Path:
    """Make the report of a run folder, or of all runs below a folder.

    Pages are made that are missing, or made from other files or by other code than there are now.

    Args:
        folder: what ``solve`` or ``solve_all`` with a ``folder``, or ``symphys solve --out``, has written.
        pages: deprecated: there is one kind of pages. "full" stands for ``figures``.
        jobs: how many processes make the pages. A script that asks for several needs
            ``if __name__ == "__main__":`` around its own work.
        remake: make all pages, whatever they were made from.
        figures: make all pages, and write every figure of every run as NAME.svg, with its numbers as NAME.csv, into
            the folder "figures" of the run.

    Returns:
        The page of the batch, index.html, which links to those of the runs; of a run folder, or of an identification,
        its own, report.html.

    Raises:
        SymphysError: there is no such folder, it holds no run folder, or a page cannot be made; all others are then.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", "least_squares", backend="casadi", folder="reports")
        >>> symphys.write_report("reports").name
        'index.html'
    """
    if pages is not None:
        warnings.warn("`pages` is deprecated; `figures=True` writes figures as files", DeprecationWarning, stacklevel=2)
        figures = figures or pages == "full"
    remake = remake or figures
    identified = identification_folders(Path(folder))
    for each in identified:
        if remake or outdated(each):
            write_identification_page(each)
        if figures:
            write_identification_figures(each, each / FIGURES)
    if identified and not run_folders(Path(folder)):
        return identified[0] / PAGE
    made = make_pages(wanted_below(Path(folder), remake), jobs, figures=figures)
    if made.faults:
        more = f"; and {len(made.faults) - MOST_NAMED} more" if len(made.faults) > MOST_NAMED else ""
        raise ReportError("; ".join(map(str, made.faults[:MOST_NAMED])) + more)
    return made.page
