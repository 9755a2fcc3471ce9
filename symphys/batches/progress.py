"""How far work is, and how long the rest of it takes: a batch of runs, and work whose parts are known beforehand."""

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


class BatchShare:
    """The runs of a batch that are in work, the share of the batch that is done, and the time that is left."""

    def __init__(self, runs: int) -> None:
        """None has begun."""
        self.runs, self.over, self.timed, self.failed = runs, 0, 0, 0
        self.problems: set[str] = set()
        self.best: tuple[float, str] | None = None
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
        self.started(job)
        steps = self.judged.setdefault(job.name, StepProgress(PARTS))
        steps.tell(what)
        return steps

    def found(self, job: Job, result: Result) -> None:
        """What a run has come to."""
        self.failed += result.status == "failed"
        self.problems.add(result.problem)
        if result.accepted and (self.best is None or result.objective < self.best[0]):
            self.best = (result.objective, job.name)

    def ended(self, job: Job, skipped: bool) -> None:
        """A run is over; what was done before takes no time."""
        for known in (self.running, self.judged, self.news):
            known.pop(job.name, None)
        self.over += 1
        self.timed += not skipped

    def quiet(self, seconds: float) -> dict[str, float]:
        """How long [s] runs have brought no news, by their names; of those that have not for so long."""
        waited = {name: monotonic() - since for name, since in self.news.items()}
        return {name: time for name, time in waited.items() if time >= seconds}

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
