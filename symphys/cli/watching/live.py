"""A batch on a terminal: how far it is, the runs in work, and lines that stay for what is over."""

from __future__ import annotations

import math
from threading import RLock
from typing import TYPE_CHECKING

from rich.progress import Progress, TaskID
from rich.text import Text

from symphys.batches.progress import BatchShare
from symphys.cli.watching.heartbeat import EVERY
from symphys.cli.watching.plain import MANY, Notes
from symphys.cli.watching.words import at, batch_words, judging_words, log_end, use_words, waiting_words
from symphys.cli.wording import brief

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow


MOST_SHOWN = 16
"""Runs in work that have a line each."""


class Live:
    """A bar for the batch, a moving line for each run in work, and a line that stays for each that is over."""

    def __init__(self, progress: Progress, runs: int) -> None:
        """Start at zero."""
        self.progress = progress
        self.batch = BatchShare(runs)
        self.whole = progress.add_task(batch_words(self.batch), total=1.0)
        self.tasks: dict[str, TaskID] = {}
        self.notes = Notes()
        self.lock = RLock()
        self.many = runs >= MANY

    def started(self, job: Job, resumed: bool) -> None:
        """Open the run's line."""
        with self.lock:
            self.batch.started(job)
            shown = len(self.tasks) < MOST_SHOWN
            self.tasks[job.name] = self.progress.add_task(f"{job.name}: building", total=None, visible=shown)

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Move the run's line on."""
        with self.lock:
            use = self.batch.advanced(job, row)
            if job.name in self.tasks:
                words = "; ".join(filter(None, (use_words(use), at(row))))
                total, done = (None, None) if math.isnan(use.share) else (1.0, use.share)
                text = f"{job.name}: {words}"
                self.progress.update(self.tasks[job.name], description=text, total=total, completed=done)
            self.move()

    def judging(self, job: Job, what: str) -> None:
        """Say so."""
        with self.lock:
            words = judging_words(self.batch.judging(job, what))
            if job.name in self.tasks:
                self.progress.update(self.tasks[job.name], description=f"{job.name}: {words}")

    def beat(self) -> None:
        """Say which runs bring no news, and let the time that is left run on."""
        with self.lock:
            for name, words in waiting_words(self.batch, EVERY).items():
                if name in self.tasks:
                    self.progress.update(self.tasks[name], description=f"{name}: {words}")
            self.move()

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Close the run's line."""
        with self.lock:
            self.batch.ended(job, skipped)
            if job.name in self.tasks:
                self.progress.remove_task(self.tasks.pop(job.name))
            self.batch.found(job, result)
            failed = result.status == "failed" and not skipped
            if failed or not self.many:
                self.progress.console.print(Text(f"{job.name}: {brief(job, result, skipped)}"))
            for line in (*(log_end(job) if failed else ()), *self.notes.new(result, skipped)):
                self.progress.console.print(Text(line), soft_wrap=True)
            self.move()

    def note(self, text: str) -> None:
        """Say it."""
        with self.lock:
            self.progress.console.print(Text(f"symphys: {text}"), soft_wrap=True)

    def move(self) -> None:
        """Show where the batch is."""
        self.progress.update(self.whole, completed=self.batch.share, description=batch_words(self.batch))
