"""What a worker process does: runs, one after the other, as its parent sends them."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from symphys.results.result import Result
from symphys.runs.claim import FolderBusy
from symphys.runs.execute import execute
from symphys.runs.job import Job
from symphys.runs.transcription_cache import Transcribe, TranscriptionCache
from symphys.solvers import TraceRow

TICK = 0.1
"""[s] between two iterations that are reported."""


@dataclass(frozen=True)
class Ready:
    """The process has started and waits for a run."""


@dataclass(frozen=True)
class Begun:
    """The run begins, or goes on."""

    resumed: bool


@dataclass(frozen=True)
class Ended:
    """The run is over; None: another command is at it."""

    result: Result | None


@dataclass(frozen=True)
class Stopping:
    """The run is to stop where it can go on; the text says why."""

    reason: str


News = Ready | Begun | Ended | TraceRow | str
"""From a worker; a text is a part of judging that begins."""
Order = tuple[Job] | Stopping
"""To a worker: a run, or that it is to stop."""


@dataclass
class Worker:
    """A worker process and the run that it is at; ``bounded``: whether a limit may kill it."""

    parent: Connection[News, Order]
    transcriptions: TranscriptionCache
    bounded: bool = False
    reported: float = field(default=0.0)

    def serve(self) -> None:
        """Do what the parent sends, until it closes the connection."""
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
        """Report to the parent now and then; stop the solver when asked to."""
        while (order := self.hear()) is not None:
            if isinstance(order, Stopping):
                raise KeyboardInterrupt(order.reason)
        now = time.monotonic()
        if now - self.reported > TICK:
            self.reported = now
            self.tell(row)

    def hear(self) -> Order | None:
        """What the parent has sent; None if there is nothing. Without a parent the process ends, its run unwritten."""
        try:
            return self.parent.recv() if self.parent.poll() else None
        except (EOFError, OSError):
            os._exit(1)

    def tell(self, news: News) -> None:
        """Send news; likewise."""
        try:
            self.parent.send(news)
        except OSError:
            os._exit(1)


def serve(parent: Connection[News, Order], transcribe: Transcribe, bounded: bool = False) -> None:
    """The life of a worker process; it ends with its parent. ``bounded``: see ``Worker``."""
    threading.Thread(target=end_with_parent, daemon=True).start()
    Worker(parent, TranscriptionCache(transcribe), bounded).serve()


def end_with_parent() -> None:
    """Wait for the parent's end; a parent that was killed cannot stop its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
