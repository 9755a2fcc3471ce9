"""A batch of which only failures are shown, on stderr."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from symphys.cli.watching.plain import Notes
from symphys.cli.watching.words import log_end
from symphys.cli.wording import brief

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow


class Quiet:
    """Says which run has failed, with the end of its log."""

    def __init__(self) -> None:
        """Nothing has failed."""
        self.notes = Notes()

    def started(self, job: Job, resumed: bool) -> None:
        """Nothing is said of it."""

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Nothing is said of it."""

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Say that it failed, if it did now."""
        self.notes.new(result, skipped)
        if result.status == "failed" and not skipped:
            for line in (f"{job.name}: {brief(job, result, skipped)}", *log_end(job)):
                click.echo(line, err=True)

    def note(self, text: str) -> None:
        """Say it: what is noted are faults."""
        click.echo(f"symphys: {text}", err=True)
