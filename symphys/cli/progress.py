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

from symphys.cli.wording import brief, labelled, number, time_words
from symphys.solvers.core.budget import BudgetUse

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow

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


class StepProgress:
    """Work whose parts are known beforehand: what is done now, the share that is done, and the time that is left."""

    def __init__(self, parts: Mapping[str, float]) -> None:
        """Nothing is done; ``parts``: by the words that announce them, in their order, about how long each takes."""
        self.parts, self.what = dict(parts), ""
        self.began = self.since = monotonic()
        self.done = 0.0

    def tell(self, what: str) -> None:
        """Say what begins; all parts before it are done. Words that announce no part are only shown."""
        self.what = what
        if what in self.parts:
            before = list(self.parts)[: list(self.parts).index(what)]
            self.done, self.since = sum(self.parts[each] for each in before), monotonic()

    @property
    def share(self) -> float:
        """Done, 0 to 1."""
        return self.done / sum(self.parts.values())

    @property
    def seconds_left(self) -> float:
        """[s] at the pace of the parts that are done; inf before the first is."""
        if not self.done:
            return math.inf
        pace = (self.since - self.began) / self.done
        later = sum(self.parts.values()) - self.done
        return max(pace * later - (monotonic() - self.since), pace * (later - self.parts.get(self.what, 0.0)))

    def __str__(self) -> str:
        """In a line."""
        left = f", about {time_words(self.seconds_left)} left" if math.isfinite(self.seconds_left) else ""
        return f"{self.what}: {percent(self.share)} done{left}"


@contextmanager
def working(name: str, parts: Mapping[str, float]) -> Iterator[Callable[[str], None]]:
    """What takes the words that announce a part of a work, see ``StepProgress``; ``name``: of the work."""
    steps, console = StepProgress(parts), Console(stderr=True)
    if not console.is_terminal:
        with heartbeat(lambda: click.echo(f"{name}: {steps}", err=True), EVERY):
            yield steps.tell
        return
    with console.status("") as status:

        def tell(what: str) -> None:
            steps.tell(what)
            show()

        def show() -> None:
            status.update(Text(str(steps)))

        with heartbeat(show, TICK):
            yield tell


class BatchProgress:
    """The runs of a batch that are in work, the share of the batch that is done, and the time that is left."""

    def __init__(self, runs: int) -> None:
        """None has begun."""
        self.runs, self.over, self.timed = runs, 0, 0
        self.began = monotonic()
        self.running: dict[str, BudgetUse] = {}
        self.judged: dict[str, StepProgress] = {}
        self.examined: set[str] = set()
        self.news: dict[str, float] = {}

    def started(self, job: Job) -> BudgetUse:
        """A run begins; its use of its budget."""
        self.news[job.name] = monotonic()
        self.examined |= {job.name} if job.examine else set()
        return self.running.setdefault(job.name, BudgetUse(job.options, job.problem.simulation.smoothing))

    def advanced(self, job: Job, row: TraceRow) -> BudgetUse:
        """A run has come to an iteration; its use of its budget."""
        use = self.started(job)
        use.add(row)
        return use

    def judging(self, job: Job, what: str) -> StepProgress:
        """A part of judging what a run has found begins."""
        from symphys.verification.examination import PARTS

        self.started(job)
        steps = self.judged.setdefault(job.name, StepProgress(PARTS))
        steps.tell(what)
        return steps

    def ended(self, job: Job, skipped: bool) -> None:
        """A run is over; what was done before takes no time."""
        for known in (self.running, self.judged, self.news):
            known.pop(job.name, None)
        self.over += 1
        self.timed += not skipped

    def quiet(self, seconds: float) -> dict[str, str]:
        """Of runs that are judged, or have brought no news for so long: what can be said of them, by their names."""
        waited = {name: monotonic() - since for name, since in self.news.items()}
        judged = {name: judging_words(steps) for name, steps in self.judged.items()}
        quiet = {name: quiet_words(self.running[name], time) for name, time in waited.items() if time >= seconds}
        return quiet | judged

    @property
    def share(self) -> float:
        """Done, 0 to 1: the runs that are over, and of those in work the share of their budget."""
        return (self.over + self._begun) / self.runs if self.runs else 1.0

    @property
    def seconds_left(self) -> float:
        """[s] at the pace so far; inf before the first run is over."""
        if not self.timed:
            return math.inf
        rest = self.runs - self.over - self._begun
        return (monotonic() - self.began) * rest / (self.timed + self._begun)

    @property
    def _begun(self) -> float:
        """The shares of the runs in work; of an examined one, solving and judging count as halves."""
        total = 0.0
        for name, use in self.running.items():
            solved = 1.0 if name in self.judged else 0.0 if math.isnan(use.share) else use.share
            steps = self.judged.get(name)
            total += solved if name not in self.examined else (solved + (steps.share if steps else 0.0)) / 2
        return total

    def __str__(self) -> str:
        """In a line."""
        text = f"{self.over} of {self.runs} runs done"
        if self.runs == 1 or self.over == self.runs:
            return text
        left = f", about {time_words(self.seconds_left)} left" if math.isfinite(self.seconds_left) else ""
        return f"{text}, {percent(self.share)} of all{left}"


def quiet_words(use: BudgetUse, seconds: float) -> str:
    """A run that has brought no news for so long."""
    if use.row is None:
        return f"building and compiling for {time_words(seconds)}"
    return f"no new iteration for {time_words(seconds)}; {at(use.row)}"


def judging_words(steps: StepProgress) -> str:
    """A run whose solver is done."""
    return f"judging what it found: {steps}"


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
        self.notes, self.batch = Notes(), BatchProgress(runs)
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
            for name, words in list(self.batch.quiet(self.every).items())[:MOST_QUIET]:
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
        return str(self.batch) if self.batch.runs > 1 else ""

    def echo(self, line: str) -> None:
        """Write a line."""
        self.last = monotonic()
        click.echo(line, err=True)


class Live:
    """A bar for the batch, a moving line for each run in work, and a line that stays for each that is over."""

    def __init__(self, progress: Progress, runs: int) -> None:
        """Start at zero."""
        self.progress = progress
        self.batch = BatchProgress(runs)
        self.whole = progress.add_task(str(self.batch), total=1.0)
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
            for name, words in self.batch.quiet(EVERY).items():
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
        self.progress.update(self.whole, completed=self.batch.share, description=str(self.batch))
