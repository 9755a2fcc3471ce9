"""One solve, from a problem to its solution."""

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
from symphys.problem.loading import Source, load
from symphys.results.run import read_run
from symphys.runs import Job, Result, RunGuess, execute, make_jobs, read_guess_run
from symphys.runs.choice import chosen
from symphys.solvers import TraceRow
from symphys.transcription import Transcription, guessed

Progress = Callable[[TraceRow], None]
Guess = Solution | str | Path
"""What names a run whose solution is a guess."""


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
        problem: what ``load`` takes.
        solver: its name; None: the first that the problem names, else the one that fits it best, see
            ``symphys.runs.choice``; then ``solution.run.provenance["chosen"]`` says why.
        seed: 0 starts from the guess; others from one perturbed by the ``spread`` of each variable.
        guess: another run from which to start, a solution or the path of its folder: its variables by name, on any grid
            of knots, step or duration, and with ``multiple_shooting`` its motion and multipliers. The log in the run
            folder says what did not fit.
        folder: where run folders are kept, as by ``symphys solve --out``: what is done already is not done again, what
            was interrupted goes on. None: nothing is kept.
        examine: whether to examine how far the solution can be trusted, which may take longer than the solve.
        backend: what evaluates: "auto", "simd", "simd32", "c", "cuda", "cuda32" or "casadi".
        threads: that share a batch; None: one for each processor.
        progress: sees each iteration: its ``iteration``, ``objective``, ``max_violation``, ``seconds``.
        options: of the solver, as in its table [solver.NAME]: ``iterations=200``; its ``backend`` by ``problem.set``.

    Returns:
        The solution, whether or not it is one; see ``solved`` and ``verdict``.

    Raises:
        ProblemError: the problem or an option cannot be used; says what would be valid.
        SymphysError: there is no such solver or backend, the run failed, or nothing of the guess fits.
        KeyboardInterrupt: after Ctrl-C; with a ``folder``, the same call goes on from there.

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
    """What a run found, if one is named; SymphysError if there is nothing."""
    if source is None:
        return None
    return read_guess_run(source.folder if isinstance(source, Solution) else source)


@contextmanager
def kept(folder: str | Path | None) -> Iterator[Path]:
    """The folder, or a temporary one, which goes only where nothing comes of it."""
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
    """Do what is asked for into its folder; options of a solver do not change what is compiled for the problem."""
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
