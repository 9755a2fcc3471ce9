"""What is shown while work goes on, on stderr: live lines on a terminal, plain ones every few seconds elsewhere.

A share done and a time left go with them: of a run from its budget, of a batch from the runs that are over, of other
work from the parts that it is known to have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, RLock, Thread
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Column
from rich.text import Text

from symphys.batches.progress import BatchShare, StepProgress
from symphys.cli.wording import brief, labelled, number, time_words

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow
    from symphys.solvers.core.budget import BudgetUse

EVERY = 5.0
"""[s] between plain lines while work goes on."""
TICK = 1.0
"""[s] between two looks at the clock of a live line."""
MOST_QUIET = 3
"""How many runs without news are named at once."""


def at(row: TraceRow) -> str:
    """Where a run is; the smoothing only where there is some, as its numbers are not the exact ones then."""
    smoothed = f" at smoothing {row.smoothing:g}" if row.smoothing > 0 else ""
    outputs = "".join(f", {labelled(name, value)}" for name, value in row.outputs.items())
    return (
        f"iteration {row.iteration}, objective {number(row.best)}, worst {number(row.max_violation)}{outputs}{smoothed}"
    )


def percent(share: float) -> str:
    """Of what is to be done; rounded down, so that nothing is called done that is not."""
    return f"{math.floor(100 * share + 1e-9)} %"


def use_words(use: BudgetUse) -> str:
    """The share of its budget that a run has used, and the time that solving takes at most; empty without a bound.

    The judging of its result is no part of it.
    """
    left = f"at most {time_words(use.seconds_left)} of solving left" if math.isfinite(use.seconds_left) else ""
    share = "" if math.isnan(use.share) else f"{percent(use.share)} of its budget"
    return ", ".join(filter(None, (share, left)))


@contextmanager
def heartbeat(beat: Callable[[], None], every: float) -> Iterator[None]:
    """Call ``beat`` every so many seconds from a thread of its own, while the body runs."""
    over = Event()

    def run() -> None:
        while not over.wait(every):
            beat()

    thread = Thread(target=run, name="symphys-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextmanager
def watch(runs: int) -> Iterator[Plain | Live]:
    """An observer of a batch of so many runs."""
    console = Console(stderr=True)
    if not console.is_terminal:
        plain = Plain(runs=runs)
        with heartbeat(plain.beat, EVERY):
            yield plain
        return
    text = TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
    with Progress(BarColumn(16), TimeElapsedColumn(), text, console=console, transient=True) as progress:
        live = Live(progress, runs)
        with heartbeat(live.beat, TICK):
            yield live


def step_words(steps: StepProgress) -> str:
    """What is done now, the share that is done, and about how long the rest takes."""
    left = f", about {time_words(steps.seconds_left)} left" if math.isfinite(steps.seconds_left) else ""
    return f"{steps.what}: {percent(steps.share)} done{left}"


@contextmanager
def working(name: str, parts: Mapping[str, float]) -> Iterator[Callable[[str], None]]:
    """What takes the words that announce a part of a work, see ``StepProgress``; ``name``: of the work."""
    steps, console = StepProgress(parts), Console(stderr=True)
    if not console.is_terminal:
        with heartbeat(lambda: click.echo(f"{name}: {step_words(steps)}", err=True), EVERY):
            yield steps.tell
        return
    with console.status("") as status:

        def tell(what: str) -> None:
            steps.tell(what)
            show()

        def show() -> None:
            status.update(Text(step_words(steps)))

        with heartbeat(show, TICK):
            yield tell


def batch_words(batch: BatchShare) -> str:
    """How many runs are done; of several the share, and about how long the rest takes."""
    text = f"{batch.over} of {batch.runs} runs done"
    if batch.runs == 1 or batch.over == batch.runs:
        return text
    left = f", about {time_words(batch.seconds_left)} left" if math.isfinite(batch.seconds_left) else ""
    return f"{text}, {percent(batch.share)} of all{left}"


def waiting_words(batch: BatchShare, seconds: float) -> dict[str, str]:
    """Of the runs that are judged, or have brought no news for so long: what is said of them, by their names."""
    quiet = {name: quiet_words(batch.running[name], time) for name, time in batch.quiet(seconds).items()}
    return quiet | {name: judging_words(steps) for name, steps in batch.judged.items()}


def quiet_words(use: BudgetUse, seconds: float) -> str:
    """A run that has brought no news for so long."""
    if use.row is None:
        return f"building and compiling for {time_words(seconds)}"
    return f"no new iteration for {time_words(seconds)}; {at(use.row)}"


def judging_words(steps: StepProgress) -> str:
    """A run whose solver is done."""
    return f"judging what it found: {step_words(steps)}"


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
        self.every, self.last = every, monotonic()
        self.lock = RLock()

    def started(self, job: Job, resumed: bool) -> None:
        """Say so."""
        with self.lock:
            self.batch.started(job)
            self.echo(f"{job.name}: {'goes on' if resumed else 'begins'}")

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Say where it is, now and then."""
        with self.lock:
            use = self.batch.advanced(job, row)
            if monotonic() - self.last >= self.every:
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
            self.echo(f"{job.name}: {brief(job, result, skipped)}")
            for note in self.notes.new(result, skipped):
                self.echo(note)

    def whole(self) -> str:
        """Where the batch is, if it is one."""
        return batch_words(self.batch) if self.batch.runs > 1 else ""

    def echo(self, line: str) -> None:
        """Write a line."""
        self.last = monotonic()
        click.echo(line, err=True)


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

    def started(self, job: Job, resumed: bool) -> None:
        """Open the run's line."""
        with self.lock:
            self.batch.started(job)
            self.tasks[job.name] = self.progress.add_task(f"{job.name}: building", total=None)

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
            self.progress.console.print(Text(f"{job.name}: {brief(job, result, skipped)}"))
            for note in self.notes.new(result, skipped):
                self.progress.console.print(Text(note), soft_wrap=True)
            self.move()

    def move(self) -> None:
        """Show where the batch is."""
        self.progress.update(self.whole, completed=self.batch.share, description=batch_words(self.batch))
