"""Many runs: one after another here, or side by side in worker processes; no run's failure stops the others.

Any number of commands may work on one batch at once, on any machines: each run is claimed in its folder by one of them,
see ``symphys.runs.claim``, and the others read the result from there.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from symphys import files
from symphys.batches.ledger import Ledger, Observer, retried
from symphys.batches.limits import UNLIMITED, BatchLimits, Halt
from symphys.batches.pool import NoWorkers, Pool
from symphys.batches.queue import Queue
from symphys.batches.worker import REPORT_INTERVAL
from symphys.interrupts import Interrupts
from symphys.records import dataclass
from symphys.results.result import Result
from symphys.runs.claim import FolderBusy, claimed, owner
from symphys.runs.execute import Transcribe, TranscriptionCache, execute, with_claim
from symphys.runs.inspection import RERUN, inspect_run
from symphys.runs.job import Job
from symphys.runs.record import failure
from symphys.solvers import Monitor, Outcome, TraceRow, solve_multi_start, solver


@dataclass(frozen=True)
class BatchResult:
    """The results of a batch.

    Attributes:
        results: in the order of the jobs, without fields that only their folders need; None for an unfinished run.
        interrupted: whether Ctrl-C was pressed.
        spent: whether the time of the batch was used up before all was done.
    """

    results: tuple[Result | None, ...]
    interrupted: bool
    spent: bool = False

    @classmethod
    def of(cls, ledger: Ledger, halt: Halt) -> BatchResult:
        """Return the results of a ledger, whose runs ``halt`` may have stopped."""
        left = any(result is None or result.interrupted for result in ledger.results)
        return cls(tuple(ledger.results), halt.interrupted(), halt.spent and left)

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
    """Do the runs that are not done yet, here or in ``processes`` workers, until all are done or Ctrl-C is pressed.

    ``multi_start``: here, solve the seeds of a problem and solver side by side where the solver can. ``rerun``: also do
    again runs that are over, a key of ``symphys.runs.inspection.RERUN``. ``limits``: a run with a limit has a
    process of its own, which can be killed at any point; seeds side by side stop at the budget after an iteration.
    """
    ledger = Ledger(jobs, observer)
    with Interrupts().listening() as stop:
        halt = Halt(stop, limits.budget)
        waiting = dict(plan(jobs, ledger, rerun))
        queue = Queue(waiting)
        apart = limits.timeout < float("inf") or (limits.bounded and not multi_start)
        if apart or (processes > 1 and len(waiting) > 1):
            try:
                Pool(waiting, queue, processes, transcribe, ledger, halt, limits).run()
            except NoWorkers as error:
                ledger.note(f"{error}. The runs are done one after another, in this process")
                SerialRunner(waiting, queue, transcribe, ledger, halt, limits).run(False)
        else:
            SerialRunner(waiting, queue, transcribe, ledger, halt, limits).run(multi_start)
        ledger.close()
    return BatchResult.of(ledger, halt)


def plan(jobs: Sequence[Job], ledger: Ledger, rerun: str) -> list[tuple[int, Job]]:
    """Return the runs to do, the biggest first; results of runs that are over go to the ledger."""
    found = []
    for index, job in enumerate(jobs):
        inspection = inspect_run(job)
        if inspection.needs_work():
            found.append((index, job))
        elif inspection.needs_work(RERUN.get(rerun, frozenset())):
            found.append((index, replace(job, outdated=inspection.stamp)))
        elif inspection.result:
            ledger.skip(index, inspection.result)
    return sorted(found, key=lambda each: -each[1].size)


class SerialRunner:
    """The runs of a queue, one after another in this process."""

    def __init__(
        self,
        jobs: dict[int, Job],
        queue: Queue,
        transcribe: Transcribe,
        ledger: Ledger,
        halt: Halt,
        limits: BatchLimits,
    ) -> None:
        """Keep the runs and their limits."""
        self.jobs, self.queue, self.ledger, self.halt, self.limits = jobs, queue, ledger, halt, limits
        self.transcriptions = TranscriptionCache(transcribe)

    def run(self, multi_start: bool) -> None:
        """Do all jobs, or as many as a halt leaves time for."""
        if multi_start:
            self.run_groups()
        last = None
        while len(self.queue) and not self.halt():
            index = self.queue.take(last)
            if index is None:
                self.ledger.wait_for(self.queue.claimed)
                time.sleep(REPORT_INTERVAL)
                continue
            try:
                self.do(index)
            except FolderBusy:
                self.queue.put_off(index)
            last = self.queue.done(index)

    def do(self, index: int) -> None:
        """Do one run, with as many tries as the limits allow."""
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
            self.jobs[index] = retried(job, result.advice, self.ledger)
        self.ledger.ended(index, result)

    def watch(self, index: int) -> Monitor:
        """Return the monitor of a run, which stops it at a halt."""

        def monitor(row: TraceRow) -> None:
            if self.halt():
                raise KeyboardInterrupt(self.halt.reason)
            self.ledger.advanced(index, row)

        return monitor

    def run_groups(self) -> None:
        """Solve the seeds that can be solved side by side; the other runs stay in the queue."""
        halfway = {index for index, job in self.jobs.items() if inspect_run(job).checkpoint is not None}
        for group in groups(self.jobs, halfway):
            if len(group) > 1 and not self.halt():
                self.run_group(group)

    def run_group(self, group: list[int]) -> None:
        """Solve seeds side by side, unless another command has claimed them, and judge each."""
        with contextlib.ExitStack() as stack:
            claims = {}
            for index in group:
                with contextlib.suppress(files.FileError):  # the run reports it when it is done alone
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


def groups(jobs: Mapping[int, Job], halfway: Collection[int]) -> list[list[int]]:
    """Return the indices of the jobs in their order, grouped where jobs differ in their seed only and start afresh."""
    found: list[list[int]] = []
    for index, job in jobs.items():
        last = found[-1][-1] if found else index
        if found and index not in halfway and last not in halfway and differ_in_seed(jobs[last], job):
            found[-1].append(index)
        else:
            found.append([index])
    return found


def differ_in_seed(one: Job, other: Job) -> bool:
    """Whether two jobs have the same problem, options and solver, and that solver runs in threads."""
    same = one.problem is other.problem and one.config.solver == other.config.solver and one.options == other.options
    return same and solver(one.config.solver).threaded


def solve_group(
    jobs: Mapping[int, Job], transcriptions: TranscriptionCache, watch: Callable[[int], Monitor]
) -> dict[int, Outcome]:
    """Return the outcomes of a group, each as if solved alone; none if anything fails, so that each run reports it."""
    first = next(iter(jobs.values()))
    lock = threading.Lock()

    def monitored(index: int) -> Monitor:
        report = watch(index)

        def monitor(row: TraceRow) -> None:
            with lock:
                report(row)

        return monitor

    seeds = [job.config.seed for job in jobs.values()]
    try:
        shooting = transcriptions(first).shooting
        starts = [shooting.start(seed) for seed in seeds]
        monitors = [monitored(index) for index in jobs]
        chosen = solver(first.config.solver)
        found = solve_multi_start(chosen, shooting, starts, first.options, seeds, monitors)
    except Exception:  # the run at fault reports it when it is solved alone
        return {}
    return dict(zip(jobs, found, strict=True))


@dataclass(frozen=True)
class Preview:
    """A run before it is begun.

    Attributes:
        job: the run.
        todo: whether it would be done.
        state: a value of ``symphys.runs.inspection.RunState``, or "claimed".
        why: the reason, as a clause.
    """

    job: Job
    todo: bool
    state: str
    why: str


def previews(jobs: Sequence[Job], rerun: str = "") -> Iterator[Preview]:
    """Yield what would become of the runs, in their order; nothing is written. ``rerun``: as in ``run_batch``."""
    for job in jobs:
        found, holder = inspect_run(job), owner(job.folder.path)
        if holder is not None:
            yield Preview(job, False, "claimed", f"{holder} is at it")
        else:
            yield Preview(job, found.needs_work(RERUN.get(rerun, frozenset())), found.state.value, found.why)
