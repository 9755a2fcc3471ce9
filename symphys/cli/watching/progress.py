"""The share of work that is done, and the time left: of a batch of runs, and of work in known parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from time import monotonic

from symphys.results.result import Result
from symphys.runs.job import Job
from symphys.solvers import TraceRow
from symphys.solvers.core.budget import BudgetUse
from symphys.verification.examination import PARTS


class StepProgress:
    """The progress of work whose parts are known beforehand, with the time that is left."""

    def __init__(self, parts: Mapping[str, float]) -> None:
        """Start with nothing done; ``parts``: by the words that announce them, in order, the relative time of each."""
        self.parts, self.what = dict(parts), ""
        self.began = self.since = monotonic()
        self.done = 0.0

    def tell(self, what: str) -> None:
        """Announce a part; all parts before it are done. Other words are only shown."""
        self.what = what
        if what in self.parts:
            before = list(self.parts)[: list(self.parts).index(what)]
            self.done, self.since = sum(self.parts[each] for each in before), monotonic()

    @property
    def share(self) -> float:
        """The share that is done, 0 to 1."""
        return self.done / sum(self.parts.values())

    @property
    def seconds_left(self) -> float:
        """The time left [s] at the pace of the finished parts; inf before the first is done."""
        if not self.done:
            return math.inf
        pace = (self.since - self.began) / self.done
        later = sum(self.parts.values()) - self.done
        return max(pace * later - (monotonic() - self.since), pace * (later - self.parts.get(self.what, 0.0)))


class BatchShare:
    """The progress of a batch: its runs in work, the share that is done, and the time that is left."""

    def __init__(self, runs: int) -> None:
        """Start with no run begun."""
        self.runs, self.over, self.timed, self.failed = runs, 0, 0, 0
        self.problems: set[str] = set()
        self.best: tuple[float, str] | None = None
        self.began = monotonic()
        self.running: dict[str, BudgetUse] = {}
        self.judged: dict[str, StepProgress] = {}
        self.examined: set[str] = set()
        self.news: dict[str, float] = {}

    def started(self, job: Job) -> BudgetUse:
        """Record that a run starts; return its use of its budget."""
        self.news[job.name] = monotonic()
        self.examined |= {job.name} if job.examine else set()
        return self.running.setdefault(job.name, BudgetUse(job.options, job.problem.simulation.smoothing))

    def advanced(self, job: Job, row: TraceRow) -> BudgetUse:
        """Record an iteration of a run; return its use of its budget."""
        use = self.started(job)
        use.add(row)
        return use

    def judging(self, job: Job, what: str) -> StepProgress:
        """Record that a part of judging begins; return the progress of judging."""
        self.started(job)
        steps = self.judged.setdefault(job.name, StepProgress(PARTS))
        steps.tell(what)
        return steps

    def found(self, job: Job, result: Result) -> None:
        """Record the result of a run."""
        self.failed += result.status == "failed"
        self.problems.add(result.problem)
        if result.accepted and (self.best is None or result.objective < self.best[0]):
            self.best = (result.objective, job.name)

    def ended(self, job: Job, skipped: bool) -> None:
        """Record that a run is over; runs that were done before take no time."""
        for known in (self.running, self.judged, self.news):
            known.pop(job.name, None)
        self.over += 1
        self.timed += not skipped

    def quiet(self, seconds: float) -> dict[str, float]:
        """Return the time [s] since the last news of each run, by name, where it is at least ``seconds``."""
        waited = {name: monotonic() - since for name, since in self.news.items()}
        return {name: time for name, time in waited.items() if time >= seconds}

    @property
    def share(self) -> float:
        """The share that is done, 0 to 1: finished runs, and of those in work the share of their budget."""
        return (self.over + self._begun) / self.runs if self.runs else 1.0

    @property
    def seconds_left(self) -> float:
        """The time left [s] at the pace so far; inf before the first run is over."""
        if not self.timed:
            return math.inf
        rest = self.runs - self.over - self._begun
        return (monotonic() - self.began) * rest / (self.timed + self._begun)

    @property
    def _begun(self) -> float:
        """The sum of the shares of runs in work; solving and judging of an examined run count as halves."""
        total = 0.0
        for name, use in self.running.items():
            solved = 1.0 if name in self.judged else 0.0 if math.isnan(use.share) else use.share
            steps = self.judged.get(name)
            total += solved if name not in self.examined else (solved + (steps.share if steps else 0.0)) / 2
        return total


class Notes:
    """Notes of backends, each once, and the seconds of the runs of this batch.

    Attributes:
        seconds: total of "build", "compile", "solve" and "judge"; runs that share a problem share its first two.
    """

    def __init__(self) -> None:
        """Start with no note shown."""
        self.shown: set[str] = set()
        self.seconds: dict[str, float] = {"build": 0.0, "compile": 0.0, "solve": 0.0, "judge": 0.0}
        self.made: set[tuple[str, float]] = set()

    def new(self, result: Result, skipped: bool) -> list[str]:
        """Return the lines to print; none for a run that was done before."""
        if not skipped:
            self.add(result)
        note = "" if skipped else result.backend.note
        if not note or note in self.shown:
            return []
        self.shown.add(note)
        return [f"symphys: {note}"]

    def add(self, result: Result) -> None:
        """Add the seconds of a run."""
        built = (result.problem, result.seconds.get("build", 0.0))
        for key in ("solve", "judge") if built in self.made else self.seconds:
            self.seconds[key] += result.seconds.get(key, 0.0)
        self.made.add(built)
