"""Many runs: one after another here, or side by side in worker processes; no run's failure stops the others.

Any number of commands may do the same batch at once, on any machines: each run is claimed in its folder by one of them,
see ``symphys.runs.claim``, and the others take the result from there.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from symphys import files
from symphys.batches.ledger import Ledger, Observer
from symphys.batches.limits import UNLIMITED, BatchLimits, Halt
from symphys.batches.multi_start import groups, solve_group
from symphys.batches.pool import NoWorkers, Pool
from symphys.batches.queue import Queue
from symphys.batches.worker import TICK
from symphys.interrupts import Interrupts
from symphys.results.file_names import RESULT
from symphys.results.result import Result
from symphys.runs.claim import FolderBusy, claimed
from symphys.runs.execute import execute, with_claim
from symphys.runs.job import Job
from symphys.runs.record import failure
from symphys.runs.standing import RERUN, stamped, standing
from symphys.runs.transcription_cache import Transcribe, TranscriptionCache
from symphys.solvers import Monitor, TraceRow


@dataclass(frozen=True)
class BatchResult:
    """What came of the jobs.

    Attributes:
        results: (jobs) in the order of the jobs, without what only their folders need hold; None for a run that did not
            come to its end.
        interrupted: whether Ctrl-C was pressed.
        spent: whether the time of the batch was used up before all was done.
    """

    results: tuple[Result | None, ...]
    interrupted: bool
    spent: bool = False

    @property
    def accepted(self) -> bool:
        """Whether every run did what was asked."""
        return all(result is not None and result.accepted for result in self.results)


def run_batch(
    jobs: Sequence[Job],
    processes: int,
    observer: Observer,
    transcribe: Transcribe,
    multi_start: bool = False,
    limits: BatchLimits = UNLIMITED,
    rerun: str = "",
) -> BatchResult:
    """Run what is not done yet, here or in ``processes`` workers, until all is done or Ctrl-C is pressed.

    ``multi_start``: here, solve the seeds of a problem and solver side by side where the solver can. ``rerun``: also do
    again what is over, a key of ``symphys.runs.standing.RERUN``. ``limits``: a run that has to end at a time has a
    process of its own, which can be killed whatever it is at; seeds side by side stop at the budget after an iteration.
    """
    ledger = Ledger(jobs, observer)
    with Interrupts().listening() as stop:
        halt = Halt(stop, limits.budget)
        waiting = dict(plan(jobs, ledger, rerun))
        queue = Queue(waiting)
        apart = limits.timeout < float("inf") or (limits.bounded and not multi_start)
        if apart or (processes > 1 and len(waiting) > 1):
            side_by_side(waiting, queue, processes, transcribe, ledger, halt, limits)
        else:
            Here(waiting, queue, transcribe, ledger, halt, limits).run(multi_start)
        ledger.close()
    left = any(result is None or result.interrupted for result in ledger.results)
    return BatchResult(tuple(ledger.results), stop.requested, halt.spent and left)


def plan(jobs: Sequence[Job], ledger: Ledger, rerun: str) -> list[tuple[int, Job]]:
    """What is to be done, the biggest first; what is over is taken from its folder."""
    found = []
    for index, job in enumerate(jobs):
        stands = standing(job)
        if stands.missing():
            found.append((index, job))
        elif stands.missing(RERUN.get(rerun, frozenset())):
            found.append((index, replace(job, outdated=stands.stamp)))
        elif stands.result:
            ledger.skip(index, stands.result)
    return sorted(found, key=lambda each: -each[1].size)


def side_by_side(
    jobs: dict[int, Job],
    queue: Queue,
    processes: int,
    transcribe: Transcribe,
    ledger: Ledger,
    halt: Halt,
    limits: BatchLimits,
) -> None:
    """Do all in workers; where they do not start, here."""
    try:
        Pool(jobs, queue, processes, transcribe, ledger, halt, limits).run()
    except NoWorkers as error:
        ledger.note(f"{error}. The runs are done one after another, in this process")
        Here(jobs, queue, transcribe, ledger, halt, limits).run(False)


class Here:
    """Does the runs of a queue in this process, one after another."""

    def __init__(
        self,
        jobs: dict[int, Job],
        queue: Queue,
        transcribe: Transcribe,
        ledger: Ledger,
        halt: Halt,
        limits: BatchLimits,
    ) -> None:
        """Nothing is done yet."""
        self.jobs, self.queue, self.ledger, self.halt, self.limits = jobs, queue, ledger, halt, limits
        self.transcriptions = TranscriptionCache(transcribe)

    def run(self, multi_start: bool) -> None:
        """Do all jobs, or as many as can be before a halt."""
        if multi_start:
            self.run_groups()
        last = None
        while len(self.queue) and not self.halt():
            index = self.queue.take(last)
            if index is None:
                self.ledger.wait_for(self.queue.claimed)
                time.sleep(TICK)
                continue
            try:
                self.do(index)
            except FolderBusy:
                self.queue.put_off(index)
            last = self.queue.done(index)

    def do(self, index: int) -> None:
        """Do one run, and try it again as often as is asked for."""
        for left in reversed(range(self.limits.retries + 1)):
            job = self.jobs[index]
            result = execute(
                job,
                self.watch(index),
                self.transcriptions,
                tell=partial(self.ledger.judging, index),
                begin=partial(self.ledger.started, index),
            )
            if result.status != "failed" or not left or self.halt():
                break
            self.ledger.note(f"{job.name}: tried again, as {result.advice}")
            self.jobs[index] = replace(job, outdated=stamped(job.folder.path / RESULT))
        self.ledger.ended(index, result)

    def watch(self, index: int) -> Monitor:
        """What sees the iterations of a run, and stops it at a halt."""

        def monitor(row: TraceRow) -> None:
            if self.halt():
                raise KeyboardInterrupt(self.halt.reason)
            self.ledger.advanced(index, row)

        return monitor

    def run_groups(self) -> None:
        """Solve the seeds that can be side by side, and judge each; the others stay in the queue."""
        halfway = {index for index, job in self.jobs.items() if standing(job).checkpoint is not None}
        for group in groups(self.jobs, halfway):
            if len(group) > 1 and not self.halt():
                self.run_group(group)

    def run_group(self, group: list[int]) -> None:
        """Solve seeds side by side, as far as no other command has claimed them."""
        with contextlib.ExitStack() as stack:
            claims = {}
            for index in group:
                with contextlib.suppress(files.FileError):  # busy, or it cannot be written: done alone, it says so
                    claims[index] = stack.enter_context(claimed(self.jobs[index].folder.path))
                    self.ledger.started(index, False)
            solved = solve_group({index: self.jobs[index] for index in claims}, self.transcriptions, self.watch)
            for index, claim in claims.items():
                job, tell = self.jobs[index], partial(self.ledger.judging, index)
                try:
                    result = with_claim(job, claim, self.watch(index), self.transcriptions, solved.get(index), tell)
                except files.FileError as error:
                    result = failure(job, str(error), again=True)
                self.queue.remove(index)
                self.ledger.ended(index, result)
