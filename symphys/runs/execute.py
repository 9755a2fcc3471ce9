"""One run from its beginning to a finished folder."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from symphys import files
from symphys.errors import SymphysError, Unavailable
from symphys.results.file_names import CHECKPOINT, LOG, RESULT
from symphys.results.result import Result
from symphys.runs.folder import FolderBusy
from symphys.runs.job import Job
from symphys.runs.record import failure
from symphys.runs.requirements import transcribed
from symphys.runs.solving import silent, solve
from symphys.runs.transcription_cache import Transcriptions
from symphys.solvers import Monitor, Outcome


def execute(
    job: Job,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = silent,
) -> Result:
    """Do the run, or go on with it, unless it is done; write its folder; return what it found.

    ``monitor`` sees each iteration and may raise KeyboardInterrupt, which ends the run so that it can go on later.
    ``solved``: what its solver has found already, side by side with other seeds. ``tell``: see ``solving.solve``.
    A run that fails is a result with the status "failed"; only a FileError, a folder that cannot be written, is raised.
    """
    try:
        with job.folder.locked():
            earlier = job.folder.earlier(job.config)
            if earlier and not (earlier.interrupted or earlier.again):
                return earlier
            return proceed(job, monitor, transcriptions, earlier, solved, tell)
    except FolderBusy as error:
        return failure(job, str(error))


def proceed(
    job: Job,
    monitor: Monitor,
    transcriptions: Transcriptions,
    earlier: Result | None,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = silent,
) -> Result:
    """Solve and write down what came of it; ``earlier`` is the run to go on with."""
    checkpoint = job.folder.checkpoint() if earlier else None
    if not checkpoint:
        checkpoint = earlier = None
        job.folder.begin(job.config, job.problem.text)
    log = Log(job)
    try:
        result = solve(job, transcribed(job, transcriptions), monitor, log, checkpoint, earlier, solved, tell)
    except files.FileError:
        raise
    except Unavailable as error:
        result = failure(job, str(error), again=True)
    except SymphysError as error:
        result = failure(job, str(error))
    except Exception as error:  # one broken run must not take the others with it
        log(traceback.format_exc())
        result = failure(job, f"unexpected {type(error).__name__}: {error} (details in {job.folder.path / LOG})")
    finally:
        log.write()
    finish(job, result)
    return result


class Log:
    """The text of log.txt: messages of the solver, line by line; a continued run adds to what is there."""

    def __init__(self, job: Job) -> None:
        """Start from what an interrupted run wrote."""
        self.path = job.folder.path / LOG
        self.text = files.read_text(self.path) if self.path.exists() else ""

    def __call__(self, line: str) -> None:
        """Add a line."""
        self.text += line.rstrip("\n") + "\n"

    def write(self) -> None:
        """Write the file."""
        files.write_text(self.path, self.text)


def finish(job: Job, result: Result) -> None:
    """Write the result, last of all files, so that it exists only where the others are whole.

    What an interrupted run left stays where the same command goes on from there.
    """
    files.write_json(job.folder.path / RESULT, result.to_json())
    if not (result.interrupted or result.again):
        files.remove(job.folder.path / CHECKPOINT)


def give_up(job: Job, message: str) -> Result:
    """Write that the run failed."""
    result = failure(job, message)
    finish(job, result)
    return result
