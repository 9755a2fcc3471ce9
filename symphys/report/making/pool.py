"""Pages side by side in worker processes. A page depends on its folder alone, so it does not matter who makes it."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from symphys.interrupts import Interrupts, ignoring_interrupts
from symphys.report.making.page import PageFault, make_run_page
from symphys.report.pages.run import PAGE

DIED = "the process that made it died: killed from outside, out of memory, or a crash in compiled code"
PATIENCE = 20.0
"""[s] that a worker has for the end of its page once it is asked to stop."""
WORTH = {False: 4, True: 80}
"""A worker takes a second to start: it is started for so many pages at least, full ones and (True) light ones."""

Done = Callable[[Path, PageFault | None], None]
"""Receives each folder whose page was made, or could not be."""


def make_run_pages(folders: Sequence[Path], light: bool, jobs: int, done: Done) -> None:
    """Make the page of every folder, here or in up to ``jobs`` worker processes.

    KeyboardInterrupt ends it: pages that are begun in workers are finished, and every page is whole or as it was.
    """
    count = min(jobs, len(folders) // WORTH[light])
    left = deque(folders)
    if count > 1:
        PagePool(left, light, done).run(count)
    with Interrupts().listening() as interrupted:  # a KeyboardInterrupt in the middle of a figure may be lost there
        while left:
            done(left[0], make_run_page(left[0], light))
            left.popleft()
            if interrupted():
                raise KeyboardInterrupt


@dataclass
class PageWorker:
    """A worker process; ``folder``: whose page it makes, None before it is ready."""

    process: BaseProcess
    pipe: Connection
    folder: Path | None = None

    def stop(self) -> None:
        """Let it end after its page."""
        with suppress(OSError):
            self.pipe.send(None)


@dataclass
class PagePool:
    """Worker processes and the pages that are left for them."""

    left: deque[Path]
    light: bool
    done: Done

    def run(self, count: int) -> None:
        """Make all pages; some are left over only where no process can be started."""
        workers: list[PageWorker] = []
        try:
            with ignoring_interrupts():
                workers += [start(self.light) for _ in range(count)]
            while workers:
                ready = wait([worker.pipe for worker in workers])
                for worker in [each for each in workers if each.pipe in ready]:
                    self.hear(worker, workers)
        finally:
            end(workers)

    def hear(self, worker: PageWorker, workers: list[PageWorker]) -> None:
        """Take what a worker has made, and give it the next page; replace one that died over a page."""
        try:
            fault: PageFault | None = worker.pipe.recv()
        except (EOFError, OSError):
            workers.remove(worker)
            worker.process.join()
            if worker.folder is not None:
                self.done(worker.folder, PageFault(worker.folder / PAGE, DIED))
                if self.left:
                    with ignoring_interrupts():
                        workers.append(start(self.light))
            return
        if worker.folder is not None:
            self.done(worker.folder, fault)
        if self.left:
            worker.folder = self.left.popleft()
            with suppress(OSError):  # one that died meanwhile is heard of as such
                worker.pipe.send(worker.folder)
        else:
            workers.remove(worker)
            end([worker])


def start(light: bool) -> PageWorker:
    """A new worker process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=work, args=(there, light), daemon=True)
    process.start()
    there.close()
    return PageWorker(process, here)


def end(workers: Sequence[PageWorker]) -> None:
    """Let workers end after their pages, and wait for that."""
    with ignoring_interrupts():
        for worker in workers:
            worker.stop()
        for worker in workers:
            worker.process.join(PATIENCE)
            if worker.process.is_alive():
                worker.process.terminate()
                worker.process.join()
            worker.pipe.close()


def work(pipe: Connection, light: bool) -> None:
    """What a worker does: make pages until there are no more, or until its parent has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        pipe.send(None)
        while (folder := pipe.recv()) is not None:
            pipe.send(make_run_page(folder, light))
