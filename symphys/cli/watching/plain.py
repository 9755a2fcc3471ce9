"""A batch in plain lines on stderr, for outputs that are no terminal."""

from __future__ import annotations

from threading import RLock
from time import monotonic
from typing import TYPE_CHECKING

import click

from symphys.batches.progress import BatchShare
from symphys.cli.watching.heartbeat import EVERY
from symphys.cli.watching.words import at, batch_words, log_end, use_words, waiting_words
from symphys.cli.wording import brief

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow

MOST_QUIET = 3
"""How many runs without news are named at once."""
MANY = 100
"""Of so many runs and more, only those that fail have lines of their own."""


class Notes:
    """Notes of backends, each once, and the seconds of the runs that were not done before.

    Attributes:
        seconds: what "build", "compile" and "solve" took in all; runs that share a problem share its first two.
    """

    def __init__(self) -> None:
        """None is shown yet."""
        self.shown: set[str] = set()
        self.seconds: dict[str, float] = {"build": 0.0, "compile": 0.0, "solve": 0.0}
        self.made: set[tuple[str, float]] = set()

    def new(self, result: Result, skipped: bool) -> list[str]:
        """The lines to print; none for a run that was done before."""
        if not skipped:
            self.add(result)
        note = "" if skipped else result.backend.note
        if not note or note in self.shown:
            return []
        self.shown.add(note)
        return [f"symphys: {note}"]

    def add(self, result: Result) -> None:
        """Count the seconds of a run."""
        built = (result.problem, result.seconds.get("build", 0.0))
        for key in ("solve",) if built in self.made else self.seconds:
            self.seconds[key] += result.seconds.get(key, 0.0)
        self.made.add(built)


class Plain:
    """One line when a run begins, one when it ends, and some while it goes on; nothing is redrawn."""

    def __init__(self, every: float = EVERY, runs: int = 1) -> None:
        """Nothing is shown yet; ``every``: seconds between lines while runs go on."""
        self.notes, self.batch = Notes(), BatchShare(runs)
        self.many = runs >= MANY
        self.every, self.last = every, monotonic()
        self.lock = RLock()

    def started(self, job: Job, resumed: bool) -> None:
        """Say so."""
        with self.lock:
            self.batch.started(job)
            if not self.many:
                self.echo(f"{job.name}: {'goes on' if resumed else 'begins'}")

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Say where it is, now and then."""
        with self.lock:
            use = self.batch.advanced(job, row)
            if self.many and monotonic() - self.last >= self.every:
                self.echo(self.whole())
            elif monotonic() - self.last >= self.every:
                self.echo("; ".join(filter(None, (f"{job.name}: {at(row)}", use_words(use), self.whole()))))

    def judging(self, job: Job, what: str) -> None:
        """Keep it for the next line."""
        with self.lock:
            self.batch.judging(job, what)
            self.beat()

    def beat(self) -> None:
        """Say that work goes on where nothing else was said for a while."""
        with self.lock:
            if monotonic() - self.last < self.every:
                return
            for name, words in list(waiting_words(self.batch, self.every).items())[:MOST_QUIET]:
                self.echo(f"{name}: {words}")

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Say how."""
        with self.lock:
            self.batch.ended(job, skipped)
            self.batch.found(job, result)
            failed = result.status == "failed" and not skipped
            if failed or not self.many:
                self.echo(f"{job.name}: {brief(job, result, skipped)}")
            for line in (*(log_end(job) if failed else ()), *self.notes.new(result, skipped)):
                self.echo(line)
            if self.many and monotonic() - self.last >= self.every:
                self.echo(self.whole())

    def note(self, text: str) -> None:
        """Say it."""
        with self.lock:
            self.echo(f"symphys: {text}")

    def whole(self) -> str:
        """Where the batch is, if it is one."""
        return batch_words(self.batch) if self.batch.runs > 1 else ""

    def echo(self, line: str) -> None:
        """Write a line."""
        self.last = monotonic()
        click.echo(line, err=True)
