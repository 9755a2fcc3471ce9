"""Pages of runs: each made whole or not at all, here or side by side in worker processes.

A page depends on its folder alone, so it does not matter which process makes it.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic

from symphys import files
from symphys.interrupts import Interrupts, ignoring_interrupts
from symphys.records import dataclass
from symphys.report.pages.run import PAGE, write_run_figures, write_run_report
from symphys.results.file_names import FIGURES
from symphys.results.text_files import ReportError


@dataclass(frozen=True)
class PageFault:
    """A page that could not be made, and why."""

    page: Path
    reason: str

    def __str__(self) -> str:
        """Return the page and the reason, in a line."""
        return f"{self.page} could not be made: {self.reason}"


def make_run_page(folder: Path, figures: bool) -> PageFault | None:
    """Make the page of a run folder, and with ``figures`` its figures as files; return why it could not be made."""

    def make() -> None:
        write_run_report(folder)
        if figures:
            write_run_figures(folder, folder / FIGURES)

    return attempt(folder / PAGE, make)


def attempt(page: Path, make: Callable[[], object]) -> PageFault | None:
    """Call what makes a page; any failure but an interruption becomes a fault."""
    try:
        make()
    except (ReportError, files.FileError) as error:
        return PageFault(page, str(error))
    except Exception as error:
        return PageFault(page, f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)
    return None


DIED = "the process that made it died: killed from outside, out of memory, or a crash in compiled code"
SLOW = "it was not made within {:g} s"
STOP_TIMEOUT = 20.0
"""[s] that a worker has for the end of its page once it is asked to stop."""
MIN_PAGES_PER_WORKER = 40
"""A worker takes a second to start: it is started for so many pages at least."""
MIN_FIGURES_PER_WORKER = 4
"""A worker is started for the figures of so many runs at least, each of which take a second."""

Done = Callable[[Path, PageFault | None], None]
"""Receives each folder whose page was made, or could not be."""


def make_run_pages(folders: Sequence[Path], figures: bool, jobs: int, done: Done, limit: float = math.inf) -> None:
    """Make the page of every folder, here or in up to ``jobs`` worker processes.

    ``limit``: [s] that a page may take; there is always a worker where there is one.

    KeyboardInterrupt ends it: pages that are begun in workers are finished, and every page is whole or as it was.
    """
    count = min(jobs, len(folders) // (MIN_FIGURES_PER_WORKER if figures else MIN_PAGES_PER_WORKER))
    left = deque(folders)
    if count > 1 or limit < math.inf:
        PagePool(left, figures, done, limit).run(max(count, 1))
    with Interrupts().listening() as interrupted:  # a KeyboardInterrupt in the middle of a figure may be lost there
        while left:
            done(left[0], make_run_page(left[0], figures))
            left.popleft()
            if interrupted():
                raise KeyboardInterrupt


@dataclass
class PageWorker:
    """A worker process; ``folder``: whose page it makes, None before it is ready; ``until``: [s] when it has to be."""

    process: BaseProcess
    pipe: Connection
    folder: Path | None = None
    until: float = math.inf
    ended: bool = False

    def stop(self) -> None:
        """Let it end after its page."""
        with suppress(OSError):
            self.pipe.send(None)


@dataclass
class PagePool:
    """Worker processes and the pages that are left for them."""

    left: deque[Path]
    figures: bool
    done: Done
    limit: float = math.inf

    def run(self, count: int) -> None:
        """Make all pages; some are left over only where no process can be started."""
        workers: list[PageWorker] = []
        try:
            with ignoring_interrupts():
                workers += [start(self.figures) for _ in range(count)]
            while workers:
                ready = wait([worker.pipe for worker in workers], self.end_slow(workers))
                for worker in [each for each in workers if each.pipe in ready]:
                    self.receive(worker, workers)
        finally:
            end(workers)

    def end_slow(self, workers: Sequence[PageWorker]) -> float | None:
        """Kill those that take too long; how long to wait for the others [s], None for ever."""
        now = monotonic()
        for worker in workers:
            if now >= worker.until and not worker.ended:
                worker.ended = True
                worker.process.kill()
        until = min((worker.until for worker in workers if not worker.ended), default=math.inf)
        return None if until == math.inf else max(until - now, 0.0)

    def receive(self, worker: PageWorker, workers: list[PageWorker]) -> None:
        """Take what a worker has made, and give it the next page; replace one that died over a page."""
        try:
            fault: PageFault | None = worker.pipe.recv()
        except (EOFError, OSError):
            workers.remove(worker)
            worker.process.join()
            if worker.folder is not None:
                why = SLOW.format(self.limit) if worker.ended else DIED
                self.done(worker.folder, PageFault(worker.folder / PAGE, why))
                if self.left:
                    with ignoring_interrupts():
                        workers.append(start(self.figures))
            return
        if worker.folder is not None:
            self.done(worker.folder, fault)
        if self.left:
            worker.folder, worker.until = self.left.popleft(), monotonic() + self.limit
            with suppress(OSError):  # one that died meanwhile is heard of as such
                worker.pipe.send(worker.folder)
        else:
            workers.remove(worker)
            end([worker])


def start(figures: bool) -> PageWorker:
    """Return a new worker process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=work, args=(there, figures), daemon=True)
    process.start()
    there.close()
    return PageWorker(process, here)


def end(workers: Sequence[PageWorker]) -> None:
    """Let workers end after their pages, and wait for that."""
    with ignoring_interrupts():
        for worker in workers:
            worker.stop()
        for worker in workers:
            worker.process.join(STOP_TIMEOUT)
            if worker.process.is_alive():
                worker.process.terminate()
                worker.process.join()
            worker.pipe.close()


def work(pipe: Connection, figures: bool) -> None:
    """Make pages in a worker process until there are no more, or until its parent has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        pipe.send(None)
        while (folder := pipe.recv()) is not None:
            pipe.send(make_run_page(folder, figures))
