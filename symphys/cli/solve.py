"""``symphys solve``: problems times solvers times seeds."""

from __future__ import annotations

import math
import os
import re
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
    INTERRUPTED,
    UsageFault,
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
from symphys.cli.report import UNDRAWN, make_shown, pages_option, wants_figures
from symphys.cli.wording import duration, many_pairs

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.cli.watching.observers import Shown
    from symphys.problem import Problem
    from symphys.report.making.batch import MadePages
    from symphys.runs import Job

UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""[s] of each unit."""
MAX_RETRIES, MAX_SEEDS, MAX_JOBS = 1000, 10_000, 256
MIN_PAGE_TIMEOUT = 60.0
"""[s] Least timeout of a page where runs have a timeout."""


def read_time(_context: click.Context | None, option: click.Parameter, text: str | None) -> float:
    """Return the seconds of a time such as 90, 10min or 2h; inf for None; UsageFault for anything else."""
    if text is None:
        return math.inf
    found = re.fullmatch(r"\s*([0-9.]+)\s*([a-z]*)\s*", text)
    try:
        seconds = float(found[1]) * UNITS[found[2]] if found else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not seconds > 0:
        raise UsageFault(f"{option.opts[0]} {text!r}: write a time above 0, such as 90, 90s, 10min, 2h or 1d")
    return seconds


@click.command()
@click.argument("sources", metavar="FILE...", nargs=-1, required=True, shell_complete=complete_problem)
@click.option(
    "--solver",
    "names",
    metavar="A,B",
    shell_complete=complete_solvers,
    help="Solvers, separated by commas.  [default: those of the file, else an automatic choice]",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, MAX_SEEDS),
    default=1,
    show_default=True,
    help="Number of seeds. Seed 0 starts from the guess; the others perturb it by the spread of each variable.",
)
@click.option(
    "--guess",
    "guess_from",
    metavar="RUN_FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Start from the solution of another run. Variables match by name and are resampled to the knots of this "
    "problem; multiple_shooting also uses the motion and the multipliers.",
)
@settings_option
@sweep_options
@click.option(
    "--jobs",
    type=click.IntRange(1, MAX_JOBS),
    default=1,
    show_default=True,
    help="Number of parallel runs; with --on, number of workers.",
)
@click.option(
    "--multi-start",
    "--together",
    "multi_start",
    is_flag=True,
    help="Solve the seeds of gradient and least_squares in one process, with batched evaluations. Faster in total; "
    "each run reports the time of all.",
)
@click.option(
    "--unexamined",
    is_flag=True,
    help="Skip the examination of solutions, which is slow for long motions; `symphys check --at RUN_FOLDER` does it "
    "later.",
)
@click.option("--no-report", is_flag=True, help="Write no pages; `symphys report DIR` writes them later.")
@pages_option
@backend_option
@out_option
@click.option(
    "--retries",
    type=click.IntRange(0, MAX_RETRIES),
    default=0,
    show_default=True,
    help="Number of retries of a failed run. A run whose process died is always retried once.",
)
@click.option(
    "--timeout",
    metavar="TIME",
    callback=read_time,
    help="Stop a run after this time: 90 (seconds), 10min, 2h. The same command resumes it.",
)
@click.option(
    "--budget",
    metavar="TIME",
    callback=read_time,
    help="Stop the whole batch after this time. The same command resumes it.",
)
@click.option(
    "--rerun",
    type=click.Choice(("failed", "changed", "all")),
    default=None,
    help="Repeat runs: those that failed, those of another version of symphys, or all.",
)
@click.option("--dry-run", is_flag=True, help="Print what would run, and why; run nothing.")
@click.option("--json", is_flag=True, help="Print events to stdout, one JSON object a line.")
@click.option("--live", is_flag=True, help="Show the progress in a browser on this machine.")
@click.option("--quiet", is_flag=True, help="Print failures only.")
@click.option(
    "--on",
    type=click.Choice(("dask", "slurm")),
    default=None,
    help="Distribute the runs over --jobs workers: dask workers, or Slurm jobs.",
)
@click.option(
    "--scheduler",
    metavar="TEXT",
    help="dask: address of a cluster, e.g. tcp://host:8786  [default: workers on this machine]. slurm: job parameters, "
    "e.g. partition=short,timeout_min=60,mem_gb=4, or local.",
)
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
    pages: str | None,
    backend: str,
    out: Path,
    retries: int,
    timeout: float,
    budget: float,
    rerun: str | None,
    dry_run: bool,
    json: bool,
    quiet: bool,
    on: str | None,
    scheduler: str | None,
    live: bool,
) -> int:
    """Solve problems, and write a report.

    FILE is a problem file, or the name of a shipped problem (see `symphys list`). Completed runs are reused;
    interrupted runs resume.
    """
    began = perf_counter()
    threads.limit()
    figures = wants_figures(pages, False)
    if scheduler and not on:
        raise UsageFault(f"--scheduler {scheduler!r} needs --on dask or --on slurm")
    if on and multi_start:
        raise UsageFault(f"--multi-start solves seeds side by side in one process: leave it or --on {on} out")
    from symphys.batches import BatchLimits, run_batch, run_on
    from symphys.cli.watching import LivePage, watch, working
    from symphys.report.making.stamps import BATCH_PAGE
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
    if dry_run:
        return print_previews(asked, rerun or "")
    print_notes(problems, solvers, asked, quiet or json)
    require_folder(out)
    made = partial(transcribe, backend=backend, threads=1 if jobs > 1 or on else None)
    limits = BatchLimits(retries, timeout, budget)
    with watch(len(asked), quiet, json) as observer:
        page = LivePage(observer, out) if live else None
        watching = page or observer
        if page:
            observer.note(f"live: {page.address}")
        if on:
            batch = run_on(on, scheduler or "", asked, jobs, watching, made, out, limits, rerun or "")
        else:
            batch = run_batch(asked, jobs, watching, made, multi_start, limits, rerun or "")
    silent, over = json or quiet, batch.interrupted or not any(batch.results)
    limit = max(timeout, MIN_PAGE_TIMEOUT)
    write = None if no_report or over else partial(write_reports, asked, out, figures, jobs, silent, limit)
    parts = observer.notes.seconds if jobs == 1 and not (multi_start or on) else {}
    try:
        if silent:
            return conclude_silently(batch, observer, write)
        return conclude(asked, batch, out, began, parts, write)
    finally:
        if page:
            page.close(out / BATCH_PAGE if write and (out / BATCH_PAGE).is_file() else None)


def print_notes(problems: list[Problem], solvers: tuple[str, ...] | None, jobs: list[Job], silent: bool) -> None:
    """Print the solvers that were chosen and the notes on guesses unless ``silent``; many pairs always."""
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
    """Print what would be done, and why, a run a line; return the exit code."""
    from symphys.batches import previews

    todo = 0
    for each in previews(jobs, rerun):
        todo += each.todo
        click.echo(f"{each.job.name}: {'to do' if each.todo else each.state}: {each.why}")
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
    """Print the summary, make the pages with ``write``, and return the exit code."""
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
    click.echo(f"report: {made.page.resolve().as_uri()}" if made and there else f"no report; {again}")
    return exit_code(batch, made)


def conclude_silently(batch: BatchResult, observer: Shown, write: Callable[[], MadePages] | None) -> int:
    """Make the pages without output except events; return the exit code."""
    from symphys.cli.watching.events import Events

    code = exit_code(batch, write() if write else None)
    if isinstance(observer, Events):
        observer.finished(batch, code)
    return code


def exit_code(batch: BatchResult, made: MadePages | None) -> int:
    """Return the exit code of a batch and its pages."""
    if batch.interrupted:
        return INTERRUPTED
    if not batch.accepted:
        return 1
    return UNDRAWN if made and made.faults else 0


def last_words(batch: BatchResult, out: Path) -> str:
    """Return how a batch was interrupted, or its time used up, and how to resume it."""
    why = "interrupted" if batch.interrupted else "the time of the batch is used up" if batch.spent else "nothing ran"
    over = sum(result is not None and not result.interrupted for result in batch.results)
    halfway = sum(result is not None and result.interrupted for result in batch.results)
    return (
        f"symphys: {why}; {over} of {len(batch.results)} runs are done and {halfway} halfway, saved in {out}; "
        "the same command goes on from there"
    )


LONG = 10.0
"""[s] Time from which it is said how to shorten it."""
SHORTER = {
    "compiling": "what was compiled is kept, so that the next command takes less",
    "judging": "--unexamined leaves out most of that",
    "reports and the rest": "--no-report leaves out most of the last",
}


def time_line(total: float, parts: Mapping[str, float]) -> str:
    """Return the total time of the command and its known parts, as a line; of most of a long time how to shorten it."""
    named = {"building": "build", "compiling": "compile", "solving": "solve", "judging": "judge"}
    shares = {word: parts[key] for word, key in named.items() if parts.get(key)}
    if not shares:
        return f"time: {duration(total)} s in all"
    shares["reports and the rest"] = max(total - sum(shares.values()), 0.0)
    most = max(shares, key=lambda word: shares[word])
    hint = f"; {SHORTER[most]}" if most in SHORTER and shares[most] > max(total / 2, LONG) else ""
    listed = ", ".join(f"{word} {duration(part)} s" for word, part in shares.items())
    return f"time: {duration(total)} s in all; {listed}{hint}"


def write_reports(jobs: list[Job], out: Path, figures: bool, processes: int, silent: bool, limit: float) -> MadePages:
    """Make the pages of new runs and of the batch; ``silent``: report only pages that cannot be made.

    ``figures``: whether every figure of every run is written as a file too.
    ``limit``: [s] that the page of a run may take; inf where runs have no timeout.
    """
    from symphys.report import WantedPages, outdated
    from symphys.results.file_names import RESULT

    over = dict.fromkeys(job.folder.path for job in jobs if (job.folder.path / RESULT).exists())
    new = [folder for folder in over if figures or outdated(folder)]
    return make_shown(WantedPages(out, tuple(new)), processes, silent, limit, figures)
