"""Solve one problem with one solver."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from symphys import threads as linear_algebra
from symphys.api.solution import Solution
from symphys.api.transcriptions import transcribed
from symphys.codegen.backends import require_backend
from symphys.errors import SymphysError
from symphys.interrupts import Interrupts
from symphys.problem import Problem
from symphys.problem.problem import Source, load
from symphys.results.run import read_run
from symphys.runs import Job, Result, RunGuess, execute, make_jobs, read_guess_run
from symphys.runs.choice import chosen
from symphys.solvers import TraceRow
from symphys.transcription import Transcription, guessed

Progress = Callable[[TraceRow], None]
"""A function that is called with each iteration."""
Guess = Solution | str | Path
"""A run whose solution is the guess: the solution, or the path of its folder."""


def solve(
    problem: Source,
    solver: str | None = None,
    seed: int = 0,
    *,
    guess: Guess | None = None,
    folder: str | Path | None = None,
    examine: bool = False,
    backend: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    **options: object,
) -> Solution:
    """Solve a problem.

    Args:
        problem: any argument of ``load``.
        solver: the name of a solver. None: the first that the problem names, else the one that suits its structure
            (``symphys.runs.choice``); ``solution.run.provenance["chosen"]`` then gives the reason.
        seed: 0 starts from the guess; other seeds perturb it by the ``spread`` of each variable.
        guess: another run to start from, a solution or the path of its folder: its variables by name, resampled from
            any knots, step or duration, and with ``multiple_shooting`` its motion and multipliers. The log in the run
            folder lists what could not be taken over.
        folder: the folder in which run folders are kept, as with ``symphys solve --out``: a run that is done is read,
            an interrupted one is resumed. None: the run is removed together with the solution.
        examine: whether to examine how far the solution can be trusted, which may take longer than the solve.
        backend: the evaluator: "auto", "simd", "simd32", "c", "cuda", "cuda32" or "casadi".
        threads: number of threads that share a batch; None: one for each processor.
        progress: a function that is called with each iteration: its ``iteration``, ``objective``, ``max_violation``
            and ``seconds``.
        options: options of the solver, as in its table [solver.NAME]: ``iterations=200``. An option named ``backend``
            is set by ``problem.set``.

    Returns:
        The best point that was found, whether or not it solves the problem; ``solved`` and ``verdict`` tell.

    Raises:
        ProblemError: the problem or an option cannot be used; says what would be valid.
        SymphysError: there is no such solver or backend, the run failed, or nothing of the guess fits.
        KeyboardInterrupt: after Ctrl-C; with a ``folder``, the same call resumes.

    Example:
        >>> import symphys
        >>> solution = symphys.solve("ball_throw", solver="least_squares", backend="casadi")
        >>> solution.solved, sorted(solution.value)
        (True, ['spin', 'throw'])
    """
    require_backend(backend)
    read_in, taken = load(problem), guess_of(guess)
    name = solver or (read_in.solvers or [each.solver for each in chosen(read_in)])[0]
    asked = read_in.set({f"solver.{name}.{key}": value for key, value in options.items()}) if options else read_in
    with kept(folder) as out:
        solvers, settings = [solver] if solver else None, dict(asked.settings)
        job = make_jobs([asked], solvers, [seed], settings, out, "", backend, examine, taken)[0]
        if run(job, read_in, backend, threads, progress).interrupted:
            later = "with a folder, the same call would go on" if folder is None else "the same call goes on from there"
            raise KeyboardInterrupt(f"interrupted in {job.folder.path}; {later}")
        path = job.folder.path
        solution = Solution(path, read_run(path, path), given=asked)
    if folder is None:
        weakref.finalize(solution, shutil.rmtree, out, ignore_errors=True)
    return solution


def guess_of(source: Guess | None) -> RunGuess | None:
    """Read the solution of the run that is the guess, if one is named; SymphysError if it has none."""
    if source is None:
        return None
    return read_guess_run(source.folder if isinstance(source, Solution) else source)


@contextmanager
def kept(folder: str | Path | None) -> Iterator[Path]:
    """Yield the folder, or a temporary one, which is removed if the block raises."""
    if folder is not None:
        yield Path(folder)
        return
    out = Path(tempfile.mkdtemp(prefix="symphys-"))
    try:
        yield out
    except BaseException:
        shutil.rmtree(out, ignore_errors=True)
        raise


def run(job: Job, problem: Problem, backend: str, threads: int | None, progress: Progress | None) -> Result:
    """Execute a job in its folder, with the transcription of a problem that differs in solver options only."""
    with linear_algebra.limited(), Interrupts().listening() as stop:

        def monitor(row: TraceRow) -> None:
            if stop():
                raise KeyboardInterrupt
            if progress:
                progress(row)

        def made(job: Job) -> Transcription:
            found = transcribed(problem, not job.smooth, backend, threads)
            return guessed(found, job.problem) if job.guess.digest else found

        result = execute(job, monitor, made)
    if result.status == "failed":
        raise SymphysError(result.advice)
    return result
