"""``symphys report``, and how commands make pages: options, progress and messages on failures."""

from __future__ import annotations

import math
import shlex
from contextlib import nullcontext
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click

from symphys import threads
from symphys.cli.wording import percent, time_words
from symphys.findings.writing import several

if TYPE_CHECKING:
    from symphys.report import WantedPages
    from symphys.report.making.batch import MadePages

MAX_JOBS = 256
"""Largest number of processes."""
MAX_PRINTED = 50
"""Number of pages up to which each is printed."""
UNDRAWN = 3
"""The exit code where a page could not be made."""
MAX_NAMED = 20
"""Number of failed pages that are named."""

pages_option = click.option(
    "--pages",
    type=click.Choice(["auto", "full", "light"]),
    default="auto",
    show_default=True,
    help="The pages of runs: full ones have their figures as SVG and CSV beside them, light ones draw their curves in "
    "the browser and are made 20 times faster; auto: light where more than 50 are made at once.",
)


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@pages_option
@click.option("--all", "remake", is_flag=True, help="Make all pages, also where nothing that they show has changed.")
@click.option("--new", is_flag=True, hidden=True, help="Make only pages that are missing or out of date: the default.")
@click.option(
    "--jobs",
    type=click.IntRange(1, MAX_JOBS),
    default=None,
    help="How many processes make pages.  [default: one for each processor]",
)
def report(folder: Path, pages: str, remake: bool, new: bool, jobs: int | None) -> int:
    """Make the report of a run folder, or of all runs below a folder, from its files alone.

    A page is made where it is missing, or where a file that it shows or what draws it has changed since. Pages of
    identifications are made too.
    """
    if remake and new:
        raise click.UsageError("--all makes all pages, --new those that are out of date; give one of them")
    threads.limit()
    from symphys.codegen.toolchain.compiler import processors
    from symphys.report import identification_folders, outdated, wanted_below, write_identification_page
    from symphys.results.discovery import run_folders

    identified = identification_folders(folder)
    for each in identified:
        if remake or outdated(each, ("full",)):
            click.echo(write_identification_page(each))
    if identified and not run_folders(folder):
        return 0
    made = make_shown(wanted_below(folder, pages, remake), pages, jobs or processors())
    if made.kept:
        click.echo(f"{several(made.kept, 'page')} of runs up to date; --all makes all again", err=True)
    printed = [page for page in made.runs if page != made.page]
    if len(printed) > MAX_PRINTED:
        kind = ", light ones; --pages full makes full ones" if made.light else ""
        click.echo(f"{len(printed)} pages of runs{kind}")
        printed = []
    for page in printed:
        click.echo(page)
    if all(fault.page != made.page for fault in made.faults):
        click.echo(made.page)
    return UNDRAWN if made.faults else 0


def make_shown(wanted: WantedPages, kind: str, jobs: int, silent: bool = False, limit: float = math.inf) -> MadePages:
    """Make pages, show the progress unless ``silent``, and report those that could not be made."""
    from symphys.cli.watching.heartbeat import live_line
    from symphys.report import make_pages

    progress = PageProgress(len(wanted.runs))
    try:
        with nullcontext() if silent else live_line("reports", progress.words):
            made = make_pages(wanted, kind, jobs, progress.tell, limit)
    except KeyboardInterrupt:
        again = shlex.join(["symphys", "report", str(wanted.root)])
        click.echo(f"symphys: {progress.over} of {progress.runs} pages were made; `{again}` makes the others", err=True)
        raise
    for fault in made.faults[:MAX_NAMED]:
        click.echo(f"symphys: {fault}", err=True)
    if len(made.faults) > MAX_NAMED:
        click.echo(f"symphys: {len(made.faults) - MAX_NAMED} more pages could not be made", err=True)
    return made


class PageProgress:
    """The progress of making pages of runs, with the time that is left."""

    def __init__(self, runs: int) -> None:
        """Start with no page made."""
        self.runs, self.over, self.began = runs, 0, monotonic()

    def tell(self, over: int) -> None:
        """Set how many pages are made."""
        self.over = over

    def words(self) -> str:
        """Return the progress as a line."""
        if self.over == self.runs:
            return "page of all runs"
        text = f"{self.over} of {self.runs} pages of runs, {percent(self.over / self.runs)}"
        left = (monotonic() - self.began) * (self.runs - self.over) / self.over if self.over else math.inf
        return text + (f", about {time_words(left)} left" if math.isfinite(left) else "")
