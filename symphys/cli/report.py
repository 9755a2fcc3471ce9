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
    default=None,
    hidden=True,
    help="Deprecated: there is one kind of pages.",
)


figures_option = click.option(
    "--figures",
    is_flag=True,
    help="Write all pages, and every figure of every run as SVG and its numbers as CSV, into the folder `figures` of "
    "the run.",
)


def wants_figures(pages: str | None, figures: bool) -> bool:
    """Return whether figures are written as files; warn of the deprecated option ``--pages`` where it is given."""
    if pages is not None:
        click.echo("symphys: --pages is deprecated; `symphys report DIR --figures` writes figures as files", err=True)
    return figures or pages == "full"


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@pages_option
@figures_option
@click.option("--all", "remake", is_flag=True, help="Write all pages, also those that are up to date.")
@click.option("--new", is_flag=True, hidden=True, help="Make only pages that are missing or out of date: the default.")
@click.option(
    "--jobs",
    type=click.IntRange(1, MAX_JOBS),
    default=None,
    help="Number of processes.  [default: one for each processor]",
)
@click.option(
    "--single",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the page of the run in DIR as one self-contained file.",
)
@click.option(
    "--video",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the motion of the run in DIR as an animated .webp, .gif or .png. Needs Chromium.",
)
@click.option("--film", is_flag=True, help="With --video: show the solve first, from the guess to the result.")
def report(
    folder: Path,
    pages: str | None,
    figures: bool,
    remake: bool,
    new: bool,
    jobs: int | None,
    single: Path | None,
    video: Path | None,
    film: bool,
) -> int:
    """Make the report of a run folder, or of all runs below a folder, from its files alone.

    A page is made where it is missing, or where a file that it shows or what draws it has changed since. Pages of
    identifications are made too.
    """
    if remake and new:
        raise click.UsageError("--all makes all pages, --new those that are out of date; give one of them")
    if single is not None:
        from symphys.report.pages.run import write_single_page

        click.echo(write_single_page(folder, single))
    if video is not None:
        from symphys.report.making.video import write_video

        click.echo(write_video(folder, video, film))
    if single is not None or video is not None:
        return 0
    figures = wants_figures(pages, figures)
    remake = remake or figures
    threads.limit()
    from symphys.codegen.toolchain.compiler import processors
    from symphys.report import identification_folders, outdated, wanted_below, write_identification_page
    from symphys.report.pages.identification import write_identification_figures
    from symphys.results.discovery import run_folders
    from symphys.results.file_names import FIGURES

    identified = identification_folders(folder)
    for each in identified:
        if remake or outdated(each):
            click.echo(write_identification_page(each))
        if figures:
            write_identification_figures(each, each / FIGURES)
    if identified and not run_folders(folder):
        return 0
    made = make_shown(wanted_below(folder, remake), jobs or processors(), figures=figures)
    if made.kept:
        click.echo(f"{several(made.kept, 'page')} of runs up to date; --all makes all again", err=True)
    printed = [page for page in made.runs if page != made.page]
    if len(printed) > MAX_PRINTED:
        click.echo(f"{len(printed)} pages of runs")
        printed = []
    for page in printed:
        click.echo(page)
    if all(fault.page != made.page for fault in made.faults):
        click.echo(made.page)
    return UNDRAWN if made.faults else 0


@click.command("open")
@click.argument("folder", metavar="[DIR]", default="reports", type=click.Path(path_type=Path))
def open_page(folder: Path) -> int:
    """Show the report of DIR (default: reports) in a browser.

    DIR is that of a run or an identification, or one above run folders. A page that is out of date is made first.
    """
    import webbrowser

    from symphys.report import identification_folders, wanted_below, write_report
    from symphys.results.discovery import run_folders

    if identification_folders(folder) and not run_folders(folder):
        page = write_report(folder)
    else:
        made = make_shown(wanted_below(folder), 1)
        if made.faults:
            return UNDRAWN
        page = made.page
    address = page.resolve().as_uri()
    click.echo(address)
    webbrowser.open(address)
    return 0


def make_shown(
    wanted: WantedPages, jobs: int, silent: bool = False, limit: float = math.inf, figures: bool = False
) -> MadePages:
    """Make pages, show the progress unless ``silent``, and report those that could not be made."""
    from symphys.cli.watching.heartbeat import live_line
    from symphys.report import make_pages

    progress = PageProgress(len(wanted.runs))
    try:
        with nullcontext() if silent else live_line("reports", progress.words):
            made = make_pages(wanted, jobs, progress.tell, limit, figures)
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
