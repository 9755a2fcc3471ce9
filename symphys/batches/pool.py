"""Runs side by side in worker processes. A process that dies costs its own run only, and another takes its place.

Each worker has a pipe of its own: a shared queue would stay locked forever when a worker is killed while it holds it.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Hashable
from dataclasses import field
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path

from symphys import threads
from symphys.batches.ledger import Ledger, retried
from symphys.batches.limits import BatchLimits, Halt, timed_out
from symphys.batches.queue import Queue
from symphys.batches.worker import REPORT_INTERVAL, Begun, Ended, News, Order, Ready, Stopping, serve
from symphys.interrupts import ignoring_interrupts
from symphys.records import dataclass
from symphys.results.result import Result
from symphys.runs.execute import Transcribe, give_up, stop_at_limit
from symphys.runs.job import Job
from symphys.solvers import TraceRow

GRACE_TIME = 1.0
"""[s] for a run to stop by itself after its timeout; then its process and its compilers are killed."""
BUILDING, SOLVING = "building and compiling", "solving"
"""The phases of a run before and after its first iteration; judging announces its own parts."""
PS_TIMEOUT = 1.0
"""[s] after which ``ps``, asked where there is no /proc, is not waited for."""
MAX_FAILED_STARTS = 3
"""Workers in a row that may end before they are ready; then no more are started."""


class NoWorkers(Exception):
    """Raised where worker processes cannot be started; the text says how the last one ended."""


@dataclass
class WorkerSlot:
    """A worker process, as the parent sees it.

    Attributes:
        process, pipe: the worker and the connection to it.
        ready: whether it accepts runs.
        index: of its job; None if it is idle.
        last: the subject of its last transcription.
        deadline: [s] of its run.
        phase: the phase of its run.
        stop_requested: whether its run was asked to stop.
        stop_reason: the limit that its run has reached, in words; empty for none.
        ended: whether its process was killed for it.
    """

    process: SpawnProcess
    pipe: Connection[Order, News]
    ready: bool = False
    index: int | None = None
    last: Hashable = None
    deadline: float = math.inf
    phase: str = BUILDING
    stop_requested: bool = False
    stop_reason: str = ""
    ended: bool = False


@dataclass
class Pool:
    """Worker processes that do the runs of a queue."""

    jobs: dict[int, Job]
    queue: Queue
    count: int
    transcribe: Transcribe
    ledger: Ledger
    halt: Halt
    limits: BatchLimits
    slots: list[WorkerSlot] = field(default_factory=list)
    tries: Counter[int] = field(default_factory=Counter)
    failed_starts: int = 0

    def run(self) -> None:
        """Do all jobs, or as many as a halt leaves time for; NoWorkers if no worker starts."""
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
    def working(self) -> list[WorkerSlot]:
        """The slots that have a run."""
        return [slot for slot in self.slots if slot.index is not None]

    def fill(self) -> None:
        """Start workers until there are enough for the runs that are left."""
        wanted = min(self.count, len(self.queue) + len(self.working))
        while len(self.slots) < wanted:
            context = multiprocessing.get_context("spawn")
            ours, theirs = context.Pipe()
            given = theirs, self.transcribe, self.limits.bounded
            process = context.Process(target=serve, args=given, name="symphys-worker", daemon=True)
            with ignoring_interrupts():
                process.start()
            theirs.close()
            self.slots.append(WorkerSlot(process, ours))

    def hand_out(self) -> None:
        """Give each idle worker a run."""
        for slot in self.slots:
            if not slot.ready or slot.index is not None:
                continue
            index = self.queue.take(slot.last)
            if index is None:
                if not self.working:
                    self.ledger.wait_for(self.queue.claimed)
                return
            slot.index, slot.stop_requested, slot.stop_reason, slot.phase = index, False, "", BUILDING
            slot.deadline = time.monotonic() + self.limits.timeout
            send(slot, (self.jobs[index],))

    def bound(self) -> None:
        """Ask runs to stop at a halt or timeout; kill a process that does not stop."""
        now, halt = time.monotonic(), self.halt()
        for slot in self.working:
            judging = self.limits.judging if slot.phase == SOLVING else 0.0
            if not slot.stop_requested and (halt or now > slot.deadline - judging):
                slot.stop_requested, slot.stop_reason = (
                    True,
                    self.halt.reason if halt else timed_out(self.limits.timeout),
                )
                ends = now if halt else max(now, slot.deadline)
                slot.deadline = ends + GRACE_TIME if slot.stop_reason else math.inf
                send(slot, Stopping(slot.stop_reason))
            elif slot.stop_requested and now > slot.deadline and slot.process.pid and not slot.ended:
                slot.ended = True
                end_tree(slot.process.pid)

    def listen(self) -> None:
        """Wait for messages and read them."""
        waited = connection.wait(
            [each for slot in self.slots for each in (slot.pipe, slot.process.sentinel)], REPORT_INTERVAL
        )
        if not self.slots:
            time.sleep(REPORT_INTERVAL)
        for slot in list(self.slots):
            if slot.pipe in waited or slot.process.sentinel in waited:
                self.take_news(slot)

    def take_news(self, slot: WorkerSlot) -> None:
        """Read the messages of a worker; of a dead one, all that it has sent."""
        dead = not slot.process.is_alive()
        try:
            while slot.pipe.poll():
                self.take(slot, slot.pipe.recv())
        except (EOFError, OSError):
            dead = True
        if dead:
            self.reap(slot)

    def take(self, slot: WorkerSlot, news: News) -> None:
        """Take one message of a worker."""
        index = slot.index
        if isinstance(news, Ready):
            slot.ready, self.failed_starts = True, 0
        elif index is None:
            return
        elif isinstance(news, Begun):
            self.ledger.started(index, news.resumed)
        elif isinstance(news, TraceRow):
            slot.phase = SOLVING
            self.ledger.advanced(index, news)
        elif isinstance(news, Ended):
            slot.last, slot.index = self.queue.done(index), None
            self.end(index, news.result)
        else:
            slot.phase = news
            self.ledger.judging(index, news)

    def end(self, index: int, result: Result | None) -> None:
        """Record the result of a run; None: another command works on it."""
        if result is None:
            self.queue.put_off(index)
            return
        self.tries[index] += 1
        if result.status == "failed" and self.tries[index] <= self.limits.retries and not self.halt():
            self.again(index, result.advice)
        else:
            self.ledger.ended(index, result)

    def again(self, index: int, why: str) -> None:
        """Put a run back for another try."""
        self.jobs[index] = retried(self.jobs[index], why, self.ledger)
        self.queue.put(index)

    def reap(self, slot: WorkerSlot) -> None:
        """Remove a dead worker; its run, if it had one, is tried again or given up."""
        self.slots.remove(slot)
        slot.process.join()
        slot.pipe.close()
        cause = cause_of(slot.process.exitcode)
        if not slot.ready:
            self.failed_starts += 1
            if self.failed_starts >= MAX_FAILED_STARTS:
                raise NoWorkers(f"worker processes do not start: the last {cause}")
        index = slot.index
        if index is None:
            return
        self.queue.done(index)
        self.tries[index] += 1
        job = self.jobs[index]
        if slot.ended:
            self.ledger.ended(index, stop_at_limit(job, f"{slot.stop_reason} (it was at: {slot.phase})"))
        elif self.tries[index] <= max(self.limits.retries, 1) and not self.halt():
            self.again(index, f"its process {cause}")
        elif not slot.stop_requested:
            self.ledger.ended(index, give_up(job, f"the process of this run {cause}", again=True))

    def close(self) -> None:
        """End all workers; idle ones end by themselves."""
        for slot in self.slots:
            slot.pipe.close()
            if slot.index is not None or not slot.ready:
                slot.process.terminate()
        for slot in self.slots:
            slot.process.join()
        self.slots.clear()


def send(slot: WorkerSlot, order: Order) -> None:
    """Send an order to a worker; a dead worker is noticed when it is listened to."""
    try:
        slot.pipe.send(order)
    except OSError:
        return


def cause_of(code: int | None) -> str:
    """Return how a process ended, in words."""
    if code is None or code >= 0:
        return f"died with exit code {code}: a crash in compiled code, or out of memory"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ": killed from outside, or out of memory" if name == "SIGKILL" else ": a crash in compiled code"
    return f"died of {name}{hint if name in ('SIGKILL', 'SIGSEGV', 'SIGABRT', 'SIGBUS', 'SIGILL', 'SIGFPE') else ''}"


def end_tree(process: int) -> None:
    """Kill a process and its descendants, all of which are halted first, so that none starts another meanwhile."""
    found: list[int] = []
    new = [process]
    while new:
        send_signal(new, "SIGSTOP")
        found += new
        parents = parents_by_process()
        new = [each for each, parent in parents.items() if parent in found and each not in found]
    send_signal(found, "SIGKILL")


def send_signal(processes: list[int], name: str) -> None:
    """Send a signal by its name; Windows can only end a process, not halt it."""
    number = getattr(signal, name, None)
    for process in processes:
        with contextlib.suppress(OSError):
            if number is not None:
                os.kill(process, number)
            elif name == "SIGKILL":
                os.kill(process, signal.SIGTERM)


def parents_by_process() -> dict[int, int]:
    """Return the parent of every visible process of this machine; empty where the system does not list them."""
    found: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            text = entry.read_text(encoding="utf-8", errors="replace")
            found[int(entry.parent.name)] = int(text.rpartition(")")[2].split()[1])
    if found:
        return found
    try:
        command = ["ps", "-A", "-o", "pid=,ppid="]
        listed = subprocess.run(command, capture_output=True, text=True, timeout=PS_TIMEOUT, check=False).stdout
    except (OSError, subprocess.SubprocessError):
        return {}
    pairs = [line.split() for line in listed.splitlines()]
    return {int(pair[0]): int(pair[1]) for pair in pairs if len(pair) == 2 and all(map(str.isdigit, pair))}
