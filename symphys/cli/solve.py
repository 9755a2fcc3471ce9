"""``symphys solve``: problems times solvers times seeds."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from symphys import threads
from symphys.cli.arguments import (
    backend_option,
    complete_problem,
    complete_solvers,
    out_option,
    read_backend,
    read_problems,
    read_settings,
    read_solvers,
    settings_option,
)
from symphys.cli.batch_options import BatchOptions, batch_options
from symphys.cli.wording import duration, many_pairs

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.cli.watching.choice import Shown
    from symphys.runs import Job

MOST_SEEDS = 10_000
MOST_JOBS = 256
BATCH_PAGE = "page of all runs"


@click.command()
@click.argument("sources", metavar="FILE...", nargs=-1, required=True, shell_complete=complete_problem)
@click.option(
    "--solver",
    "names",
    metavar="A,B",
    shell_complete=complete_solvers,
    help="Solvers, separated by commas.  [default: the file's `solvers`, else all]",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, MOST_SEEDS),
    default=1,
    show_default=True,
    help="How many seeds; seed 0 starts from the guess as it is, the others from one perturbed by its spread.",
)
@settings_option
@click.option(
    "--jobs",
    type=click.IntRange(1, MOST_JOBS),
    default=1,
    show_default=True,
    help="How many runs go on at once; with --on, how many drivers.",
)
@click.option(
    "--multi-start",
    "--together",
    "multi_start",
    is_flag=True,
    help="Solve the seeds of gradient and least_squares side by side, their evaluations in batches. Sooner done, but "
    "the seconds of each run are those of all.",
)
@click.option(
    "--unexamined",
    is_flag=True,
    help="Leave out how far solutions can be trusted, which for long motions takes as long as solving them; "
    "`symphys check --at RUN_FOLDER` does it later.",
)
@backend_option
@out_option
@batch_options
def solve(
    sources: tuple[str, ...],
    names: str | None,
    seeds: int,
    assignments: tuple[str, ...],
    jobs: int,
    multi_start: bool,
    unexamined: bool,
    backend: str,
    out: Path,
    how: BatchOptions,
) -> int:
    """Solve problems, and write a report.

    FILE is a problem file, or the name of a shipped problem (see `symphys list`). What is done already is not done
    again, and what was interrupted goes on where it stopped.
    """
    began = perf_counter()
    threads.limit()
    from symphys.batches import BatchLimits, run_batch, run_on
    from symphys.cli.watching import watch
    from symphys.runs import make_jobs
    from symphys.transcription import transcribe

    settings = read_settings(assignments)
    solvers = read_solvers(names)
    problems = read_problems(sources, settings)
    command = shlex.join(["symphys", *sys.argv[1:]])
    asked = make_jobs(problems, solvers, range(seeds), settings, out, command, read_backend(backend), not unexamined)
    if how.dry_run:
        return print_previews(asked, how.rerun)
    for problem in problems:
        if note := many_pairs(problem.name, len(problem.world().pairs)):
            click.echo(note, err=True)
    made = partial(transcribe, backend=backend, threads=1 if jobs > 1 or how.on else None)
    limits = BatchLimits(how.retries, how.timeout, how.budget)
    with watch(len(asked), how.quiet, how.json) as observer:
        if how.on:
            batch = run_on(how.on, how.scheduler, asked, jobs, observer, made, out, limits, how.rerun)
        else:
            batch = run_batch(asked, jobs, observer, made, multi_start, limits, how.rerun)
    code = 130 if batch.interrupted else 0 if batch.accepted else 1
    if how.json or how.quiet:
        return conclude_silently(asked, batch, out, observer, code)
    parts = observer.notes.seconds if jobs == 1 and not (multi_start or how.on) else {}
    conclude(asked, batch, out, began, parts)
    return code


def print_previews(jobs: list[Job], rerun: str) -> int:
    """Say what would be done, and why, a run a line; the exit code."""
    from symphys.batches import previews

    todo = 0
    for each in previews(jobs, rerun):
        todo += each.todo
        click.echo(f"{each.job.name}: {'to do' if each.todo else each.stands}: {each.why}")
    click.echo(f"{todo} of {len(jobs)} runs are to do")
    return 0


def conclude(jobs: list[Job], batch: BatchResult, out: Path, began: float, parts: Mapping[str, float]) -> None:
    """Show what came of it."""
    from symphys.cli.summary import print_summary

    print_summary(jobs, batch)
    if batch.interrupted or not any(batch.results):
        click.echo(last_words(batch, out), err=True)
        return
    page = write_reports(jobs, out)
    if batch.spent:
        click.echo(last_words(batch, out), err=True)
    click.echo(time_line(perf_counter() - began, parts))
    click.echo(f"report: {page}")


def conclude_silently(jobs: list[Job], batch: BatchResult, out: Path, observer: Shown, code: int) -> int:
    """Write the reports, and say no more than events; the exit code."""
    from symphys.cli.watching.events import Events

    if not batch.interrupted and any(batch.results):
        write_reports(jobs, out)
    if isinstance(observer, Events):
        observer.finished(batch, code)
    return code


def last_words(batch: BatchResult, out: Path) -> str:
    """What an interruption, or the end of its time, has left of a batch, and how to go on."""
    why = "interrupted" if batch.interrupted else "the time of the batch is used up" if batch.spent else "nothing ran"
    over = sum(result is not None and not result.interrupted for result in batch.results)
    halfway = sum(result is not None and result.interrupted for result in batch.results)
    return (
        f"symphys: {why}; {over} of {len(batch.results)} runs are done and {halfway} halfway, saved in {out}; "
        "the same command goes on from there"
    )


def time_line(total: float, parts: Mapping[str, float]) -> str:
    """The whole time of the command, and what took it as far as that is known."""
    named = {"building": "build", "compiling": "compile", "solving": "solve"}
    told = {word: parts[key] for word, key in named.items() if parts.get(key)}
    if not told:
        return f"time: {duration(total)} s in all"
    told["judging and reports"] = max(total - sum(told.values()), 0.0)
    return f"time: {duration(total)} s in all; {', '.join(f'{word} {duration(part)}' for word, part in told.items())}"


def write_reports(jobs: list[Job], out: Path) -> Path:
    """Write the pages of the runs that are new, and that of the batch; where that lies."""
    from symphys.cli.watching import working
    from symphys.report import write_batch_report, write_run_report
    from symphys.report.pages.run import PAGE
    from symphys.runs import RESULT

    new = {job.name: job.folder.path for job in jobs if newer(job.folder.path / RESULT, job.folder.path / PAGE)}
    with working("reports", dict.fromkeys([*(f"page of {name}" for name in new), BATCH_PAGE], 1.0)) as tell:
        for name, folder in new.items():
            tell(f"page of {name}")
            write_run_report(folder)
        tell(BATCH_PAGE)
        return write_batch_report(out)


def newer(source: Path, page: Path) -> bool:
    """Whether there is something that the page does not show yet."""
    return source.exists() and not (page.exists() and page.stat().st_mtime >= source.stat().st_mtime)
