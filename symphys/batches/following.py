"""A batch that runs elsewhere: an engine starts drivers, and this process monitors them without computing.

Results are read from run folders; messages of drivers come from their ``Board``.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path

from symphys import files
from symphys.batches.batch import BatchResult, plan
from symphys.batches.engines import Engine, EngineError, open_engine
from symphys.batches.engines.driver import NOTE, OVER, RESUMED, Board, DriverTask
from symphys.batches.ledger import Ledger, Observer
from symphys.batches.limits import UNLIMITED, BatchLimits, Halt
from symphys.interrupts import Interrupts
from symphys.records import dataclass
from symphys.results.file_names import RESULT
from symphys.results.result import Result, read_result
from symphys.runs.claim import holder, is_over
from symphys.runs.execute import Transcribe, give_up
from symphys.runs.folder import RunFolder
from symphys.runs.inspection import RunState, inspect_run
from symphys.runs.job import Job
from symphys.runs.record import failure

MIN_POLL_INTERVAL = 0.25
"""[s] between two reads of the board, at least."""
MIN_POLL_SPACING = 20
"""Least time between reads of the board, in units of the time to read it."""
MAX_ROUNDS = 3
"""Largest number of restarts of drivers while no run ends."""
GRACE_TIME = 5.0
"""[s] for drivers to end by themselves when nothing is left, and for their runs when the batch's time is up."""


def run_on(
    engine: str,
    scheduler: str,
    jobs: Sequence[Job],
    drivers: int,
    observer: Observer,
    transcribe: Transcribe,
    out: Path,
    limits: BatchLimits = UNLIMITED,
    rerun: str = "",
) -> BatchResult:
    """Do a batch as ``run_batch`` does, by ``drivers`` that an engine starts.

    ``engine``, ``scheduler``: see ``open_engine``. ``out``: the folder of the batch; all machines see it by one path.

    Raises:
        EngineError: the engine cannot be used.
        FileError: ``out`` cannot be written.
    """
    ledger = Ledger(jobs, observer)
    with Interrupts().listening() as stop, contextlib.ExitStack() as stack:
        halt = Halt(stop, limits.budget)
        waiting = plan(jobs, ledger, rerun)
        if waiting:
            sent = tuple(replace(job, folder=RunFolder(job.folder.path.absolute())) for _, job in waiting)
            opened = open_engine(engine, scheduler, min(drivers, len(sent)), out.absolute())
            stack.callback(opened.close)
            board = Board.create(out.absolute())
            stack.callback(board.remove)
            task = DriverTask(board, sent, transcribe, replace(limits, budget=float("inf")))
            follower = Follower(task, opened, drivers, [index for index, _ in waiting], ledger, halt)
            follower.run()
            follower.close()
    return BatchResult.of(ledger, halt)


@dataclass
class Follower:
    """The command that follows the drivers of a batch.

    Attributes:
        task: of each driver, with the runs that were sent.
        engine: starts drivers.
        drivers: how many are wanted.
        indices: of the runs that were sent, in the ledger.
        left: the runs that were sent and are not over.
        at_work: the begun runs among them.
        tried_by: the tokens of drivers that have begun each run.
        rounds: restarts of drivers since the last run ended.
        turn: number of drivers started so far.
        reported: reasons for which drivers ended, each noted once.
    """

    task: DriverTask
    engine: Engine
    drivers: int
    indices: list[int]
    ledger: Ledger
    halt: Halt
    left: set[int] = field(default_factory=set)
    at_work: set[int] = field(default_factory=set)
    tried_by: dict[int, set[str]] = field(default_factory=dict)
    rounds: int = -1
    turn: int = 0
    reported: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Start with all runs left."""
        self.left = set(range(len(self.indices)))

    def run(self) -> None:
        """Follow until all runs are over, no driver works any more, or a halt has stopped them."""
        asked = False
        while self.left:
            began = time.monotonic()
            if self.halt() and not asked:
                asked = True
                self.task.board.stop(self.halt.reason)
            alive, faults = self.engine.poll()
            self.take_news()
            self.reap()
            if asked:
                # after Ctrl-C a run may take its time, since a second one ends it; the time of the batch is a limit
                goes_on = bool(alive and self.at_work) and self.halt.overdue < GRACE_TIME
            else:
                self.report(faults)
                goes_on = self.scale(alive)
            if not goes_on:
                break
            self.wait(max(MIN_POLL_INTERVAL, (MIN_POLL_SPACING - 1) * (time.monotonic() - began)), asked)
        self.sweep(asked)

    def wait(self, seconds: float, asked: bool) -> None:
        """Wait for the next look, but not longer than until a new halt."""
        until = time.monotonic() + seconds
        while (rest := until - time.monotonic()) > 0 and (asked or not self.halt()):
            time.sleep(min(MIN_POLL_INTERVAL, rest))

    def take_news(self) -> None:
        """Read the messages of the drivers."""
        for news in self.task.board.news():
            if news.what == NOTE:
                self.ledger.note(news.text)
            elif news.index not in self.left:
                continue
            elif news.what == OVER:
                self.end(news.index, outcome(self.task.jobs[news.index]))
            else:
                self.at_work.add(news.index)
                self.tried_by.setdefault(news.index, set()).add(news.by)
                self.ledger.started(self.indices[news.index], news.what == RESUMED)

    def end(self, index: int, result: Result) -> None:
        """Record the result of a run."""
        self.left.discard(index)
        self.at_work.discard(index)
        self.rounds = min(self.rounds, 0)
        self.ledger.ended(self.indices[index], result)

    def reap(self) -> None:
        """Give up runs on which more drivers have died than the retries allow."""
        most = max(self.task.limits.retries, 1)
        for index in [index for index in self.at_work if len(self.tried_by[index]) > most]:
            if died := self.dead_owner(index):
                self.give_up(index, f"{died} died, as did others at this run before: see log.txt there")

    def dead_owner(self, index: int) -> str:
        """Return the owner of a claim whose process has died; empty if there is none."""
        found = holder(self.task.jobs[index].folder.path)
        return str(found[1]) if found and is_over(*found) else ""

    def give_up(self, index: int, message: str) -> None:
        """Write that a run failed, so that no driver takes it up, unless one has already."""
        self.task.board.tell(OVER, index)
        if self.dead_owner(index):
            self.end(index, give_up(self.task.jobs[index], message, again=True))
        else:
            self.task.board.clear_done(index)

    def report(self, faults: list[str]) -> None:
        """Note why drivers ended, each reason once."""
        for fault in faults:
            if fault not in self.reported:
                self.reported.add(fault)
                self.ledger.note(f"a driver ended: {fault}")

    def scale(self, alive: int) -> bool:
        """Start drivers in place of those that ended while runs are left; False if none is left and none starts."""
        missing = min(self.drivers, len(self.left)) - alive
        if missing <= 0:
            return True
        if self.rounds >= MAX_ROUNDS:
            return alive > 0
        self.rounds += 1
        for _ in range(missing):
            first = self.turn * len(self.indices) // self.drivers % len(self.indices)
            try:
                self.engine.start(replace(self.task, first=first))
            except EngineError as error:
                if not self.turn:
                    raise
                self.ledger.note(f"no more drivers start: {error}")
                break
            self.turn += 1
        return True

    def sweep(self, asked: bool) -> None:
        """Read the folders of runs without a message; note how many are missing."""
        for index in sorted(self.left):
            found = inspect_run(self.task.jobs[index])
            fresh = found.stamp != self.task.jobs[index].outdated
            if found.result and fresh and (index in self.at_work or not found.needs_work()):
                self.end(index, found.result)
        if self.left and not asked:
            self.ledger.note(
                f"all workers ended, and {len(self.left)} of {len(self.indices)} runs are not done; run the same "
                "command again to complete them"
            )

    def close(self) -> None:
        """Wait a little for drivers that find nothing more to do."""
        self.task.board.stop(self.halt.reason)
        until = time.monotonic() + GRACE_TIME
        while self.engine.poll()[0] and time.monotonic() < until:
            time.sleep(MIN_POLL_INTERVAL / 5)


def outcome(job: Job) -> Result:
    """Return the result of a run that is over, from its folder."""
    found = inspect_run(job)
    try:
        if found.result is None and found.state in (RunState.LOST, RunState.HALFWAY):
            return read_result(job.folder.path / RESULT)
    except files.FileError as error:
        return failure(job, str(error), again=True)
    return found.result or failure(job, f"the worker could not write its result: {found.why}", again=True)
