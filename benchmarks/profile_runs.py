"""Solves for performance profiles: one problem, built once, from several starts by every method that applies.

One judge for all: the rollout at smoothing 0. Every point that a method evaluates is looked at; one that it evaluates
at another smoothing counts by its value at 0, which is computed afterwards and costs the method nothing. Targets do
not stop a solve, so that a method that meets them goes on until it converges or its budget is used up.

Work is counted in rollouts, a gradient as its measured price, and in seconds of the processor. Each solve becomes one
line of a file, written at once; a line that is not whole is dropped, and what has a line is not done again.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from symphys.errors import SymphysError
from symphys.problem import Problem, require_solvable
from symphys.problem.loading import load
from symphys.runs.choice import SITUATIONS, situation
from symphys.runs.record import equivalents
from symphys.shooting import Evaluator, ShootingProblem, Values
from symphys.solvers import SOLVERS, Outcome, Status, TraceRow
from symphys.transcription import Transcription, transcribe
from symphys.transcription.transcription import fastest
from symphys.types import Array

SLOWEST = 0.05
"""[s] that a gradient may take."""
WITHOUT_END = 10**9
WALL = 10.0
"""A solve that takes so many times its seconds by the wall clock, as on a busy machine, is ended too."""


@dataclass(frozen=True)
class Budget:
    """What one solve may use: rollout equivalents, and seconds of the processor."""

    work: float = 10_000.0
    seconds: float = 4.0


@dataclass
class RecordingEvaluator:
    """Evaluates for a solver, and keeps the best point between two rows of its trace.

    Attributes:
        inner: what evaluates.
        problem: of the solve.
        rows: (row, seconds, point, merit, met) for each row; the merit is nan until a point at another smoothing is
            judged.
    """

    inner: Evaluator
    problem: ShootingProblem
    rows: list[tuple[TraceRow, float, Array | None, float, bool]] = field(default_factory=list)
    _best: tuple[bool, float, Array, float] | None = None

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.value(Z, smoothing))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.gradient(Z, smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.residuals(Z, smoothing))

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.jacobian(Z, smoothing))

    def row(self, row: TraceRow, seconds: float) -> None:
        """Take a row: what was evaluated since the one before belongs to it."""
        met, merit, z, smoothing = self._best or (False, math.inf, None, 0.0)
        self.rows.append((row, seconds, z, merit if smoothing == 0 else math.nan, met))
        self._best = None

    def _noted(self, Z: Array, smoothing: float, values: Values) -> Values:
        for z, merit, errors in zip(Z, values.merit.tolist(), values.errors, strict=True):
            met = self.problem.met(errors)
            if math.isfinite(merit) and (self._best is None or (not met, merit) < (not self._best[0], self._best[1])):
                self._best = met, merit, z.copy(), smoothing
        return values

    def judged(self, trace: Sequence[TraceRow]) -> Iterator[tuple[TraceRow, float, float, bool]]:
        """Each row with its seconds, and the exact merit of its best point and whether that meets everything.

        ``trace``: the rows as they are at the end of the solve, since a library may report its work there only.
        """
        counted = [*trace[: len(self.rows)], *trace[-1:]]
        for row, (_, seconds, z, merit, met) in zip(counted, self.rows, strict=False):
            if z is not None and math.isnan(merit):
                exact = self.inner.value(z[None], 0.0)
                merit, met = float(exact.merit[0]), self.problem.met(exact.errors[0])
            yield row, seconds, merit if math.isfinite(merit) else math.inf, met


def left_out(problem: Problem) -> str:
    """Why a problem is not in the table, as far as that is known before it is built; empty if it is."""
    try:
        require_solvable(problem)
    except SymphysError as error:
        return str(error)
    if problem.scenarios is not None:
        return "it has scenarios, of which other solvers draw samples"
    numbers = sum(variable.guess.size for variable in problem.variables)
    return f"{numbers} numbers that act all the time" if situation(problem) is SITUATIONS[-1] else ""


def methods_of(shooting: ShootingProblem) -> tuple[str, ...]:
    """The solvers that apply."""
    found = [name for name, each in SOLVERS.items() if each.scenarios is not True]
    if not shooting.squares:
        found.remove("least_squares")
    try:
        staged = shooting.staged and shooting.staged()
    except SymphysError:
        staged = None
    return tuple(name for name in found if staged or name not in ("ilqr", "multiple_shooting"))


class Cases:
    """The solves of one problem, in one file of lines."""

    def __init__(self, name: str, folder: Path, budget: Budget) -> None:
        """Nothing is built; ``name``: of a shipped problem."""
        self.name, self.file, self.budget = name, folder / f"{name}.jsonl", budget

    def run(self, instances: int, methods: tuple[str, ...] = ()) -> None:
        """Do what has no line yet: ``instances`` starts by all ``methods`` that apply (none named: every one)."""
        known = read_lines(self.file)
        if known and "left_out" in known[0]:
            return
        if known and known[0]["budget"] != asdict(self.budget):
            raise SymphysError(f"{self.file}: solved with another budget, {known[0]['budget']}: take another folder")
        try:
            problem = load(self.name)
            why = left_out(problem)
        except SymphysError as error:
            why = str(error).splitlines()[0]
        if why:
            return append(self.file, {"problem": self.name, "left_out": why})
        made = transcribe(problem, exact=not any(problem.simulation.smoothing), threads=1)
        head = known[0] if known else self.head(problem, made)
        if not known:
            append(self.file, head)
        if "left_out" in head:
            return
        done = {(line["method"], line["instance"]) for line in known[1:]}
        for instance in range(instances):
            for method in methods or head["methods"]:
                if method in head["methods"] and (method, instance) not in done:
                    append(self.file, self.solve(made, method, instance, head["price"]))

    def head(self, problem: Problem, made: Transcription) -> dict[str, Any]:
        """The first line: the problem, what a rollout takes, and what each kind of evaluation costs in rollouts."""
        shooting = made.shooting
        z, evaluator = shooting.start(0)[None], shooting.evaluator
        rollout, gradient = (
            fastest(partial(call, z, 0.0), time.process_time) for call in (evaluator.value, evaluator.gradient)
        )
        line = {
            "problem": self.name,
            "class": situation(problem).name,
            "numbers": shooting.n,
            "steps": made.rollout.steps,
        }
        if gradient > SLOWEST:
            return line | {"left_out": f"a gradient takes {gradient:.2g} s"}
        methods = methods_of(shooting)
        return line | {
            "checks": bool(problem.targets or problem.constraints or problem.goal is not None),
            "methods": methods,
            "price": made.prices(clock=time.process_time),
            "rollout": rollout,
            "budget": asdict(self.budget),
        }

    def solve(self, made: Transcription, method: str, instance: int, price: dict[str, float]) -> dict[str, Any]:
        """One solve as a line."""
        solver = SOLVERS[method]
        recorder = RecordingEvaluator(made.shooting.evaluator, made.shooting)
        problem = replace(made.shooting, evaluator=recorder, stop_when_met=False)
        warm(method, problem)
        start = problem.start(instance)
        first = recorder.inner.value(start[None], 0.0)
        began, wall = time.process_time(), time.perf_counter()

        def monitor(row: TraceRow) -> None:
            seconds = time.process_time() - began
            recorder.row(row, seconds)
            if seconds >= self.budget.seconds or equivalents(row, price) >= self.budget.work:
                raise KeyboardInterrupt("the budget is used up")

        options = unlimited(solver.Options(max_seconds=WALL * self.budget.seconds), len(problem.smoothing))
        error = ""
        try:
            outcome = solver.solve(problem, start, options, instance, monitor=monitor)
        except SymphysError as failure:
            outcome, error = Outcome(Status.FAILED, str(failure), start, (), counts_of(recorder)), str(failure)
        spent = time.process_time() - began, time.perf_counter() - wall
        if recorder.rows:
            recorder.row(recorder.rows[-1][0], spent[0])
        verdict = made.judge(outcome.z)
        return {
            "method": method,
            "instance": instance,
            "status": "budget" if outcome.status is Status.INTERRUPTED else outcome.status.value,
            "error": error,
            "start": finite(float(first.merit[0])),
            "trace": improvements(
                recorder, outcome.trace, price, (float(first.merit[0]), problem.met(first.errors[0]))
            ),
            "work": equivalents(outcome.counts, price),
            "seconds": spent[0],
            "wall": spent[1],
            "objective": finite(verdict.objective),
            "worst": finite(verdict.worst),
            "solved": verdict.solved,
        }


def counts_of(recorder: RecordingEvaluator) -> Any:
    """The work up to the last row."""
    from symphys.solvers import Counts

    if not recorder.rows:
        return Counts()
    row = recorder.rows[-1][0]
    return Counts(row.rollouts, row.gradients, row.jacobians, row.hessians)


def improvements(
    recorder: RecordingEvaluator, trace: Sequence[TraceRow], price: dict[str, float], start: tuple[float, bool]
) -> list[tuple[float, float, float, bool]]:
    """(work, seconds, lowest exact merit so far, whether anything met everything so far) where either improves."""
    lowest, any_met = start if math.isfinite(start[0]) else (math.inf, False)
    found = [(0.0, 0.0, lowest, any_met)] if math.isfinite(lowest) else []
    for row, seconds, merit, met in recorder.judged(trace):
        if merit < lowest or (met and not any_met):
            lowest, any_met = min(lowest, merit), any_met or met
            found.append((equivalents(row, price), seconds, lowest, any_met))
    return found


def warm(method: str, problem: ShootingProblem) -> None:
    """Load and compile what belongs to no single solve."""
    SOLVERS[method].prepare()
    if method in ("ilqr", "multiple_shooting") and problem.staged:
        staged = problem.staged()
        staged.linearize(staged.roll_out(problem.start(0), problem.smoothing[0]))


def unlimited(options: Any, stages: int) -> Any:
    """Without limits of iterations and evaluations, where there is one stage of smoothing: the budget is the limit."""
    if stages > 1:
        return options
    bounded = [name for name in ("iterations", "evaluations") if hasattr(options, name)]
    return replace(options, **dict.fromkeys(bounded, WITHOUT_END))


def finite(number: float) -> float | None:
    """A number that JSON has."""
    return number if math.isfinite(number) else None


def read_lines(file: Path) -> list[dict[str, Any]]:
    """The whole lines of a file; what a process that was killed left of another is cut off."""
    if not file.exists():
        return []
    text = file.read_bytes()
    whole = text[: text.rfind(b"\n") + 1]
    if whole != text:
        os.truncate(file, len(whole))
    return [json.loads(line) for line in whole.splitlines()]


def append(file: Path, line: dict[str, Any]) -> None:
    """Add a line by one write."""
    file.parent.mkdir(parents=True, exist_ok=True)
    data = json.dumps(line, allow_nan=False).encode() + b"\n"
    handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(handle, data)
    finally:
        os.close(handle)
