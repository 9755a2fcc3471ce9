"""Solve batches: problems times points of sweeps times solvers times seeds, as ``symphys solve`` does."""

from __future__ import annotations

import math
import shutil
import weakref
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, TypedDict, Unpack

from symphys.api.solution import Solution
from symphys.api.solving import Guess, guess_of, kept
from symphys.batches import ENGINES, BatchLimits, BatchResult, Observer, run_batch, run_on
from symphys.codegen.backends import require_backend
from symphys.errors import SymphysError
from symphys.problem import Problem
from symphys.problem.problem import Source, load, plain
from symphys.problem.sweeps.points import combined, swept
from symphys.problem.sweeps.reading import read_sweep
from symphys.records import dataclass
from symphys.results.run import read_run
from symphys.runs import Job, make_jobs
from symphys.runs.execute import Transcribe
from symphys.runs.inspection import RERUN
from symphys.solvers import TraceRow
from symphys.suggest import hint
from symphys.transcription import transcribe

BatchProgress = Callable[[str, TraceRow], None]
"""A function that is called with the name of a run, ``"ball_throw gradient seed 0"``, and its iteration."""


class BatchArguments(TypedDict, total=False):
    """Limits of a batch, and what its runs start from.

    Attributes:
        retries: how often a run that fails is tried again; 0 if not given.
        timeout: largest time of a run [s], transcription and compilation included. With a folder, the same call resumes
            runs that were stopped. A run with a limit has its own process, which is killed 1 s after the signal to
            stop.
        budget: largest time of all runs together [s], likewise.
        rerun: which finished runs are done again: "failed", "changed" (by another version of symphys) or "all".
        guess: another run from which all start, as in ``solve``.
    """

    retries: int
    timeout: float | None
    budget: float | None
    rerun: str | None
    guess: Guess | None


def solve_all(
    problems: Iterable[Source],
    solvers: Sequence[str] | None = None,
    seeds: int | Iterable[int] = 1,
    *,
    jobs: int = 1,
    folder: str | Path | None = None,
    examine: bool = False,
    multi_start: bool = False,
    backend: str = "auto",
    progress: BatchProgress | None = None,
    sweep: Mapping[str, Any] | None = None,
    on: str | None = None,
    scheduler: str | None = None,
    **how: Unpack[BatchArguments],
) -> list[Solution]:
    """Solve problems with several solvers and seeds. A run that fails does not stop the others.

    Args:
        problems: each what ``load`` takes. Problems of equal name are numbered: ``ball_throw``, ``ball_throw-2``.
        solvers: names of solvers; None: for each problem those that it names, else those that suit it.
        seeds: the number of seeds, counted from 0, or the seeds; 0 starts from the guess.
        jobs: number of runs at once, each in its own process if there are several or a limit of time; a script then
            needs ``if __name__ == "__main__":`` around its own work.
        folder: the folder in which run folders are kept, as with ``symphys solve --out``: runs that are done are read.
            None: the runs are removed together with the last of the solutions.
        examine: whether to examine how far solutions can be trusted.
        multi_start: whether to solve all seeds of a problem in one process, with their evaluations in batches.
        backend: as in ``solve``.
        progress: a function that is called with each iteration of runs on this machine.
        on: ``"dask"`` or ``"slurm"``: ``jobs`` drivers do the runs elsewhere; needs a ``folder`` that all machines see.
        scheduler: as ``symphys solve --scheduler``; None: dask workers here, Slurm with its defaults.
        sweep: a table that replaces [sweep] of the problem file; None: the file's; ``{}``: no sweep.
        how: ``retries``, ``timeout`` [s], ``budget`` [s], ``rerun`` and ``guess``, as ``BatchArguments`` describes.

    Returns:
        The solutions, ordered by problem, point, solver and seed; ``run.status`` of a run may be "failed".

    Raises:
        SymphysError: a problem, a point or an argument cannot be used; nothing has been solved then.
        KeyboardInterrupt: after Ctrl-C; with a ``folder``, the same call resumes.

    Example:
        >>> import symphys
        >>> found = symphys.solve_all(["ball_throw"], ["least_squares"], sweep={"ball.mass": [1, 2]})
        >>> [(solution.problem.settings["ball.mass"], solution.solved) for solution in found]
        [(1, True), (2, True)]
    """
    check_engine(on, scheduler, folder, multi_start)
    limits, rerun = limits_of(how), how.get("rerun") or ""
    asked, counted = list(numbered(map(load, problems))), range(seeds) if isinstance(seeds, int) else tuple(seeds)
    with kept(folder) as out:
        common = (out, "", backend, examine, guess_of(how.get("guess")))
        points = chain.from_iterable(points_of(problem, sweep) for problem in asked)
        made = (make_jobs([each], solvers, counted, dict(each.settings), *common) for each in points)
        todo = list(chain.from_iterable(made))
        way = (jobs, ProgressObserver(progress), transcriber(backend, jobs > 1 or on is not None))
        if on:
            batch = run_on(on, scheduler or "", todo, *way, out, limits, rerun)
        else:
            batch = run_batch(todo, *way, multi_start, limits, rerun)
        return solutions_kept(todo, batch, None if folder else out)


def transcriber(backend: str, shared: bool) -> Transcribe:
    """Return the function that transcribes problems: on one thread each if several runs share the processors."""
    require_backend(backend)
    return partial(transcribe, backend=backend, threads=1 if shared else None)


def solutions_kept(todo: Sequence[Job], batch: BatchResult, temporary: Path | None) -> list[Solution]:
    """Read the solutions in the order of the jobs; the last of them removes a temporary folder."""
    solutions = list(solutions_of(todo, batch))
    if temporary is not None:
        drop_with(solutions, temporary)
    return solutions


def points_of(problem: Problem, table: Mapping[str, Any] | None) -> Iterable[Problem]:
    """Return the problems of a sweep, given by a table or by the problem; the problem itself without a sweep."""
    own = problem.sweep
    if table is not None:
        own = read_sweep(plain(table), "solve_all") if table else None
    return [problem] if own is None else swept(problem, combined(own, problem))


def limits_of(how: BatchArguments) -> BatchLimits:
    """Check and collect the limits of a batch."""
    rerun, retries = how.get("rerun"), how.get("retries", 0)
    times = [how.get("timeout"), how.get("budget")]
    if rerun is not None and rerun not in RERUN:
        raise SymphysError(f"rerun={rerun!r}: {hint(rerun, RERUN)}")
    if retries < 0 or any(each is not None and not each > 0 for each in times):
        raise SymphysError("retries must be 0 or more, timeout and budget seconds above 0")
    return BatchLimits(retries, *(math.inf if each is None else each for each in times))


def check_engine(on: str | None, scheduler: str | None, folder: str | Path | None, multi_start: bool) -> None:
    """Raise SymphysError for arguments that contradict each other."""
    if scheduler and not on:
        raise SymphysError(f"scheduler={scheduler!r} needs on: {' or '.join(map(repr, ENGINES))}")
    if on and on not in ENGINES:
        raise SymphysError(f"on={on!r}: {hint(on, ENGINES)}")
    if on and folder is None:
        raise SymphysError(f"on={on!r} needs a folder that all machines see, such as folder='results'")
    if on and multi_start:
        raise SymphysError(f"multi_start solves seeds side by side in one process: leave it or on={on!r} out")


def numbered(problems: Iterable[Problem]) -> Iterator[Problem]:
    """Append numbers to names that occur more than once."""
    seen: Counter[str] = Counter()
    for problem in problems:
        seen[problem.name] += 1
        count = seen[problem.name]
        yield replace(problem, name=f"{problem.name}-{count}") if count > 1 else problem


def solutions_of(jobs: Sequence[Job], batch: BatchResult) -> Iterator[Solution]:
    """Read the solutions in the order of the jobs; raise KeyboardInterrupt if the batch was interrupted."""
    if batch.interrupted:
        over = sum(result is not None and not result.interrupted for result in batch.results)
        raise KeyboardInterrupt(f"{over} of {len(jobs)} runs are done; with a folder, the same call goes on from there")
    for job in jobs:
        path = job.folder.path
        yield Solution(path, read_run(path, path), given=job.problem)


def drop_with(solutions: Sequence[Solution], out: Path) -> None:
    """Remove a temporary folder when the last of its solutions is gone."""
    left = set(range(len(solutions)))

    def gone(index: int) -> None:
        left.discard(index)
        if not left:
            shutil.rmtree(out, ignore_errors=True)

    for index, solution in enumerate(solutions):
        weakref.finalize(solution, gone, index)
    if not solutions:
        shutil.rmtree(out, ignore_errors=True)


@dataclass(frozen=True)
class ProgressObserver(Observer):
    """Pass the iterations of a batch to a function."""

    progress: BatchProgress | None

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Report an iteration."""
        if self.progress:
            self.progress(job.name, row)
