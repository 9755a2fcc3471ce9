"""What is shown while runs go on, on stderr: live lines on a terminal, one plain line per event elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.text import Text

from symphys.cli.wording import brief, labelled, number

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow


def at(row: TraceRow) -> str:
    """Where a run is; the smoothing only where there is some, as its numbers are not the exact ones then."""
    smoothed = f" at smoothing {row.smoothing:g}" if row.smoothing > 0 else ""
    outputs = "".join(f", {labelled(name, value)}" for name, value in row.outputs.items())
    return (
        f"iteration {row.iteration}, objective {number(row.best)}, worst {number(row.max_violation)}{outputs}{smoothed}"
    )


@contextmanager
def watch(runs: int) -> Iterator[Plain | Live]:
    """An observer of a batch of so many runs."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Plain()
        return
    columns = (BarColumn(16), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=console, transient=True) as progress:
        yield Live(progress, runs)


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

    def __init__(self, every: float = 5.0) -> None:
        """Nothing is shown yet; ``every``: seconds between lines while a run goes on."""
        self.notes = Notes()
        self.every, self.last = every, monotonic()

    def started(self, job: Job, resumed: bool) -> None:
        """Say so."""
        click.echo(f"{job.name}: {'goes on' if resumed else 'begins'}", err=True)

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Say where it is, now and then."""
        if monotonic() - self.last >= self.every:
            self.last = monotonic()
            click.echo(f"{job.name}: {at(row)}", err=True)

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Say how."""
        click.echo(f"{job.name}: {brief(job, result, skipped)}", err=True)
        for note in self.notes.new(result, skipped):
            click.echo(note, err=True)


class Live:
    """A bar for the batch, a moving line for each run in work, and a line that stays for each that is over."""

    def __init__(self, progress: Progress, runs: int) -> None:
        """Start at zero."""
        self.progress = progress
        self.runs, self.over = runs, 0
        self.whole = progress.add_task(f"0 of {runs} runs done", total=runs)
        self.tasks: dict[str, TaskID] = {}
        self.notes = Notes()

    def started(self, job: Job, resumed: bool) -> None:
        """Open the run's line."""
        self.tasks[job.name] = self.progress.add_task(f"{job.name}: building", total=None)

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Move the run's line on."""
        if job.name in self.tasks:
            self.progress.update(self.tasks[job.name], description=f"{job.name}: {at(row)}")

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Close the run's line."""
        if job.name in self.tasks:
            self.progress.remove_task(self.tasks.pop(job.name))
        self.progress.console.print(Text(f"{job.name}: {brief(job, result, skipped)}"))
        for note in self.notes.new(result, skipped):
            self.progress.console.print(Text(note), soft_wrap=True)
        self.over += 1
        self.progress.update(self.whole, completed=self.over, description=f"{self.over} of {self.runs} runs done")
