"""How a run stands in its folder: what is done, what is missing, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from symphys import files
from symphys.results.config import Config, read_config
from symphys.results.file_names import CONFIG, PROBLEM, RESULT
from symphys.results.result import Result, read_result
from symphys.version import __version__

if TYPE_CHECKING:
    from symphys.runs.job import Job


class Stands(Enum):
    """How a run stands; the value is a word for messages."""

    NEW = "new"
    DONE = "done"
    FAILED = "failed"
    LOST = "lost"
    CHANGED = "changed"
    OLDER = "older"
    DAMAGED = "damaged"
    HALFWAY = "halfway"


MISSING = frozenset((Stands.NEW, Stands.LOST, Stands.CHANGED, Stands.DAMAGED, Stands.HALFWAY))
"""What the same command does: the rest is over unless it is asked for."""
RERUN = {
    "failed": frozenset((Stands.FAILED,)),
    "changed": frozenset((Stands.OLDER,)),
    "all": frozenset((Stands.FAILED, Stands.OLDER, Stands.DONE)),
}
"""What is also done, by the word that asks for it."""


@dataclass(frozen=True)
class Standing:
    """How a run stands, and why it would be done.

    Attributes:
        stands: in a word.
        why: in a clause.
        result: what the folder holds of this very run, interrupted, failed or done.
        checkpoint: where it goes on; None if it begins afresh.
        stamp: different for each result that was written; empty without one.
    """

    stands: Stands
    why: str = ""
    result: Result | None = None
    checkpoint: dict[str, Any] | None = None
    stamp: str = ""

    def missing(self, rerun: frozenset[Stands] = frozenset()) -> bool:
        """Whether it is to be done."""
        return self.stands in MISSING | rerun


def standing(job: Job) -> Standing:
    """Read how a run stands; whatever is damaged is to be made again."""
    folder = job.folder.path
    stamp = stamped(folder / RESULT)
    if not stamp and not (folder / CONFIG).exists():
        return Standing(Stands.NEW, "not begun yet")
    try:
        earlier = read_config(folder / CONFIG)
    except files.FileError as error:
        return Standing(Stands.DAMAGED, str(error), stamp=stamp)
    if earlier.key != job.config.key:
        return Standing(Stands.CHANGED, difference(job, earlier), stamp=stamp)
    if not stamp:
        return halfway(job, None, "")
    try:
        result = read_result(folder / RESULT)
    except files.FileError as error:
        return Standing(Stands.DAMAGED, str(error), stamp=stamp)
    return judged(job, result, stamp)


def judged(job: Job, result: Result, stamp: str) -> Standing:
    """How a run with this result stands."""
    if result.interrupted:
        return halfway(job, result, stamp)
    if result.again:
        return Standing(Stands.LOST, result.advice, None, job.folder.checkpoint(), stamp)
    if result.status == "failed":
        return Standing(Stands.FAILED, result.advice, result, stamp=stamp)
    made = result.versions.get("symphys", "")
    if made != __version__:
        return Standing(Stands.OLDER, f"done by symphys {made}, this is {__version__}", result, stamp=stamp)
    return Standing(Stands.DONE, "done before", result, stamp=stamp)


def halfway(job: Job, result: Result | None, stamp: str) -> Standing:
    """How a run stands that was begun and is not over."""
    checkpoint = job.folder.checkpoint()
    if checkpoint is None:
        return Standing(Stands.HALFWAY, "it was begun; no checkpoint is left, so it begins afresh", None, None, stamp)
    rows = checkpoint.get("rows")
    count = f" from iteration {len(rows)}" if isinstance(rows, list) else ""
    return Standing(Stands.HALFWAY, f"it was begun and goes on{count}", result, checkpoint, stamp)


def difference(job: Job, earlier: Config) -> str:
    """What makes the run in the folder another one."""
    if not earlier.key:
        return f"{CONFIG} there is not whole"
    asked = job.config
    if changed(job):
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


def changed(job: Job) -> bool:
    """Whether the folder holds another text of the problem."""
    try:
        return files.read_text(job.folder.path / PROBLEM) != files.printable(job.problem.text)
    except files.FileError:
        return True


def stamped(path: Any) -> str:
    """When and how long a file was written; empty if there is none."""
    try:
        found = path.stat()
    except OSError:
        return ""
    return f"{found.st_mtime_ns}-{found.st_size}"
