"""``symphys solve``: problems times solvers times seeds, and the table of their results."""

from __future__ import annotations

import math
import os
import re
import shlex
import statistics
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

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
from symphys.cli.report import UNDRAWN, make_shown, pages_option
from symphys.cli.wording import duration, first_line, many_pairs, measured, number, verdict, whole
from symphys.findings.examination import Examination, HeldBound
from symphys.findings.obstacles import MOST_BOUNDS, bound_words, holding
from symphys.findings.verdict import BEST_FOUND, DOUBTED, NOT_SOLVED

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.runs import Job, Result

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.cli.watching.observers import Shown
    from symphys.problem import Problem
    from symphys.report.making.batch import MadePages
    from symphys.runs import Job


Groups = Mapping[tuple[str, str], list["Result"]]
"""Results by (problem with its settings, solver)."""
MIN_WIDTH = 120
"""Least width of the table where the output is no terminal."""
NUMBERS = ("solved", "objective", "worst", "iterations", "work", "seconds", "ended")
OPTIONAL = ("work", "iterations", "seconds", "objective", "ended")
"""Columns that are left out on narrow terminals, in this order; no number is cut."""
MAX_ROWS = 30
"""Rows of the table; if there are more, the best and the worst are shown."""
MAX_ADVICE = 10
"""Lines of advice below a table of the best and the worst."""
MAX_MISSED = 3
"""Missed checks of a run that are named."""


def print_summary(jobs: list[Job], batch: BatchResult) -> None:
    """Print the table, and advice for runs that are not solved."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for job, result in zip(jobs, batch.results, strict=True):
        group = groups.setdefault((job.case, job.config.solver), [])
        if result is not None:
            group.append(result)
    console = Console()
    if not console.is_terminal:
        console = Console(width=max(console.width, MIN_WIDTH))
    shown = best_and_worst(groups)
    console.print(fitting_table(shown, console.width, len(groups) - len(shown)))
    if len(shown) < len(groups):
        console.print(Text(counts(batch, len(groups))), soft_wrap=True)
    for line in advice(shown) if len(shown) == len(groups) else advice_together(shown):
        console.print(Text(line), soft_wrap=True)


def best_and_worst(groups: Groups) -> Groups:
    """Return all groups, or, if they do not fit into a table, the best and the worst ones, sorted."""
    if len(groups) <= MAX_ROWS:
        return groups
    ranked = sorted(groups, key=lambda name: rank(groups[name]))
    half = MAX_ROWS // 2
    return {name: groups[name] for name in (*ranked[:half], *ranked[-half:])}


def rank(group: list[Result]) -> tuple[float, float, float]:
    """Return a sort key, lower for better groups: share of failures, largest error, objective."""
    missed = sum(not result.accepted for result in group) / len(group) if group else math.inf
    worst = median(result.worst_ratio for result in group if not result.accepted)
    objective = median(known(result, "objective") for result in group)
    worst, objective = (math.inf if each is None or math.isnan(each) else each for each in (worst, objective))
    return missed, worst, objective


def counts(batch: BatchResult, groups: int) -> str:
    """Return how many runs ended in which way."""
    ends = Counter("not begun" if result is None else verdict(result) for result in batch.results)
    listed = ", ".join(f"{count:,} {words}" for words, count in ends.most_common())
    return f"{len(batch.results):,} runs: {listed}. The best and the worst of {groups:,} rows are shown."


def fitting_table(groups: Groups, width: int, left_out: int = 0) -> Table:
    """Return the table with as many columns as fit the width; names are wrapped if too few do."""
    for count in range(len(OPTIONAL) + 1):
        columns = [name for name in NUMBERS if name not in OPTIONAL[:count]]
        shown = table(groups, columns, left_out)
        if Console(width=1000).measure(shown).maximum <= width:
            break
    return shown


def table(groups: Groups, columns: Sequence[str] = NUMBERS, left_out: int = 0) -> Table:
    """Return the table of groups with these columns; a row in its middle says how many are left out."""
    several = any(len(group) > 1 for group in groups.values())
    caption = "worst: largest error / tolerance, met at 1; work in rollouts" + ("; medians over the seeds" * several)
    shown = Table(box=SIMPLE_HEAD, caption=caption, caption_justify="left")
    for name in ("problem", "solver"):
        shown.add_column(name, overflow="fold")
    for name in columns:
        shown.add_column(name, justify="left" if name == "ended" else "right", no_wrap=name != "ended")
    for row, ((problem, solver), group) in enumerate(groups.items()):
        if left_out and 2 * row == len(groups):
            shown.add_row(Text(f"... {left_out:,} more ...", style="dim"))
        found = cells(group)
        shown.add_row(Text(problem), Text(solver), *(found[name] for name in columns))
    return shown


def cells(group: list[Result]) -> dict[str, Text]:
    """Return the cells of one row, by column."""
    solved = sum(result.solved for result in group)
    ends = Counter(ended(result) for result in group)
    texts = [
        number(median(known(result, "objective") for result in group)),
        number(median(result.worst for result in group)),
        whole(median(known(result, "iterations") for result in group)),
        whole(median(known(result, "equivalents") for result in group)),
        duration(median(result.seconds.get("solve") for result in group)),
        ", ".join(status if count == len(group) else f"{status} {count}" for status, count in ends.items()),
    ]
    fine = group and all(result.accepted for result in group)
    style = "red" if not fine else "green" if solved == len(group) else "yellow"
    first = Text(f"{solved}/{len(group)}", style=style)
    return dict(zip(NUMBERS, [first, *map(Text, texts)], strict=True))


def known(result: Result, name: str) -> float | None:
    """Return a number of a result; None if the run did not reach it."""
    return None if name in result.absent else getattr(result, name)


def ended(result: Result) -> str:
    """Return how a run ended: the status of its solver, or the verdict where that says more."""
    return verdict(result) if result.verdict in (DOUBTED, BEST_FOUND) else result.status.replace("_", " ")


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the known values; None if there are none."""
    found = [value for value in values if value is not None]
    return statistics.median(found) if found else None


def advice(groups: Groups) -> list[str]:
    """Return why runs are doubted, and what to try for unsolved ones, each once per problem and solver."""
    lines = [
        f"{problem} {solver}: {line}"
        for (problem, solver), group in groups.items()
        for result in group
        for line in said(result)
        if line
    ]
    held = [f"{problem} {solver}: {line}" for (problem, solver), group in groups.items() for line in held_back(group)]
    return list(dict.fromkeys(lines + held))


def advice_together(groups: Groups) -> list[str]:
    """Return the advice for many groups: each line once, with the first group as an example."""
    examples: dict[str, list[str]] = {}
    for (problem, solver), group in groups.items():
        for line in advice({("", ""): group}):
            examples.setdefault(line.removeprefix(" : "), []).append(f"{problem} {solver}")
    lines = [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {line}"
        for line, names in sorted(examples.items(), key=lambda item: -len(item[1]))
    ]
    more = [f"and {len(lines) - MAX_ADVICE} more such lines"] if len(lines) > MAX_ADVICE else []
    return lines[:MAX_ADVICE] + more


def held_back(group: list[Result]) -> list[str]:
    """Return how many of several seeds end at the same bound, where a bound holds one of them back."""
    if len(group) < 2:
        return []
    bounds = [bound for result in group if not result.solved for bound in held_bounds(result)]
    counts = Counter(bound_words(bound, knots=False) for bound in bounds)
    total = f"of {len(group)} seeds"
    return [
        f"{count} {total} {'ends' if count == 1 else 'end'} at {words}"
        for words, count in counts.most_common(MOST_BOUNDS)
    ]


def held_bounds(result: Result) -> tuple[HeldBound, ...]:
    """Return the bounds that hold a run back."""
    return holding(Examination.from_json(dict(result.trust)), result.judge(result.verdict != NOT_SOLVED))


def said(result: Result) -> list[str]:
    """Return the lines on one run."""
    if result.verdict == DOUBTED:
        return [f"not to be trusted: {'; '.join(result.doubts)}"]
    return [] if result.solved else [missed(result), first_line(result.advice)]


def missed(result: Result) -> str:
    """Return the missed checks with their errors, the worst first; empty if there are none."""
    found = sorted((check for check in result.checks if not check.met), key=lambda check: -check.ratio)
    if not found:
        return ""
    named = [
        f'"{each.name}" by {measured(each.error, each.unit)} (tolerance {measured(each.tolerance, each.unit)})'
        for each in found
    ]
    more = f" and {len(found) - MAX_MISSED} more" if len(found) > MAX_MISSED else ""
    return f"missed: {', '.join(named[:MAX_MISSED])}{more}"


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
    help="Solvers, separated by commas.  [default: the file's `solvers`, else what fits it]",
)
@click.option(
    "--seeds",
    type=click.IntRange(1, MAX_SEEDS),
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
    type=click.IntRange(1, MAX_JOBS),
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
@click.option(
    "--retries",
    type=click.IntRange(0, MAX_RETRIES),
    default=0,
    show_default=True,
    help="How often a run that fails is tried again; one whose process dies is so once in any case.",
)
@click.option(
    "--timeout",
    metavar="TIME",
    callback=read_time,
    help="End a run after so long, whatever it is at: 90, 10min, 2h. It can go on later.",
)
@click.option(
    "--budget", metavar="TIME", callback=read_time, help="Stop the whole batch after so long. The same command goes on."
)
@click.option(
    "--rerun",
    type=click.Choice(("failed", "changed", "all")),
    default=None,
    help="Do again what is over: runs that failed, those of another version of symphys, or all.",
)
@click.option("--dry-run", is_flag=True, help="Say what would be done, and why, and do nothing.")
@click.option("--json", is_flag=True, help="Write what happens to stdout, a JSON object a line.")
@click.option("--quiet", is_flag=True, help="Show nothing but failures.")
@click.option(
    "--on",
    type=click.Choice(("dask", "slurm")),
    default=None,
    help="Let as many drivers as --jobs says do the runs: on dask workers, or as jobs of Slurm.",
)
@click.option(
    "--scheduler",
    metavar="TEXT",
    help="dask: the address of a cluster, tcp://host:8786, instead of workers here. slurm: what to ask for, "
    "partition=short,timeout_min=60,mem_gb=4, or local.",
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
    pages: str,
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
) -> int:
    """Solve problems, and write a report.

    FILE is a problem file, or the name of a shipped problem (see `symphys list`). What is done already is not done
    again, and what was interrupted goes on where it stopped.
    """
    began = perf_counter()
    threads.limit()
    if scheduler and not on:
        raise UsageFault(f"--scheduler {scheduler!r} needs --on dask or --on slurm")
    if on and multi_start:
        raise UsageFault(f"--multi-start solves seeds side by side in one process: leave it or --on {on} out")
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
    if dry_run:
        return print_previews(asked, rerun or "")
    print_notes(problems, solvers, asked, quiet or json)
    require_folder(out)
    made = partial(transcribe, backend=backend, threads=1 if jobs > 1 or on else None)
    limits = BatchLimits(retries, timeout, budget)
    with watch(len(asked), quiet, json) as observer:
        if on:
            batch = run_on(on, scheduler or "", asked, jobs, observer, made, out, limits, rerun or "")
        else:
            batch = run_batch(asked, jobs, observer, made, multi_start, limits, rerun or "")
    silent, over = json or quiet, batch.interrupted or not any(batch.results)
    limit = max(timeout, MIN_PAGE_TIMEOUT)
    write = None if no_report or over else partial(write_reports, asked, out, pages, jobs, silent, limit)
    if silent:
        return conclude_silently(batch, observer, write)
    parts = observer.notes.seconds if jobs == 1 and not (multi_start or on) else {}
    return conclude(asked, batch, out, began, parts, write)


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


def time_line(total: float, parts: Mapping[str, float]) -> str:
    """Return the total time of the command and its known parts, as a line."""
    named = {"building": "build", "compiling": "compile", "solving": "solve"}
    shares = {word: parts[key] for word, key in named.items() if parts.get(key)}
    if not shares:
        return f"time: {duration(total)} s in all"
    shares["judging and reports"] = max(total - sum(shares.values()), 0.0)
    return f"time: {duration(total)} s in all; {', '.join(f'{word} {duration(part)}' for word, part in shares.items())}"


def write_reports(jobs: list[Job], out: Path, pages: str, processes: int, silent: bool, limit: float) -> MadePages:
    """Make the pages of new runs and of the batch; ``silent``: report only pages that cannot be made.

    ``limit``: [s] that the page of a run may take; inf where runs have no timeout.
    """
    from symphys.report import WantedPages, outdated
    from symphys.results.file_names import RESULT

    over = dict.fromkeys(job.folder.path for job in jobs if (job.folder.path / RESULT).exists())
    new = [folder for folder in over if outdated(folder)]
    return make_shown(WantedPages(out, tuple(new)), pages, processes, silent, limit)
