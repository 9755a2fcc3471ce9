"""What has come of the runs of a batch, and who is told of it."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

from symphys import files
from symphys.results.result import Result
from symphys.results.table import write_table
from symphys.runs.claim import owner
from symphys.runs.job import Job
from symphys.solvers import TraceRow


class Observer(Protocol):
    """Receives what happens to the runs of a batch."""

    def started(self, job: Job, resumed: bool) -> None:
        """The run begins, or goes on."""

    def advanced(self, job: Job, row: TraceRow) -> None:
        """The run has come to this iteration."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """The run is over; ``skipped``: it was so before, or another command did it."""


@runtime_checkable
class JudgingObserver(Protocol):
    """An observer that also receives what comes after the solver."""

    def judging(self, job: Job, what: str) -> None:
        """The run's solver is done, and this part of judging what it found begins."""


@runtime_checkable
class NotedObserver(Protocol):
    """An observer that also receives what happens to the batch."""

    def note(self, text: str) -> None:
        """Something that people should know."""


@dataclass
class Ledger:
    """Keeps the results by the index of their job, and passes on what happens.

    Attributes:
        jobs: all that were asked for.
        results: one for each job, without what only its folder need hold; None until it is over.
        begun: indices of the jobs that were begun here.
        waited: whether it was said that only runs of other commands are left.
    """

    jobs: Sequence[Job]
    observer: Observer
    results: list[Result | None] = field(default_factory=list)
    begun: set[int] = field(default_factory=set)
    waited: bool = False

    def __post_init__(self) -> None:
        """No job is done."""
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
        if isinstance(self.observer, JudgingObserver):
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
        """Say, once, that the runs that are left are those that other commands are at."""
        if self.waited or not indices:
            return
        self.waited = True
        first = self.jobs[min(indices)]
        who = owner(first.folder.path) or "another command"
        runs = f"{len(indices)} runs, at which other commands are" if len(indices) > 1 else "a run of another command"
        self.note(f"waiting for {runs}: {first.name} ({who})")

    def note(self, text: str) -> None:
        """Report what happens to the batch."""
        if isinstance(self.observer, NotedObserver):
            self.observer.note(text)


NOT_KEPT: Mapping[str, Any] = {
    **{key: {} for key in ("z", "guess", "costs", "outputs", "counts", "price", "versions", "provenance")},
    "stages": (),
}
"""What a result is left without in the memory of a batch; its folder has it."""


def slim(result: Result) -> Result:
    """A result without what nobody asks of a batch, so that ten thousand take little memory."""
    trust = {} if result.accepted else result.trust
    return replace(result, **NOT_KEPT, trust=trust)
