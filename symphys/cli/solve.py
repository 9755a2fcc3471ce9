"""``symphys solve``: problems times solvers times seeds."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from symphys import files, threads
from symphys.cli.arguments import (
    backend_option,
    complete_problem,
    complete_solvers,
    out_option,
    points_of,
    read_backend,
    read_problems,
    read_settings,
    read_solvers,
    read_sweeps,
    settings_option,
    sweep_options,
)
from symphys.cli.batch_options import BatchOptions, batch_options
from symphys.cli.report import UNDRAWN, make_shown, pages_option
from symphys.cli.wording import duration, many_pairs

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.cli.watching.choice import Shown
    from symphys.problem import Problem
    from symphys.report.making.batch import MadePages
    from symphys.runs import Job

MOST_SEEDS = 10_000
MOST_JOBS = 256
INTERRUPTED = 130
LEAST_PAGE = 60.0
"""[s] that a page may take at least where runs have a timeout."""


@click.command()
@click.argument("sources", metavar="FILE...", nargs=-1, required=True, shell_complete=complete_problem)
@click.option(
    "--solver",
    "names",
    metavar="A,B",
    shell_complete=complete_solvers,
    help="Solvers, separated by commas.  [default: the file's `solvers`, else what fits it]",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, MOST_SEEDS),
    default=1,
    show_default=True,
    help="How many seeds; seed 0 starts from the guess as it is, the others from one perturbed by its spread.",
)
@click.option(
    "--guess",
    "guess_from",
    metavar="RUN_FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Start from what another run has found: its variables by name, on any grid of knots, step or duration; with "
    "multiple_shooting its motion and multipliers too.",
)
@settings_option
@sweep_options
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
@click.option("--no-report", is_flag=True, help="Make no pages; `symphys report DIR` makes them later.")
@pages_option
@backend_option
@out_option
@batch_options
def solve(
    sources: tuple[str, ...],
    names: str | None,
    seeds: int,
    guess_from: Path | None,
    assignments: tuple[str, ...],
    sweeps: tuple[str, ...],
    samples: str | None,
    jobs: int,
    multi_start: bool,
    unexamined: bool,
    no_report: bool,
    pages: str,
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
    from symphys.cli.watching import watch, working
    from symphys.runs import make_jobs, read_guess_run
    from symphys.transcription import transcribe

    solvers, backend = read_solvers(names), read_backend(backend)
    problems = read_problems(sources, read_settings(assignments))
    command, guess = shlex.join(["symphys", *sys.argv[1:]]), read_guess_run(guess_from) if guess_from else None
    common = (out, command, backend, not unexamined, guess)
    asked = [
        job
        for each in points_of(read_sweeps(problems, sweeps, samples), working)
        for job in make_jobs([each], solvers, range(seeds), dict(each.settings), *common)
    ]
    if how.dry_run:
        return print_previews(asked, how.rerun)
    print_notes(problems, solvers, asked, how.quiet or how.json)
    require_folder(out)
    made = partial(transcribe, backend=backend, threads=1 if jobs > 1 or how.on else None)
    limits = BatchLimits(how.retries, how.timeout, how.budget)
    with watch(len(asked), how.quiet, how.json) as observer:
        if how.on:
            batch = run_on(how.on, how.scheduler, asked, jobs, observer, made, out, limits, how.rerun)
        else:
            batch = run_batch(asked, jobs, observer, made, multi_start, limits, how.rerun)
    silent, over = how.json or how.quiet, batch.interrupted or not any(batch.results)
    limit = max(how.timeout, LEAST_PAGE)
    write = None if no_report or over else partial(write_reports, asked, out, pages, jobs, silent, limit)
    if silent:
        return conclude_silently(batch, observer, write)
    parts = observer.notes.seconds if jobs == 1 and not (multi_start or how.on) else {}
    return conclude(asked, batch, out, began, parts, write)


def print_notes(problems: list[Problem], solvers: tuple[str, ...] | None, jobs: list[Job], silent: bool) -> None:
    """Say which solvers were chosen, and what of a guess was not taken as it is; many pairs also where ``silent``."""
    from symphys.runs.choice import chosen_lines

    for problem in problems:
        if not silent:
            click.echo("".join(f"{line}\n" for line in chosen_lines(problem, solvers)), err=True, nl=False)
        if note := many_pairs(problem.name, len(problem.world().pairs)):
            click.echo(note, err=True)
    for note in () if silent else dict.fromkeys(f"{job.case}: {note}" for job in jobs for note in job.guess.notes):
        click.echo(note, err=True)


def require_folder(out: Path) -> None:
    """Make the folder of a batch; FileError, before anything is solved, if it cannot be written."""
    files.make_folder(out)
    if not os.access(out, os.W_OK | os.X_OK):
        raise files.FileError(f"cannot write into {out}: permission denied")


def print_previews(jobs: list[Job], rerun: str) -> int:
    """Say what would be done, and why, a run a line; the exit code."""
    from symphys.batches import previews

    todo = 0
    for each in previews(jobs, rerun):
        todo += each.todo
        click.echo(f"{each.job.name}: {'to do' if each.todo else each.stands}: {each.why}")
    click.echo(f"{todo} of {len(jobs)} runs are to do")
    return 0


def conclude(
    jobs: list[Job],
    batch: BatchResult,
    out: Path,
    began: float,
    parts: Mapping[str, float],
    write: Callable[[], MadePages] | None,
) -> int:
    """Show what came of it; ``write``: makes the pages; the exit code."""
    from symphys.cli.summary import print_summary

    print_summary(jobs, batch)
    if batch.interrupted or not any(batch.results):
        click.echo(last_words(batch, out), err=True)
        return exit_code(batch, None)
    made = write() if write else None
    if batch.spent:
        click.echo(last_words(batch, out), err=True)
    click.echo(time_line(perf_counter() - began, parts))
    there = made is not None and all(fault.page != made.page for fault in made.faults)
    again = f"`symphys report {shlex.quote(str(out))}` makes one"
    click.echo(f"report: {made.page}" if made and there else f"no report; {again}")
    return exit_code(batch, made)


def conclude_silently(batch: BatchResult, observer: Shown, write: Callable[[], MadePages] | None) -> int:
    """Make the pages, and say no more than events; the exit code."""
    from symphys.cli.watching.events import Events

    code = exit_code(batch, write() if write else None)
    if isinstance(observer, Events):
        observer.finished(batch, code)
    return code


def exit_code(batch: BatchResult, made: MadePages | None) -> int:
    """Of a batch and its pages."""
    if batch.interrupted:
        return INTERRUPTED
    if not batch.accepted:
        return 1
    return UNDRAWN if made and made.faults else 0


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


def write_reports(jobs: list[Job], out: Path, pages: str, processes: int, silent: bool, limit: float) -> MadePages:
    """Make the pages of the runs that are new, and that of the batch; ``silent``: say only which cannot be made.

    ``limit``: [s] that the page of a run may take; inf where runs have no timeout.
    """
    from symphys.report import WantedPages, outdated
    from symphys.results.file_names import RESULT

    over = dict.fromkeys(job.folder.path for job in jobs if (job.folder.path / RESULT).exists())
    new = [folder for folder in over if outdated(folder)]
    return make_shown(WantedPages(out, tuple(new)), pages, processes, silent, limit)
