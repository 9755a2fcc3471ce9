"""One run from its beginning to a finished folder."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable
from time import monotonic

from symphys import files
from symphys.errors import SymphysError, Unavailable
from symphys.results.file_names import CHECKPOINT, LOG, RESULT
from symphys.results.result import Result
from symphys.results.table.journal import Journal
from symphys.runs.claim import Claim, FolderBusy, claimed, clear
from symphys.runs.job import Job
from symphys.runs.record import checkpoint_rows, failure, interruption
from symphys.runs.requirements import transcribed
from symphys.runs.solving import silent, solve
from symphys.runs.standing import MISSING, Standing, Stands, standing
from symphys.runs.transcription_cache import Transcriptions
from symphys.solvers import Monitor, Outcome

KEPT = 10.0
"""[s] between two checkpoints of a run that goes on, at least."""
SHARE = 50
"""A checkpoint takes at most one of so many seconds."""


def unheard(resumed: bool) -> None:
    """Tell nobody that a run begins."""


def execute(
    job: Job,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = silent,
    begin: Callable[[bool], None] = unheard,
    bounded: bool = False,
) -> Result:
    """Do the run, or go on with it, unless it is over; write its folder; return what it found.

    ``monitor`` sees each iteration and may raise KeyboardInterrupt, which ends the run so that it can go on later.
    ``solved``: what its solver has found already, side by side with other seeds. ``tell``: see ``solving.solve``.
    ``begin``: is called with whether it goes on, once it is claimed; not for a run that was over.
    ``bounded``: whether a limit may kill this process, so that checkpoints are kept as often as they are cheap.
    A run that fails is a result with the status "failed", and so is one whose folder cannot be written.

    Raises:
        FolderBusy: another process is at this run, or has taken it over.
    """
    found = standing(job)
    if found.result and over(job, found):
        return found.result
    try:
        with claimed(job.folder.path) as claim:
            return with_claim(job, claim, monitor, transcriptions, solved, tell, begin, bounded)
    except FolderBusy:
        raise
    except files.FileError as error:
        return failure(job, str(error), again=True)


def with_claim(
    job: Job,
    claim: Claim,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None = None,
    tell: Callable[[str], None] = silent,
    begin: Callable[[bool], None] = unheard,
    bounded: bool = False,
) -> Result:
    """``execute`` for a run that this process has claimed; FileError for a folder that cannot be written."""
    found = standing(job)
    if found.result and over(job, found):
        return found.result
    begin(found.checkpoint is not None)
    return proceed(job, claim, found, monitor, transcriptions, solved, tell, bounded)


def over(job: Job, found: Standing) -> bool:
    """Whether there is nothing to do, as the run is over and not to be made again."""
    return found.stands not in MISSING and (not job.outdated or found.stamp != job.outdated)


def proceed(
    job: Job,
    claim: Claim,
    found: Standing,
    monitor: Monitor,
    transcriptions: Transcriptions,
    solved: Outcome | None,
    tell: Callable[[str], None],
    bounded: bool = False,
) -> Result:
    """Solve and write down what came of it."""
    job.folder.clear()
    clear(job.folder.path, claim)
    if not found.checkpoint:
        job.folder.begin(job.config, job.problem.text)
    log = Log(job)
    keeper = CheckpointKeeper(claim, log, 0.0 if bounded else KEPT)
    try:
        result = solve(job, transcribed(job, transcriptions), claim, monitor, log, keeper, found, solved, tell, bounded)
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
        with contextlib.suppress(files.FileError):  # a full disk is reported by what comes after
            claim.check()
            log.write()
    finish(job, claim, result)
    return result


class Log:
    """The text of log.txt: messages of the solver, line by line; a continued run adds to what is there."""

    def __init__(self, job: Job) -> None:
        """Start from what an interrupted run wrote."""
        self.path = job.folder.path / LOG
        self.text = ""
        with contextlib.suppress(files.FileError):
            self.text = files.read_text(self.path)

    def __call__(self, line: str) -> None:
        """Add a line."""
        self.text += line.rstrip("\n") + "\n"

    def write(self) -> None:
        """Write the file."""
        files.write_text(self.path, self.text, at_once=False)


class CheckpointKeeper:
    """Writes a checkpoint now and then, so that a run whose process is killed goes on from there."""

    def __init__(self, claim: Claim, log: Log, every: float) -> None:
        """Write none before ``every`` [s] have passed, at the beginning and after each checkpoint."""
        self.claim, self.log, self.every = claim, log, every
        self.due = monotonic() + every

    def __call__(self, make: Callable[[], dict[str, object]]) -> None:
        """Take an offered checkpoint, if one is due; a folder that cannot be written now may be so later."""
        began = monotonic()
        if began < self.due:
            return
        try:
            self.claim.publish(CHECKPOINT, files.json_text(make()).encode())
            self.log.write()
        except FolderBusy:
            raise
        except files.FileError as error:
            self.log(f"no checkpoint: {error}")
        self.due = monotonic() + max(self.every, SHARE * (monotonic() - began))


def finish(job: Job, claim: Claim, result: Result) -> None:
    """Write the result, last of all files, so that it exists only where the others are whole.

    The checkpoint stays where the same command goes on from there.
    """
    write_result(job, claim, result)
    if not (result.interrupted or result.again) and claim.held:
        files.remove(job.folder.path / CHECKPOINT)


def write_result(job: Job, claim: Claim, result: Result) -> None:
    """Write result.json if the run was not taken over, and keep the row of the run in the table of all runs."""
    found = files.strict(result.to_json())
    claim.publish(RESULT, files.json_text(found).encode())
    Journal(job.folder.path.parents[1]).add(job.folder.path, (files.strict(job.config.to_json()), found))


def stop_at_limit(job: Job, message: str) -> Result:
    """Write that a limit ended the run's process, with the best point of its checkpoint, from where it can go on."""

    def stopped() -> Result:
        checkpoint = job.folder.checkpoint()
        if rows := checkpoint_rows(checkpoint):
            job.folder.write_trace(rows)
        return interruption(job, message, checkpoint)

    return write_end(job, stopped) or interruption(job, message, None)


def give_up(job: Job, message: str, again: bool) -> Result:
    """Write that the run failed; see ``failure``."""
    failed = failure(job, message, again)
    return write_end(job, lambda: failed) or failed


def write_end(job: Job, make: Callable[[], Result]) -> Result | None:
    """Write how a run ended whose process is gone, and return what its folder says.

    A folder that says how the run ended is left as it is. One that another process works in, or that cannot be read,
    is not touched: None. What ``make`` returns is the result even where it cannot be written.
    """
    result = None
    with contextlib.suppress(files.FileError), claimed(job.folder.path) as claim:
        found = standing(job)
        if found.result and over(job, found):
            return found.result
        if found.stands in (Stands.NEW, Stands.CHANGED, Stands.DAMAGED):
            job.folder.begin(job.config, job.problem.text)
        result = make()
        write_result(job, claim, result)
    return result
