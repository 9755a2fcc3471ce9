"""The worker process: it does runs, one after the other, as its parent sends them."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from dataclasses import field
from multiprocessing.connection import Connection

from symphys.records import dataclass
from symphys.results.result import Result
from symphys.runs.claim import FolderBusy
from symphys.runs.execute import Transcribe, TranscriptionCache, execute
from symphys.runs.job import Job
from symphys.solvers import TraceRow

REPORT_INTERVAL = 0.1
"""[s] between two reported iterations."""


@dataclass(frozen=True)
class Ready:
    """Message of a worker that has started and accepts runs."""


@dataclass(frozen=True)
class Begun:
    """Message that a run starts or resumes."""

    resumed: bool


@dataclass(frozen=True)
class Ended:
    """Message that a run is over; None: another command works on it."""

    result: Result | None


@dataclass(frozen=True)
class Stopping:
    """Order to stop the run where it can resume; the text is the reason."""

    reason: str


News = Ready | Begun | Ended | TraceRow | str
"""Messages of a worker; a text announces a part of judging."""
Order = tuple[Job] | Stopping
"""Orders to a worker: a run, or to stop."""


@dataclass
class Worker:
    """A worker process and its run; ``bounded``: whether a limit may kill it."""

    parent: Connection[News, Order]
    transcriptions: TranscriptionCache
    bounded: bool = False
    reported: float = field(default=0.0)

    def serve(self) -> None:
        """Do what the parent orders, until it closes the connection."""
        self.parent.send(Ready())
        while True:
            try:
                order = self.parent.recv()
            except EOFError:
                return
            if not isinstance(order, Stopping):
                self.parent.send(Ended(self.work(*order)))

    def work(self, job: Job) -> Result | None:
        """Do one run."""
        try:
            return execute(
                job,
                self.watch,
                self.transcriptions,
                tell=self.tell,
                begin=lambda resumed: self.tell(Begun(resumed)),
                bounded=self.bounded,
            )
        except FolderBusy:
            return None

    def watch(self, row: TraceRow) -> None:
        """Report to the parent at intervals; stop the solver when ordered to."""
        while (order := self.receive()) is not None:
            if isinstance(order, Stopping):
                raise KeyboardInterrupt(order.reason)
        now = time.monotonic()
        if now - self.reported > REPORT_INTERVAL:
            self.reported = now
            self.tell(row)

    def receive(self) -> Order | None:
        """Return the next order of the parent, or None. Without a parent the process ends, its run unwritten."""
        try:
            return self.parent.recv() if self.parent.poll() else None
        except (EOFError, OSError):
            os._exit(1)

    def tell(self, news: News) -> None:
        """Send a message; without a parent the process ends."""
        try:
            self.parent.send(news)
        except OSError:
            os._exit(1)


def serve(parent: Connection[News, Order], transcribe: Transcribe, bounded: bool = False) -> None:
    """Run a worker process until its parent ends. ``bounded``: see ``Worker``."""
    threading.Thread(target=end_with_parent, daemon=True).start()
    Worker(parent, TranscriptionCache(transcribe), bounded).serve()


def end_with_parent() -> None:
    """Wait for the end of the parent and exit, since a killed parent cannot stop its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
