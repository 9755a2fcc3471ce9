"""The results of a batch so far, and the observer of what happens in it."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

from symphys import files
from symphys.records import dataclass
from symphys.results.file_names import RESULT
from symphys.results.result import Result
from symphys.results.table import write_table
from symphys.runs.claim import owner
from symphys.runs.inspection import file_stamp
from symphys.runs.job import Job
from symphys.solvers import TraceRow

DROPPED_FIELDS: Mapping[str, Any] = {
    **{key: {} for key in ("z", "guess", "costs", "outputs", "counts", "price", "versions", "provenance")},
    "stages": (),
}
"""Fields of a result that a batch drops from memory; its folder has them."""


class Observer:
    """Receiver of what happens to the runs of a batch; subclasses override what they show."""

    def started(self, job: Job, resumed: bool) -> None:
        """Receive that a run starts or resumes."""

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Receive an iteration of a run."""

    def judging(self, job: Job, what: str) -> None:
        """Receive that a part of judging begins, once the solver of a run is done."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Receive the result of a run; ``skipped``: it was over before, or another command did it."""

    def note(self, text: str) -> None:
        """Receive a message about the batch."""


@dataclass
class Ledger:
    """The results of a batch by the index of their job; passes on what happens to the observer.

    Attributes:
        jobs: all that were asked for.
        results: one for each job, without fields that only its folder needs; None until it is over.
        begun: indices of the jobs that were begun here.
        waited: whether it was reported that only runs of other commands are left.
    """

    jobs: Sequence[Job]
    observer: Observer
    results: list[Result | None] = field(default_factory=list)
    begun: set[int] = field(default_factory=set)
    waited: bool = False

    def __post_init__(self) -> None:
        """Start without results."""
        self.results = [None] * len(self.jobs)

    def skip(self, index: int, result: Result) -> None:
        """Take the result of a job that was done before."""
        self.results[index] = slim(result)
        self.observer.ended(self.jobs[index], result, skipped=True)

    def started(self, index: int, resumed: bool) -> None:
        """Report that a run begins, or goes on."""
        self.begun.add(index)
        self.observer.started(self.jobs[index], resumed)

    def advanced(self, index: int, row: TraceRow) -> None:
        """Report an iteration."""
        self.observer.advanced(self.jobs[index], row)

    def judging(self, index: int, what: str) -> None:
        """Report that a part of judging a run begins, to an observer that takes it."""
        self.observer.judging(self.jobs[index], what)

    def ended(self, index: int, result: Result) -> None:
        """Keep a result and report it; a run that was not begun here was done by another command."""
        elsewhere = index not in self.begun and not result.again
        self.results[index] = slim(result)
        self.observer.ended(self.jobs[index], result, skipped=elsewhere)

    def close(self) -> None:
        """Write the table of all runs, if there is anything new; where that cannot be, the folders have it all."""
        for out in {self.jobs[index].folder.path.parents[1] for index in self.begun}:
            with contextlib.suppress(OSError, files.FileError):
                write_table(out)

    def wait_for(self, indices: Collection[int]) -> None:
        """Report, once, that the remaining runs are claimed by other commands."""
        if self.waited or not indices:
            return
        self.waited = True
        first = self.jobs[min(indices)]
        who = owner(first.folder.path) or "another command"
        runs = f"{len(indices)} runs, at which other commands are" if len(indices) > 1 else "a run of another command"
        self.note(f"waiting for {runs}: {first.name} ({who})")

    def note(self, text: str) -> None:
        """Report what happens to the batch."""
        self.observer.note(text)


def retried(job: Job, why: str, ledger: Ledger) -> Job:
    """Return the job for another try, in which the result in its folder does not count."""
    ledger.note(f"{job.name}: tried again, as {why}")
    return replace(job, outdated=file_stamp(job.folder.path / RESULT))


def slim(result: Result) -> Result:
    """Return a result without the fields that a batch does not use, so that ten thousand take little memory."""
    trust = {} if result.accepted else result.trust
    return replace(result, **DROPPED_FIELDS, trust=trust)
