"""A driver: a process, started by an engine on any machine, that does runs of a batch until none is left.

Drivers do not know each other: each run is claimed in its folder by one of them, as by any other command. They report
to the command that started them through a ``Board``, a folder of small files.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import shutil
import socket
import threading
import uuid
from collections.abc import Hashable, Mapping
from dataclasses import field
from pathlib import Path
from time import monotonic

from symphys import files, threads
from symphys.batches.batch import SerialRunner
from symphys.batches.ledger import Ledger, Observer
from symphys.batches.limits import BatchLimits, Halt
from symphys.batches.pool import NoWorkers, Pool
from symphys.batches.queue import Queue
from symphys.records import dataclass
from symphys.results.result import Result
from symphys.runs.execute import Transcribe
from symphys.runs.job import Job

PREFIX = ".drivers-"
BEGUN, RESUMED, OVER, NOTE, STOP = "begun", "resumed", "over", "note", "stop"
POLL_INTERVAL = 0.5
"""[s] between two checks of whether to stop."""
ONE_DRIVER = threading.Lock()
"""One driver works in a process at a time, also where an engine's processes have several threads."""


@dataclass(frozen=True)
class BoardNews:
    """A message on the board.

    Attributes:
        what: BEGUN, RESUMED or OVER for a run, or NOTE.
        index: of the run; -1 for a note.
        by: the token of the driver that began it.
        text: of a note.
    """

    what: str
    index: int = -1
    by: str = ""
    text: str = ""


@dataclass(frozen=True)
class Board:
    """The folder ``OUT/.drivers-TOKEN``, in which drivers leave messages; drivers stop when it is gone.

    Attributes:
        path: absolute, and the same on all machines.
        seen: names of files that were read already.
    """

    path: Path
    seen: set[str] = field(default_factory=set, compare=False)

    @classmethod
    def create(cls, out: Path) -> Board:
        """Make a new board; FileError if the folder cannot be made."""
        path = out / f"{PREFIX}{uuid.uuid4().hex}"
        files.make_folder(path)
        return cls(path)

    def tell(self, what: str, index: int, by: str = "") -> None:
        """Leave a message on a run, if the folder can be written. ``by``: a driver's token."""
        with contextlib.suppress(OSError):
            (self.path / ".".join(filter(None, (what, f"{index}", by)))).touch()

    def note(self, text: str) -> None:
        """Leave a text for the command that started the drivers."""
        with contextlib.suppress(files.FileError):
            if self.path.is_dir():
                files.write_text(self.path / f"{NOTE}.{uuid.uuid4().hex}", text)

    def is_over(self, index: int) -> bool:
        """Whether a run of the batch has ended, however it did."""
        return (self.path / f"{OVER}.{index}").exists()

    def clear_done(self, index: int) -> None:
        """Withdraw the message that a run has ended."""
        with contextlib.suppress(files.FileError):
            files.remove(self.path / f"{OVER}.{index}")

    def news(self) -> list[BoardNews]:
        """Return the messages since the last call; a run begins before it is over."""
        try:
            names = {path.name for path in self.path.iterdir()} - self.seen
        except OSError:
            return []
        self.seen.update(names)
        split = [(*name.split("."), "")[:3] for name in sorted(names) if "." in name]
        found = [BoardNews(NOTE, text=self.read(f"{NOTE}.{rest}")) for what, rest, _ in split if what == NOTE]
        for kind in (BEGUN, RESUMED, OVER):
            found += [BoardNews(kind, int(rest), by) for what, rest, by in split if what == kind and rest.isdecimal()]
        return found

    def stop(self, reason: str) -> None:
        """Ask all drivers to stop where their runs can resume, with a reason."""
        files.write_text(self.path / STOP, reason)

    @property
    def stopped(self) -> bool:
        """Whether drivers are to stop."""
        return (self.path / STOP).exists() or not self.path.is_dir()

    @property
    def reason(self) -> str:
        """The reason to stop, for the results of runs; empty after Ctrl-C."""
        return self.read(STOP)

    def read(self, name: str) -> str:
        """Return the text of a file; empty if it cannot be read."""
        try:
            return files.read_text(self.path / name)
        except files.FileError:
            return ""

    def remove(self) -> None:
        """Remove the board; drivers that begin later end at once."""
        shutil.rmtree(self.path, ignore_errors=True)


@dataclass(frozen=True)
class DriverTask:
    """The work of a driver; may be sent to another machine.

    Attributes:
        board: for its messages.
        jobs: all runs of the batch that are not over, with absolute folders.
        transcribe: makes their transcriptions.
        limits: of a run; the board announces the end of the batch's time.
        first: index of the run to begin with, different for each driver, so that few compete.
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
    with ONE_DRIVER:
        check(task)
        order = [*range(task.first, len(task.jobs)), *range(task.first)]
        jobs = {index: task.jobs[index] for index in order}
        queue, halt = BoardQueue(jobs, task.board), BoardHalt(task.board)
        ledger = BoardLedger(task.jobs, Observer(), board=task.board)
        if task.limits.timeout < float("inf"):
            Pool(jobs, queue, 1, task.transcribe, ledger, halt, task.limits).run()
        else:
            SerialRunner(jobs, queue, task.transcribe, ledger, halt, task.limits).run(False)


def check(task: DriverTask) -> None:
    """Raise the errors of ``drive`` before it begins."""
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
    """A queue that leaves out runs that another driver has ended."""

    def __init__(self, jobs: Mapping[int, Job], board: Board) -> None:
        """Start with all jobs waiting."""
        super().__init__(jobs)
        self.board = board

    def take(self, last: Hashable = None) -> int | None:
        """Return the next run."""
        while (index := super().take(last)) is not None and self.board.is_over(index):
            last = self.done(index)
        return index


class BoardHalt(Halt):
    """A halt that the board announces."""

    def __init__(self, board: Board) -> None:
        """Start without a halt."""
        super().__init__(lambda: board.stopped)
        self.board, self.stop_requested, self.last_poll = board, False, 0.0

    def __call__(self) -> bool:
        """Whether to stop; the board is read every POLL_INTERVAL."""
        if not self.stop_requested and monotonic() - self.last_poll > POLL_INTERVAL:
            self.last_poll = monotonic()
            self.stop_requested = self.board.stopped
        return self.stop_requested

    @property
    def reason(self) -> str:
        """The reason, for the results of stopped runs."""
        return self.board.reason


@dataclass
class BoardLedger(Ledger):
    """A ledger that leaves messages on the board; ``token``: of this driver."""

    board: Board = field(kw_only=True)
    token: str = field(default_factory=lambda: uuid.uuid4().hex)

    def started(self, index: int, resumed: bool) -> None:
        """Leave the message that a run starts or resumes."""
        self.begun.add(index)
        self.board.tell(RESUMED if resumed else BEGUN, index, self.token)

    def ended(self, index: int, result: Result) -> None:
        """Leave the message that a run is over, by this driver or before."""
        self.board.tell(OVER, index)

    def note(self, text: str) -> None:
        """Leave a text on the board."""
        self.board.note(text)
