"""Runs side by side in worker processes, robust against the crash of one of them and Ctrl-C."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing.queues import SimpleQueue
from multiprocessing.synchronize import Event
from typing import Protocol

from symphys import threads
from symphys.errors import SymphysError
from symphys.results.result import Result
from symphys.runs.execute import execute, give_up
from symphys.runs.job import Job
from symphys.runs.stopping import Stop, ignoring_interrupts
from symphys.runs.transcription_cache import Transcribe, TranscriptionCache
from symphys.solvers import TraceRow

TICK = 0.1
"""[s] between two readings of the messages of workers; a worker reports its iterations no more often."""
CRASHED = "the process of this run died: killed from outside, out of memory, or a crash in compiled code"


Message = tuple[int, TraceRow | str | None]
"""From a worker: the index of a job; its newest iteration, a part of judging it that begins, or None: it begins."""


class Listener(Protocol):
    """Receives what happens to the runs, by their index."""

    def started(self, index: int) -> None:
        """The run begins."""

    def advanced(self, index: int, row: TraceRow) -> None:
        """The run has come to this iteration."""

    def judging(self, index: int, what: str) -> None:
        """This part of judging the run begins."""

    def ended(self, index: int, result: Result) -> None:
        """The run is over."""


def side_by_side(jobs: Mapping[int, Job], count: int, transcribe: Transcribe, listener: Listener, stop: Stop) -> None:
    """Run all jobs in ``count`` processes; a process that dies fails the run that killed it and no other.

    Which of the running ones did it shows when each of them is tried again alone.
    """
    threads.limit()
    waiting = dict(jobs)
    while waiting and not stop():
        pool = WorkerPool(waiting, count, transcribe, listener, stop)
        pool.run()
        if pool.broken and not pool.begun:
            raise SymphysError("worker processes cannot be started here; leave --jobs out")
        for index in pool.suspects:
            if stop():
                return
            alone = WorkerPool({index: waiting[index]}, 1, transcribe, listener, stop)
            alone.run()
            if alone.suspects:
                listener.ended(index, give_up(waiting[index], CRASHED))
        waiting = {index: job for index, job in waiting.items() if index in pool.untouched}


@dataclass
class WorkerPool:
    """One set of worker processes and the outcome of its jobs.

    Attributes:
        begun, ended: indices of jobs.
        broken: whether a worker died.
    """

    jobs: Mapping[int, Job]
    count: int
    transcribe: Transcribe
    listener: Listener
    stop: Stop
    begun: set[int] = field(default_factory=set)
    ended: set[int] = field(default_factory=set)
    broken: bool = False

    @property
    def suspects(self) -> list[int]:
        """The jobs that were running when a worker died."""
        return sorted(self.begun - self.ended) if self.broken else []

    @property
    def untouched(self) -> set[int]:
        """The jobs that had not begun when a worker died."""
        return set(self.jobs) - self.begun if self.broken else set()

    def run(self) -> None:
        """Do all jobs, or as many as can be."""
        context = multiprocessing.get_context("spawn")
        messages, halt = context.SimpleQueue(), context.Event()
        count = min(self.count, len(self.jobs))
        futures: dict[Future[Result], int] = {}
        with ProcessPoolExecutor(count, context, prepare, (messages, halt, self.transcribe)) as pool:
            try:
                with ignoring_interrupts():
                    futures.update({pool.submit(work, index, job): index for index, job in self.jobs.items()})
                self.follow(futures, messages, halt)
            except BrokenProcessPool:
                self.hear(messages)
                self.broken = True
            except KeyboardInterrupt:
                for child in multiprocessing.active_children():
                    child.terminate()
                raise
            except SymphysError:
                cancel_waiting(futures, halt)
                raise

    def follow(self, futures: dict[Future[Result], int], messages: SimpleQueue[Message], halt: Event) -> None:
        """Pass on the messages of the workers until all is done."""
        while futures:
            done, _ = wait(futures, timeout=TICK, return_when=FIRST_COMPLETED)
            if self.stop() and not halt.is_set():
                cancel_waiting(futures, halt)
            self.hear(messages)
            for future in done:
                self.end(futures.pop(future), future)

    def hear(self, messages: SimpleQueue[Message]) -> None:
        """Read the messages that are there."""
        while not messages.empty():
            index, news = messages.get()
            if isinstance(news, str):
                self.listener.judging(index, news)
            elif news is not None:
                self.listener.advanced(index, news)
            elif index not in self.begun:
                self.begun.add(index)
                self.listener.started(index)

    def end(self, index: int, future: Future[Result]) -> None:
        """Take a result; a job that was cancelled has none."""
        try:
            result = future.result()
        except CancelledError:
            return
        self.ended.add(index)
        self.listener.ended(index, result)


def cancel_waiting(futures: Iterable[Future[Result]], halt: Event) -> None:
    """Start nothing more, and let the running ones stop where they can go on later."""
    halt.set()
    for future in futures:
        future.cancel()


@dataclass
class Worker:
    """What a worker process has for all its jobs."""

    messages: SimpleQueue[Message]
    halt: Event
    transcriptions: TranscriptionCache
    reported: float = 0.0

    def work(self, index: int, job: Job) -> Result:
        """Do one job."""
        self.messages.put((index, None))
        return execute(
            job,
            lambda row: self.watch(index, row),
            self.transcriptions,
            tell=lambda what: self.messages.put((index, what)),
        )

    def watch(self, index: int, row: TraceRow) -> None:
        """Report to the parent now and then; stop the solver when asked to."""
        if self.halt.is_set():
            raise KeyboardInterrupt
        now = time.monotonic()
        if now - self.reported > TICK:
            self.reported = now
            self.messages.put((index, row))


here: list[Worker] = []
"""The worker of this process, if it is one: the executor hands its jobs to module functions only."""


def prepare(messages: SimpleQueue[Message], halt: Event, transcribe: Transcribe) -> None:
    """Set a worker process up, and let it end with its parent."""
    here[:] = [Worker(messages, halt, TranscriptionCache(transcribe))]
    threading.Thread(target=end_with_parent, daemon=True).start()


def end_with_parent() -> None:
    """Wait for the parent's end; a parent that was killed cannot stop its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def work(index: int, job: Job) -> Result:
    """Do one job in the worker of this process."""
    return here[0].work(index, job)
