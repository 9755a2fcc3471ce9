"""A quick problem, a solver that does as it is told, and an observer that remembers: fixtures of several folders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from symphys import solvers
from symphys.errors import SymphysError
from symphys.problem import Problem, load_problem
from symphys.runs import Job, make_jobs
from symphys.solvers import Counts, Keep, Outcome, Solver, Status, TraceRow

SHORT_THROW = """
title = "A short throw"
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 0]
lower = [-10, -10, 0]
[[target]]
name = "is at half a metre"
value = "ball.position[0:2] - [0.5, 0]"
tolerance = 0.01
[[cost]]
name = "speed"
squares = "ball.velocity[0]"
weight = 1e-4
[objective]
stop = "met"
"""
"""Without contact: x = v t, so that v = (2.5, 0, .) meets the target."""
ANSWER = np.array([2.5, 0.0, 0.0])


@dataclass(frozen=True)
class ToldOptions:
    """``does``: "solve", "miss", "break", "refuse"; ``iterations``: rows of the trace."""

    does: str = "solve"
    iterations: int = 3


def told(
    problem: Any,
    start: Any,
    options: ToldOptions,
    seed: int = 0,
    monitor: Callable[[TraceRow], None] | None = None,
    checkpoint: dict[str, Any] | None = None,
    log: Callable[[str], None] | None = None,
    keep: Keep | None = None,
) -> Outcome:
    first = int(checkpoint["done"]) if checkpoint else 0
    if checkpoint:
        assert checkpoint["infinite"] == float("inf")
    if log:
        log(f"told to {options.does} from {first}")
    if options.does == "break":
        raise ZeroDivisionError("something nobody thought of")
    if options.does == "refuse":
        raise SymphysError("cannot do that")
    rows = [
        TraceRow(i, i + 1, i + 1, 0, 0, 0.1 * i, 1.0, 1.0, 2.0, float("nan"), 0.5, 0.0)
        for i in range(options.iterations)
    ]
    for row in rows[first:]:
        try:
            if monitor:
                monitor(row)
        except KeyboardInterrupt as stopped:
            seen = tuple(rows[: row.iteration + 1])
            left = {"done": row.iteration + 1, "infinite": float("inf")}
            return Outcome(
                Status.INTERRUPTED, str(stopped) or "interrupted", start, seen, Counts(rollouts=len(seen)), left
            )
    z = ANSWER if options.does == "solve" else start
    status = Status.MET if options.does == "solve" else Status.BUDGET
    return Outcome(status, "", z, tuple(rows), Counts(len(rows), len(rows)))


@pytest.fixture(autouse=True)
def told_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the solver under the name "told"."""
    monkeypatch.setitem(solvers.SOLVERS, "told", Solver("told", "does as it is told", ToldOptions, told))


@pytest.fixture
def problem_file(tmp_path: Path) -> Path:
    path = tmp_path / "short_throw.toml"
    path.write_text(SHORT_THROW, encoding="utf-8")
    return path


@pytest.fixture
def problem(problem_file: Path) -> Problem:
    return load_problem(problem_file)


@pytest.fixture
def make_job(problem: Problem, problem_file: Path, tmp_path: Path) -> Callable[..., Job]:
    """A job of the told solver, unexamined unless asked for; keywords are its options."""

    def make(seed: int = 0, examine: bool = False, **options: object) -> Job:
        settings: dict[str, object] = {f"solver.told.{key}": value for key, value in options.items()}
        told_problem = load_problem(problem_file, settings)
        (job,) = make_jobs([told_problem], ["told"], [seed], settings, tmp_path / "out", "symphys solve")
        return replace(job, examine=examine)

    return make


class Recorder:
    """An observer that remembers; ``stop_after`` rows it presses Ctrl-C."""

    def __init__(self) -> None:
        self.events: list[tuple[str, str]] = []
        self.parts: list[tuple[str, str]] = []
        self.notes: list[str] = []

    def started(self, job: Job, resumed: bool) -> None:
        self.events.append(("resumed" if resumed else "started", job.name))

    def advanced(self, job: Job, row: TraceRow) -> None:
        self.events.append(("advanced", job.name))

    def note(self, text: str) -> None:
        self.notes.append(text)

    def counted(self, event: str) -> int:
        return [each for each, _ in self.events].count(event)

    def judging(self, job: Job, what: str) -> None:
        self.parts.append((job.name, what))

    def ended(self, job: Job, result: Any, skipped: bool) -> None:
        self.events.append(("skipped" if skipped else result.status, job.name))


@pytest.fixture
def recorder() -> Iterator[Recorder]:
    yield Recorder()
