"""A batch as events for other programs: one JSON object a line, on stdout.

| event | with |
|---|---|
| began | run, folder, problem, solver, seed, settings, resumed |
| advanced | run, iteration, objective, worst, seconds; at most one a second for each run |
| judging | run, what |
| ended | run, folder, skipped, status, verdict, solved, objective, worst, iterations, seconds, advice |
| note | text |
| finished | runs, accepted, failed, interrupted, spent, exit_code |
"""

from __future__ import annotations

import json
from time import monotonic
from typing import TYPE_CHECKING, Any

import click

from symphys import files
from symphys.batches import Observer
from symphys.cli.watching.progress import Notes

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow

REPORT_INTERVAL = 1.0
"""[s] between two iterations of a run that are reported."""


class Events(Observer):
    """An observer that writes each event as a line of JSON on stdout."""

    def __init__(self) -> None:
        """Start without events."""
        self.notes = Notes()
        self.reported: dict[str, float] = {}

    def tell(self, event: str, **fields: Any) -> None:
        """Write an event."""
        line = json.dumps(files.strict({"event": event, **fields}), allow_nan=False)
        click.echo(files.printable(line))

    def started(self, job: Job, resumed: bool) -> None:
        """Write that a run starts or resumes."""
        asked = job.config
        self.tell(
            "began",
            run=job.name,
            folder=str(job.folder.path),
            problem=asked.problem,
            solver=asked.solver,
            seed=asked.seed,
            settings=asked.settings,
            resumed=resumed,
        )

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Write an iteration, at most one in EVERY seconds for each run."""
        now = monotonic()
        if now - self.reported.get(job.name, -REPORT_INTERVAL) < REPORT_INTERVAL:
            return
        self.reported[job.name] = now
        numbers = {"objective": row.best, "worst": row.max_violation, "seconds": row.seconds}
        self.tell("advanced", run=job.name, iteration=row.iteration, **numbers)

    def judging(self, job: Job, what: str) -> None:
        """Write that a part of judging begins."""
        self.tell("judging", run=job.name, what=what)

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Write how a run ended."""
        self.notes.new(result, skipped)
        self.reported.pop(job.name, None)
        named = ("status", "verdict", "solved", "objective", "iterations", "seconds", "advice")
        found = {name: getattr(result, name) for name in named}
        self.tell(
            "ended", run=job.name, folder=str(job.folder.path), skipped=skipped, worst=result.worst_ratio, **found
        )

    def note(self, text: str) -> None:
        """Write a message."""
        self.tell("note", text=text)

    def finished(self, batch: BatchResult, code: int) -> None:
        """Write the end of the batch."""
        known = [result for result in batch.results if result]
        self.tell(
            "finished",
            runs=len(batch.results),
            accepted=sum(result.accepted for result in known),
            failed=sum(result.status == "failed" for result in known),
            interrupted=batch.interrupted,
            spent=batch.spent,
            exit_code=code,
        )
