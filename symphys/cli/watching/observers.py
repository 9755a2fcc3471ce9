"""The progress of a batch on stderr: live lines on a terminal, plain lines elsewhere, or failures only."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Column
from rich.text import Text

from symphys.batches import Observer
from symphys.cli.watching.events import Events
from symphys.cli.watching.heartbeat import LINE_INTERVAL, UPDATE_INTERVAL, heartbeat
from symphys.cli.watching.progress import BatchShare, Notes
from symphys.cli.wording import at, batch_words, brief, judging_words, log_end, use_words, waiting_words

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow

MAX_QUIET = 3
"""Runs without news that are named at once."""
MAX_SHOWN = 16
"""Runs in work that have a line each."""
MANY_RUNS = 100
"""Number of runs from which only those that fail have lines of their own."""


class BatchLines(Observer, ABC):
    """Base of the observers that show the progress of a batch and a line for each run that ends."""

    def __init__(self, runs: int) -> None:
        """Start with nothing shown."""
        self.notes, self.batch = Notes(), BatchShare(runs)
        self.many = runs >= MANY_RUNS
        self.lock = RLock()

    @abstractmethod
    def echo(self, line: str, folded: bool = False) -> None:
        """Write a line that stays; ``folded``: at the width of a terminal."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Write how the run ended; for many runs, only failures."""
        with self.lock:
            self.batch.ended(job, skipped)
            self.batch.found(job, result)
            failed = result.status == "failed" and not skipped
            if failed or not self.many:
                self.echo(f"{job.name}: {brief(job, result, skipped)}", folded=True)
            for line in (*(log_end(job) if failed else ()), *self.notes.new(result, skipped)):
                self.echo(line)

    def note(self, text: str) -> None:
        """Write a message."""
        with self.lock:
            self.echo(f"symphys: {text}")


class Plain(BatchLines):
    """A line when a run begins, one when it ends, and some while it goes on; nothing is redrawn."""

    def __init__(self, every: float = LINE_INTERVAL, runs: int = 1) -> None:
        """Start with nothing shown; ``every``: seconds between lines while runs go on."""
        super().__init__(runs)
        self.every, self.last = every, monotonic()

    @property
    def due(self) -> bool:
        """Whether nothing was written for ``every`` seconds."""
        return monotonic() - self.last >= self.every

    def started(self, job: Job, resumed: bool) -> None:
        """Write that the run starts or resumes."""
        with self.lock:
            self.batch.started(job)
            if not self.many:
                self.echo(f"{job.name}: {'goes on' if resumed else 'begins'}")

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Write the iteration, if a line is due."""
        with self.lock:
            use = self.batch.advanced(job, row)
            if self.due:
                own = () if self.many else (f"{job.name}: {at(row)}", use_words(use))
                self.echo("; ".join(filter(None, (*own, self.whole()))))

    def judging(self, job: Job, what: str) -> None:
        """Keep the part for the next line."""
        with self.lock:
            self.batch.judging(job, what)
            self.beat()

    def beat(self) -> None:
        """Write which runs bring no news, if a line is due."""
        with self.lock:
            if self.due:
                for name, words in list(waiting_words(self.batch, self.every).items())[:MAX_QUIET]:
                    self.echo(f"{name}: {words}")

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Write how the run ended, and of many runs where the batch is."""
        with self.lock:
            super().ended(job, result, skipped)
            if self.many and self.due:
                self.echo(self.whole())

    def whole(self) -> str:
        """Return where the batch is; empty for a single run."""
        return batch_words(self.batch) if self.batch.runs > 1 else ""

    def echo(self, line: str, folded: bool = False) -> None:
        """Write a line."""
        self.last = monotonic()
        click.echo(line, err=True)


class Live(BatchLines):
    """A bar for the batch, a moving line for each run in work, and a line that stays for each that is over."""

    def __init__(self, progress: Progress, runs: int) -> None:
        """Start the bar at zero."""
        super().__init__(runs)
        self.progress = progress
        self.total = progress.add_task(batch_words(self.batch), total=1.0)
        self.tasks: dict[str, TaskID] = {}

    def started(self, job: Job, resumed: bool) -> None:
        """Open the line of the run."""
        with self.lock:
            self.batch.started(job)
            shown = len(self.tasks) < MAX_SHOWN
            self.tasks[job.name] = self.progress.add_task(f"{job.name}: building", total=None, visible=shown)

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Move the line of the run on."""
        with self.lock:
            use = self.batch.advanced(job, row)
            total, done = (None, None) if math.isnan(use.share) else (1.0, use.share)
            self.describe(job.name, "; ".join(filter(None, (use_words(use), at(row)))), total, done)
            self.move()

    def judging(self, job: Job, what: str) -> None:
        """Show the part in the line of the run."""
        with self.lock:
            self.describe(job.name, judging_words(self.batch.judging(job, what)))

    def beat(self) -> None:
        """Show which runs bring no news, and update the time that is left."""
        with self.lock:
            for name, words in waiting_words(self.batch, LINE_INTERVAL).items():
                self.describe(name, words)
            self.move()

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Close the line of the run, and write how it ended."""
        with self.lock:
            if job.name in self.tasks:
                self.progress.remove_task(self.tasks.pop(job.name))
            super().ended(job, result, skipped)
            self.move()

    def describe(self, name: str, words: str, total: float | None = None, done: float | None = None) -> None:
        """Show words in the line of a run, if it has one."""
        if name in self.tasks:
            self.progress.update(self.tasks[name], description=f"{name}: {words}", total=total, completed=done)

    def move(self) -> None:
        """Show the progress of the batch."""
        self.progress.update(self.total, completed=self.batch.share, description=batch_words(self.batch))

    def echo(self, line: str, folded: bool = False) -> None:
        """Write a line above the bar."""
        self.progress.console.print(Text(line), soft_wrap=not folded)


class Quiet(Observer):
    """The runs that fail, each with the end of its log, and messages, which are faults."""

    def __init__(self) -> None:
        """Start without notes."""
        self.notes = Notes()

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Write that the run failed, if it did in this batch."""
        self.notes.new(result, skipped)
        if result.status == "failed" and not skipped:
            for line in (f"{job.name}: {brief(job, result, skipped)}", *log_end(job)):
                click.echo(line, err=True)

    def note(self, text: str) -> None:
        """Write a message."""
        click.echo(f"symphys: {text}", err=True)


Shown = Plain | Live | Events | Quiet


@contextmanager
def watch(runs: int, quiet: bool = False, json: bool = False) -> Iterator[Shown]:
    """Yield an observer of a batch of ``runs``; ``json``: events on stdout, ``quiet``: only failures on stderr."""
    console = Console(stderr=True)
    if json:
        yield Events()
    elif quiet:
        yield Quiet()
    elif not console.is_terminal:
        plain = Plain(runs=runs)
        with heartbeat(plain.beat, LINE_INTERVAL):
            yield plain
    else:
        text = TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
        with Progress(BarColumn(16), TimeElapsedColumn(), text, console=console, transient=True) as progress:
            live = Live(progress, runs)
            with heartbeat(live.beat, UPDATE_INTERVAL):
                yield live
