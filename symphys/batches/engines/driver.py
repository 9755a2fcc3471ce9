"""A driver: a process that an engine has started, anywhere, and that does runs of a batch until none is left.

Drivers do not know each other. Each run is claimed in its folder by one of them, as by any other command.
"""

from __future__ import annotations

import multiprocessing
import socket
import threading
import uuid
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from time import monotonic

from symphys import files, threads
from symphys.batches.batch import Here
from symphys.batches.engines.board import BEGUN, OVER, RESUMED, Board
from symphys.batches.ledger import Ledger
from symphys.batches.limits import BatchLimits, Halt
from symphys.batches.pool import NoWorkers, Pool
from symphys.batches.queue import Queue
from symphys.results.result import Result
from symphys.runs.job import Job
from symphys.runs.transcription_cache import Transcribe
from symphys.solvers import TraceRow

LOOK = 0.5
"""[s] between two looks at whether to stop."""
ALONE = threading.Lock()
"""One driver works in a process at a time, also where the engine's processes have several threads."""


@dataclass(frozen=True)
class DriverTask:
    """What a driver does; may be sent to another machine.

    Attributes:
        board: where it leaves its news.
        jobs: all runs of the batch that are not over; their folders are absolute.
        transcribe: makes their transcriptions.
        limits: of a run; the time of the batch is the board's to say.
        first: index of the run to begin with, different for each driver, so that few want the same.
    """

    board: Board
    jobs: tuple[Job, ...]
    transcribe: Transcribe
    limits: BatchLimits
    first: int = 0


def drive(task: DriverTask) -> None:
    """Do runs until none is left or the board says stop.

    Raises:
        FileError: this machine does not see the folder of the batch.
        NoWorkers: runs with a timeout need a process of their own, and this one can start none.
    """
    threads.limit()
    with ALONE:
        check(task)
        order = [*range(task.first, len(task.jobs)), *range(task.first)]
        jobs = {index: task.jobs[index] for index in order}
        queue, halt = BoardQueue(jobs, task.board), BoardHalt(task.board)
        ledger = BoardLedger(task.jobs, Unseen(), board=task.board)
        if task.limits.timeout < float("inf"):
            Pool(jobs, queue, 1, task.transcribe, ledger, halt, task.limits).run()
        else:
            Here(jobs, queue, task.transcribe, ledger, halt, task.limits).run(False)


def check(task: DriverTask) -> None:
    """Raise what ``drive`` raises before it begins."""
    out = task.board.path.parent
    if not out.is_dir():
        raise files.FileError(
            f"{socket.gethostname()} does not see {out}: runs must be written to a folder that all machines share"
        )
    if task.limits.timeout < float("inf") and multiprocessing.current_process().daemon:
        raise NoWorkers(
            "a timeout needs a process for each run, and workers of this cluster may start none: start them with "
            "DASK_DISTRIBUTED__WORKER__DAEMON=False in their environment, or leave the timeout out"
        )


class BoardQueue(Queue):
    """Leaves out what another driver has ended, however it ended."""

    def __init__(self, jobs: Mapping[int, Job], board: Board) -> None:
        """All wait."""
        super().__init__(jobs)
        self.board = board

    def take(self, last: Hashable = None) -> int | None:
        """The next run."""
        while (index := super().take(last)) is not None and self.board.is_over(index):
            last = self.done(index)
        return index


class BoardHalt(Halt):
    """Stops the runs of a driver when the board says so."""

    def __init__(self, board: Board) -> None:
        """Nobody has said so."""
        super().__init__(lambda: board.stopped)
        self.board, self.asked, self.looked = board, False, 0.0

    def __call__(self) -> bool:
        """Whether to stop; looks now and then only."""
        if not self.asked and monotonic() - self.looked > LOOK:
            self.looked = monotonic()
            self.asked = self.board.stopped
        return self.asked

    @property
    def reason(self) -> str:
        """For the runs that it stops."""
        return self.board.reason


@dataclass
class BoardLedger(Ledger):
    """Leaves on the board what begins and what is over; ``token``: of this driver."""

    board: Board = field(kw_only=True)
    token: str = field(default_factory=lambda: uuid.uuid4().hex)

    def started(self, index: int, resumed: bool) -> None:
        """A run begins, or goes on."""
        self.begun.add(index)
        self.board.tell(RESUMED if resumed else BEGUN, index, self.token)

    def ended(self, index: int, result: Result) -> None:
        """It is over, here or as it was before."""
        self.board.tell(OVER, index)

    def note(self, text: str) -> None:
        """Say it to those who watch the batch."""
        self.board.note(text)


class Unseen:
    """An observer where nobody watches."""

    def started(self, job: Job, resumed: bool) -> None:
        """Nothing is said of it."""

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Nothing is said of it."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Nothing is said of it."""
