"""Runs side by side in worker processes. A process that dies concerns its own run only, and another takes its place.

Each worker has a pipe of its own: a queue that workers share stays locked for ever when one of them is killed in it.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
import time
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from symphys import threads
from symphys.batches.ledger import Ledger
from symphys.batches.limits import BatchLimits, Halt, timed_out
from symphys.batches.process_tree import end_tree
from symphys.batches.queue import Queue
from symphys.batches.worker import TICK, Begun, Ended, News, Order, Ready, Stopping, serve
from symphys.interrupts import ignoring_interrupts
from symphys.results.file_names import RESULT
from symphys.results.result import Result
from symphys.runs.execute import give_up, stop_at_limit
from symphys.runs.job import Job
from symphys.runs.standing import stamped
from symphys.runs.transcription_cache import Transcribe
from symphys.solvers import TraceRow

GRACE = 1.0
"""[s] that a run has to stop by itself after its time is up; then its process is killed, and its compilers with it."""
BUILDING, SOLVING = "building and compiling", "solving"
"""What a run is at before its first iteration and after it; the judging announces its parts."""
MOST_STARTS = 3
"""Workers that end before they are ready, one after the other, until no more are tried."""


class NoWorkers(Exception):
    """Worker processes cannot be started; the text says what became of the last."""


@dataclass
class Seat:
    """A worker process, as the parent sees it.

    Attributes:
        process, pipe: the worker, and the way to it.
        ready: whether it takes runs.
        index: of the job that it is at.
        last: the subject that it has transcribed.
        until: [s] when the time of its run is up.
        doing: what its run is at.
        asked: whether its run was asked to stop.
        why: which limit its run has reached, in words; empty for none.
        ended: whether its process was killed for that.
    """

    process: SpawnProcess
    pipe: Connection[Order, News]
    ready: bool = False
    index: int | None = None
    last: Hashable = None
    until: float = math.inf
    doing: str = BUILDING
    asked: bool = False
    why: str = ""
    ended: bool = False


@dataclass
class Pool:
    """Worker processes that do what a queue holds."""

    jobs: dict[int, Job]
    queue: Queue
    count: int
    transcribe: Transcribe
    ledger: Ledger
    halt: Halt
    limits: BatchLimits
    seats: list[Seat] = field(default_factory=list)
    tries: Counter[int] = field(default_factory=Counter)
    failed_starts: int = 0

    def run(self) -> None:
        """Do all jobs, or as many as can be before a halt. NoWorkers where there can be none."""
        threads.limit()
        try:
            while self.working or (len(self.queue) and not self.halt()):
                self.bound()
                if not self.halt():
                    self.fill()
                    self.hand_out()
                self.listen()
        finally:
            self.close()

    @property
    def working(self) -> list[Seat]:
        """The workers that are at a run."""
        return [seat for seat in self.seats if seat.index is not None]

    def fill(self) -> None:
        """Start workers until there are enough for what is left."""
        wanted = min(self.count, len(self.queue) + len(self.working))
        while len(self.seats) < wanted:
            context = multiprocessing.get_context("spawn")
            ours, theirs = context.Pipe()
            given = theirs, self.transcribe, self.limits.bounded
            process = context.Process(target=serve, args=given, name="symphys-worker", daemon=True)
            with ignoring_interrupts():
                process.start()
            theirs.close()
            self.seats.append(Seat(process, ours))

    def hand_out(self) -> None:
        """Give each idle worker a run."""
        for seat in self.seats:
            if not seat.ready or seat.index is not None:
                continue
            index = self.queue.take(seat.last)
            if index is None:
                if not self.working:
                    self.ledger.wait_for(self.queue.claimed)
                return
            seat.index, seat.asked, seat.why, seat.doing = index, False, "", BUILDING
            seat.until = time.monotonic() + self.limits.timeout
            send(seat, (self.jobs[index],))

    def bound(self) -> None:
        """Ask runs to stop whose time is up, or all of them at a halt; kill a process that a limit does not stop."""
        now, halt = time.monotonic(), self.halt()
        for seat in self.working:
            if not seat.asked and (halt or now > seat.until):
                seat.asked, seat.why = True, self.halt.reason if halt else timed_out(self.limits.timeout)
                seat.until = now + GRACE if seat.why else math.inf
                send(seat, Stopping(seat.why))
            elif seat.asked and now > seat.until and seat.process.pid and not seat.ended:
                seat.ended = True
                end_tree(seat.process.pid)

    def listen(self) -> None:
        """Wait for news, and take them."""
        waited = connection.wait([each for seat in self.seats for each in (seat.pipe, seat.process.sentinel)], TICK)
        if not self.seats:
            time.sleep(TICK)
        for seat in list(self.seats):
            if seat.pipe in waited or seat.process.sentinel in waited:
                self.take_news(seat)

    def take_news(self, seat: Seat) -> None:
        """Read what a worker has sent; of one that is dead, to the last word."""
        dead = not seat.process.is_alive()
        try:
            while seat.pipe.poll():
                self.take(seat, seat.pipe.recv())
        except (EOFError, OSError):
            dead = True
        if dead:
            self.bury(seat)

    def take(self, seat: Seat, news: News) -> None:
        """Take one message."""
        index = seat.index
        if isinstance(news, Ready):
            seat.ready, self.failed_starts = True, 0
        elif index is None:
            return
        elif isinstance(news, Begun):
            self.ledger.started(index, news.resumed)
        elif isinstance(news, TraceRow):
            seat.doing = SOLVING
            self.ledger.advanced(index, news)
        elif isinstance(news, Ended):
            seat.last, seat.index = self.queue.done(index), None
            self.end(index, news.result)
        else:
            seat.doing = news
            self.ledger.judging(index, news)

    def end(self, index: int, result: Result | None) -> None:
        """A run has ended, or is another command's."""
        if result is None:
            self.queue.put_off(index)
            return
        self.tries[index] += 1
        if result.status == "failed" and self.tries[index] <= self.limits.retries and not self.halt():
            self.again(index, result.advice)
        else:
            self.ledger.ended(index, result)

    def again(self, index: int, why: str) -> None:
        """Let a run be tried once more."""
        job = self.jobs[index]
        self.jobs[index] = replace(job, outdated=stamped(job.folder.path / RESULT))
        self.ledger.note(f"{job.name}: tried again, as {why}")
        self.queue.put(index)

    def bury(self, seat: Seat) -> None:
        """A worker is dead; its run, if it had one, is tried again or given up."""
        self.seats.remove(seat)
        seat.process.join()
        seat.pipe.close()
        cause = cause_of(seat.process.exitcode)
        if not seat.ready:
            self.failed_starts += 1
            if self.failed_starts >= MOST_STARTS:
                raise NoWorkers(f"worker processes do not start: the last {cause}")
        index = seat.index
        if index is None:
            return
        self.queue.done(index)
        self.tries[index] += 1
        job = self.jobs[index]
        if seat.ended:
            self.ledger.ended(index, stop_at_limit(job, f"{seat.why} (it was at: {seat.doing})"))
        elif self.tries[index] <= max(self.limits.retries, 1) and not self.halt():
            self.again(index, f"its process {cause}")
        elif not seat.asked:
            self.ledger.ended(index, give_up(job, f"the process of this run {cause}", again=True))

    def close(self) -> None:
        """Let idle workers end, and end those that are not."""
        for seat in self.seats:
            seat.pipe.close()
            if seat.index is not None or not seat.ready:
                seat.process.terminate()
        for seat in self.seats:
            seat.process.join()
        self.seats.clear()


def send(seat: Seat, order: Order) -> None:
    """Tell a worker; one that is dead is found out when it is listened to."""
    try:
        seat.pipe.send(order)
    except OSError:
        return


def cause_of(code: int | None) -> str:
    """How a process ended, in words."""
    if code is None or code >= 0:
        return f"died with exit code {code}: a crash in compiled code, or out of memory"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ": killed from outside, or out of memory" if name == "SIGKILL" else ": a crash in compiled code"
    return f"died of {name}{hint if name in ('SIGKILL', 'SIGSEGV', 'SIGABRT', 'SIGBUS', 'SIGILL', 'SIGFPE') else ''}"
