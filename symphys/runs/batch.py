"""Many runs: one after another here, or side by side in worker processes; no run's failure stops the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol, runtime_checkable

from symphys.results.result import Result
from symphys.runs.execute import execute
from symphys.runs.job import Job
from symphys.runs.multi_start import groups, solve_group
from symphys.runs.stopping import Interrupts, Stop
from symphys.runs.transcription_cache import Transcribe, TranscriptionCache
from symphys.runs.workers import side_by_side
from symphys.solvers import Monitor, TraceRow


class Observer(Protocol):
    """Receives what happens to the runs of a batch."""

    def started(self, job: Job, resumed: bool) -> None:
        """The run begins, or goes on."""

    def advanced(self, job: Job, row: TraceRow) -> None:
        """The run has come to this iteration."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """The run is over; ``skipped``: it was so before."""


@runtime_checkable
class JudgingObserver(Protocol):
    """An observer that also receives what comes after the solver."""

    def judging(self, job: Job, what: str) -> None:
        """The run's solver is done, and this part of judging what it found begins."""


@dataclass(frozen=True)
class BatchResult:
    """What came of the jobs.

    Attributes:
        results: (jobs) in the order of the jobs; None for a run that an interruption kept from starting.
        interrupted: whether Ctrl-C was pressed.
    """

    results: tuple[Result | None, ...]
    interrupted: bool

    @property
    def accepted(self) -> bool:
        """Whether every run did what was asked."""
        return all(result is not None and result.accepted for result in self.results)


def run_batch(
    jobs: Sequence[Job], processes: int, observer: Observer, transcribe: Transcribe, multi_start: bool = False
) -> BatchResult:
    """Run what is not done yet, here or in ``processes`` workers, until all is done or Ctrl-C is pressed.

    ``multi_start``: here, solve the seeds of a problem and solver side by side where the solver can.
    """
    ledger = Ledger(jobs, observer)
    waiting = {index: job for index, job in enumerate(jobs) if not ledger.skip(index)}
    with Interrupts().listening() as stop:
        if processes > 1 and len(waiting) > 1:
            side_by_side(waiting, processes, transcribe, ledger, stop)
        else:
            one_by_one(waiting, transcribe, ledger, stop, multi_start)
    return BatchResult(tuple(ledger.results), stop.requested)


def one_by_one(jobs: Mapping[int, Job], transcribe: Transcribe, ledger: Ledger, stop: Stop, multi_start: bool) -> None:
    """Run all jobs in this process."""
    transcriptions = TranscriptionCache(transcribe)

    def watch(index: int) -> Monitor:
        def monitor(row: TraceRow) -> None:
            if stop():
                raise KeyboardInterrupt
            ledger.advanced(index, row)

        return monitor

    for group in groups(jobs, ledger.halfway) if multi_start else [[index] for index in jobs]:
        if stop():
            return
        for index in group:
            ledger.started(index)
        here = {index: jobs[index] for index in group}
        solved = solve_group(here, transcriptions, watch) if len(group) > 1 else {}
        for index, job in here.items():
            tell = partial(ledger.judging, index)
            ledger.ended(index, execute(job, watch(index), transcriptions, solved.get(index), tell))


@dataclass
class Ledger:
    """Keeps the results by the index of their job, and passes on what happens.

    Attributes:
        results: one per job; None until it is over.
        halfway: indices of the jobs that an earlier command began and was interrupted in.
    """

    jobs: Sequence[Job]
    observer: Observer
    results: list[Result | None] = field(default_factory=list)
    halfway: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        """No job is done."""
        self.results = [None] * len(self.jobs)

    def skip(self, index: int) -> bool:
        """Take the result of a job that was done before; False if it was not."""
        job = self.jobs[index]
        earlier = job.folder.earlier(job.config)
        if earlier is not None and earlier.interrupted:
            self.halfway.add(index)
        if earlier is None or earlier.interrupted or earlier.again:
            return False
        self.results[index] = earlier
        self.observer.ended(job, earlier, skipped=True)
        return True

    def started(self, index: int) -> None:
        """Report that a run begins, or goes on."""
        self.observer.started(self.jobs[index], resumed=index in self.halfway)

    def advanced(self, index: int, row: TraceRow) -> None:
        """Report an iteration."""
        self.observer.advanced(self.jobs[index], row)

    def judging(self, index: int, what: str) -> None:
        """Report that a part of judging a run begins, to an observer that takes it."""
        if isinstance(self.observer, JudgingObserver):
            self.observer.judging(self.jobs[index], what)

    def ended(self, index: int, result: Result) -> None:
        """Keep a result and report it."""
        self.results[index] = result
        self.observer.ended(self.jobs[index], result, skipped=False)
