"""The state of a run in its folder: done, resumable or to be repeated, and why."""

from __future__ import annotations

import contextlib
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symphys import files
from symphys.records import dataclass
from symphys.results.config import Config, read_config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT
from symphys.results.result import Result, read_result
from symphys.version import __version__

if TYPE_CHECKING:
    from symphys.runs.job import Job


class RunState(Enum):
    """The state of a run; the value is a word for messages."""

    NEW = "new"
    DONE = "done"
    FAILED = "failed"
    LOST = "lost"
    CHANGED = "changed"
    OLDER = "older"
    DAMAGED = "damaged"
    HALFWAY = "halfway"


UNFINISHED = frozenset((RunState.NEW, RunState.LOST, RunState.CHANGED, RunState.DAMAGED, RunState.HALFWAY))
"""States that the same command works on; the others are over unless ``RERUN`` names them."""
RERUN = {
    "failed": frozenset((RunState.FAILED,)),
    "changed": frozenset((RunState.OLDER,)),
    "all": frozenset((RunState.FAILED, RunState.OLDER, RunState.DONE)),
}
"""States that are repeated too, by the value of ``--rerun``."""


@dataclass(frozen=True)
class RunInspection:
    """The state of a run as read from its folder.

    Attributes:
        state: of the run.
        why: the reason, as a clause.
        result: of this very run, interrupted, failed or done; None if there is none.
        checkpoint: where the run resumes; None if it starts afresh.
        stamp: different for each result that was written; empty without one.
    """

    state: RunState
    why: str = ""
    result: Result | None = None
    checkpoint: dict[str, Any] | None = None
    stamp: str = ""

    def needs_work(self, rerun: frozenset[RunState] = frozenset()) -> bool:
        """Whether the run is to be done; ``rerun``: states that are repeated."""
        return self.state in UNFINISHED | rerun


def inspect_run(job: Job) -> RunInspection:
    """Read the state of a run; damaged files mean that it is repeated."""
    folder = job.folder.path
    stamp = file_stamp(folder / RESULT)
    if not stamp and not (folder / CONFIG).exists():
        return RunInspection(RunState.NEW, "not begun yet")
    try:
        earlier = read_config(folder / CONFIG)
    except files.FileError as error:
        return RunInspection(RunState.DAMAGED, str(error), stamp=stamp)
    if earlier.key != job.config.key:
        return RunInspection(RunState.CHANGED, difference(job, earlier), stamp=stamp)
    if not stamp:
        return halfway(job, None, "")
    try:
        result = read_result(folder / RESULT)
    except files.FileError as error:
        return RunInspection(RunState.DAMAGED, str(error), stamp=stamp)
    return with_result(job, result, stamp)


def with_result(job: Job, result: Result, stamp: str) -> RunInspection:
    """Return the inspection of a run with this result."""
    if result.interrupted:
        return halfway(job, result, stamp)
    if result.again:
        return RunInspection(RunState.LOST, result.advice, None, job.folder.checkpoint(), stamp)
    if result.status == "failed":
        return RunInspection(RunState.FAILED, result.advice, result, stamp=stamp)
    made = result.versions.get("symphys", "")
    if made != __version__:
        return RunInspection(RunState.OLDER, f"done by symphys {made}, this is {__version__}", result, stamp=stamp)
    return RunInspection(RunState.DONE, "done before", result, stamp=stamp)


def halfway(job: Job, result: Result | None, stamp: str) -> RunInspection:
    """Return the inspection of a run that was begun and is not over."""
    checkpoint = job.folder.checkpoint()
    if checkpoint is None:
        return RunInspection(
            RunState.HALFWAY, "it was begun; no checkpoint is left, so it begins afresh", None, None, stamp
        )
    rows = checkpoint.get("rows")
    count = f" from iteration {len(rows)}" if isinstance(rows, list) else ""
    return RunInspection(RunState.HALFWAY, f"interrupted; resumes{count}", result, checkpoint, stamp)


def difference(job: Job, earlier: Config) -> str:
    """Return what differs between the run in the folder and the one that is asked for."""
    if not earlier.key:
        return f"{CONFIG} there is not whole"
    asked, same = job.config, False
    with contextlib.suppress(files.FileError):
        same = files.read_text(job.folder.path / PROBLEM) == files.printable(job.problem.text)
    if not same:
        return f"the problem file has changed since {job.folder.path.name} was solved"
    for name in ("backend", "solver", "seed"):
        if getattr(earlier, name) != getattr(asked, name):
            return f"the {name} was {getattr(earlier, name)}"
    if earlier.guess.get("digest") != asked.guess.get("digest"):
        return f"its guess was {earlier.guess.get('run') or 'that of the problem'}"
    for table in ("options", "settings"):
        before, plain = getattr(earlier, table), files.strict(getattr(asked, table))
        for key in sorted({*before, *plain}):
            if before.get(key) != plain.get(key):
                return f"{table}: {key} was {before.get(key)}, is {plain.get(key)}"
    return "it was asked for by another version of symphys, or its includes have changed"


def file_stamp(path: Path) -> str:
    """Return the time of writing and the size of a file; empty if there is none."""
    try:
        found = path.stat()
    except OSError:
        return ""
    return f"{found.st_mtime_ns}-{found.st_size}"
