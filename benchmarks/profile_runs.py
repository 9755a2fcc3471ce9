"""Solves for performance profiles, and the statistics of recorded solves.

One problem is built once and solved from several starts by every method that applies.

One judge for all: the rollout at smoothing 0. Every point that a method evaluates is looked at; one that it evaluates
at another smoothing counts by its value at 0, which is computed afterwards and costs the method nothing. Targets do
not stop a solve, so that a method that meets them goes on until it converges or its budget is used up.

Work is counted in rollouts, a gradient as its measured price, and in seconds of the processor. Each solve becomes one
line of a file, written at once; a line that is not whole is dropped, and what has a line is not done again.

A solve has converged at tolerance tau where its exact merit is at most f_L + tau (f_0 - f_L): f_0 is that of its start
and f_L the lowest that any solve of the problem has found (Moré and Wild, SIAM J. Optim. 20, 2009, eq. 2.2; they take
the lowest from the same start). A data profile is the share of solves that have converged within a budget. Budgets are
in rollouts here, not in simplex gradients, and in seconds.

The expected running time is the sum of what all solves took, up to their success or their end, over the number of
successes (Hansen et al., COCO, Optimization Methods and Software 36, 2021). Success: everything is met; of a problem
that asks for nothing to be met, convergence at 1e-3.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.problem import Problem, require_solvable
from symphys.problem.problem import load
from symphys.runs.choice import SITUATIONS, situation
from symphys.runs.record import equivalents
from symphys.shooting import Evaluator, ShootingProblem, Values
from symphys.solvers import SOLVERS, Counts, Outcome, Status, TraceRow
from symphys.transcription import Transcription, transcribe
from symphys.transcription.transcription import fastest
from symphys.types import Array

SLOWEST = 0.05
"""Most seconds of a gradient."""
WITHOUT_END = 10**9
WALL = 10.0
"""A solve that takes so many times its seconds by the wall clock, as on a busy machine, is ended too."""


@dataclass(frozen=True)
class Budget:
    """Budget of one solve: rollout equivalents, and seconds of the processor."""

    work: float = 10_000.0
    seconds: float = 4.0


@dataclass
class RecordingEvaluator:
    """Evaluates for a solver, and keeps the best point between two rows of its trace.

    Attributes:
        inner: the evaluator.
        problem: of the solve.
        rows: (row, seconds, point, merit, met) for each row; the merit is nan until a point at another smoothing is
            judged.
    """

    inner: Evaluator
    problem: ShootingProblem
    rows: list[tuple[TraceRow, float, Array | None, float, bool]] = field(default_factory=list)
    _best: tuple[bool, float, Array, float] | None = None

    def value(self, Z: Array, smoothing: float) -> Values:
        """Evaluate and note; see ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.value(Z, smoothing))

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Evaluate and note; see ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.gradient(Z, smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Evaluate and note; see ``Evaluator``."""
        return self._noted(Z, smoothing, self.inner.residuals(Z, smoothing))

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Evaluate and note; see ``Evaluator``."""
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
        """Yield each row with its seconds, the exact merit of its best point and whether that meets everything.

        ``trace``: the rows as they are at the end of the solve, since a library may report its work there only.
        """
        counted = [*trace[: len(self.rows)], *trace[-1:]]
        for row, (_, seconds, z, merit, met) in zip(counted, self.rows, strict=False):
            if z is not None and math.isnan(merit):
                exact = self.inner.value(z[None], 0.0)
                merit, met = float(exact.merit[0]), self.problem.met(exact.errors[0])
            yield row, seconds, merit if math.isfinite(merit) else math.inf, met


def left_out(problem: Problem) -> str:
    """Return why a problem is not in the table, as far as that is known before it is built; empty if it is."""
    try:
        require_solvable(problem)
    except SymphysError as error:
        return str(error)
    if problem.scenarios is not None:
        return "it has scenarios, of which other solvers draw samples"
    numbers = sum(variable.guess.size for variable in problem.variables)
    return f"{numbers} numbers that act all the time" if situation(problem) is SITUATIONS[-1] else ""


def methods_of(shooting: ShootingProblem) -> tuple[str, ...]:
    """Return the solvers that apply."""
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
        """Name a shipped problem; nothing is built."""
        self.name, self.file, self.budget = name, folder / f"{name}.jsonl", budget

    def run(self, instances: int, methods: tuple[str, ...] = ()) -> None:
        """Do what has no line yet: ``instances`` starts by those of ``methods`` that apply (none named: all)."""
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
        """Return the first line: the problem, and what each kind of evaluation costs in rollouts."""
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
        """Solve once; returns the line."""
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
    """Return the work up to the last row."""
    if not recorder.rows:
        return Counts()
    row = recorder.rows[-1][0]
    return Counts(row.rollouts, row.gradients, row.jacobians, row.hessians)


def improvements(
    recorder: RecordingEvaluator, trace: Sequence[TraceRow], price: dict[str, float], start: tuple[float, bool]
) -> list[tuple[float, float, float, bool]]:
    """Return (work, seconds, lowest exact merit, whether anything met everything) where one of them improves."""
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
    """Return options without limits of iterations and evaluations if there is one stage: the budget is the limit."""
    if stages > 1:
        return options
    bounded = [name for name in ("iterations", "evaluations") if hasattr(options, name)]
    return replace(options, **dict.fromkeys(bounded, WITHOUT_END))


def finite(number: float) -> float | None:
    """Return a number that JSON has."""
    return number if math.isfinite(number) else None


def read_lines(file: Path) -> list[dict[str, Any]]:
    """Return the whole lines of a file; what a process that was killed left of another is cut off."""
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


Axis = Literal["work", "seconds"]

TOLERANCES = (1e-1, 1e-3, 1e-5)
SUCCESS = 1e-3
"""The tolerance that is success where nothing is to be met."""
AXES: tuple[Axis, ...] = ("work", "seconds")
WORST = 1e3
"""Ratio of running times that counts as no success."""
ABOUT = 0.05
"""Difference of shares of convergence below which two methods are as sure as each other."""
NEVER = "-"


@dataclass(frozen=True)
class RecordedSolve:
    """One recorded solve.

    Attributes:
        problem, method, instance: which.
        group: the class of the problem.
        checks: whether the problem asks for something to be met.
        start: merit of its start.
        trace: (k, 4) work, seconds, lowest merit so far, 1 where everything was met; within the budget.
        ends: work and seconds at its end, the budget at most.
    """

    problem: str
    group: str
    method: str
    instance: int
    checks: bool
    start: float
    trace: Array
    ends: dict[Axis, float]

    @property
    def lowest(self) -> float:
        """Return its lowest merit; inf without any."""
        return float(self.trace[:, 2].min(initial=math.inf))

    def reached(self, merit: float, axis: Axis) -> float:
        """Return work or seconds until a merit; inf if never."""
        return self._first(self.trace[:, 2] <= merit, axis)

    def met(self, axis: Axis) -> float:
        """Return work or seconds until everything was met; inf if never."""
        return self._first(self.trace[:, 3] > 0, axis)

    def _first(self, holds: NDArray[np.bool_], axis: Axis) -> float:
        return float(self.trace[holds.argmax(), AXES.index(axis)]) if holds.any() else math.inf


@dataclass(frozen=True)
class Profiles:
    """All solves of a folder, why problems were left out, and the budget."""

    solves: tuple[RecordedSolve, ...]
    left_out: dict[str, str]
    budget: Budget

    @property
    def problems(self) -> tuple[str, ...]:
        """Return the problems with solves, by class."""
        return tuple(dict.fromkeys(each.problem for each in sorted(self.solves, key=lambda s: (s.group, s.problem))))

    @property
    def methods(self) -> tuple[str, ...]:
        """Return the methods in the order in which they were recorded."""
        return tuple(dict.fromkeys(each.method for each in self.solves))

    @property
    def groups(self) -> tuple[str, ...]:
        """Return the classes of problems."""
        return tuple(sorted({each.group for each in self.solves}))

    def of(self, problem: str, method: str = "") -> list[RecordedSolve]:
        """Return the solves of a problem, by one method or by all."""
        return [each for each in self.solves if each.problem == problem and method in ("", each.method)]

    def group(self, problem: str) -> str:
        """Return the class of a problem."""
        return self.of(problem)[0].group


def read(folder: Path) -> Profiles:
    """Read what a folder holds; ValueError where there is nothing."""
    solves: list[RecordedSolve] = []
    left: dict[str, str] = {}
    budget = None
    for file in sorted(folder.glob("*.jsonl")):
        head, *lines = read_lines(file) or [{}]
        if "left_out" in head:
            left[head["problem"]] = head["left_out"]
        elif head:
            budget = Budget(**head["budget"])
            solves += [solve_of(head, line, budget) for line in lines]
    if budget is None:
        raise ValueError(f"{folder} holds no solves")
    order = {name: k for k, name in enumerate(dict.fromkeys(each.method for each in solves))}
    return Profiles(tuple(sorted(solves, key=lambda s: (s.problem, s.instance, order[s.method]))), left, budget)


def solve_of(head: dict[str, Any], line: dict[str, Any], budget: Budget) -> RecordedSolve:
    """Return the solve of a line, cut at its budget."""
    trace = np.array(line["trace"], float).reshape(-1, 4)
    trace = trace[(trace[:, 0] <= budget.work) & (trace[:, 1] <= budget.seconds)]
    ends: dict[Axis, float] = {
        "work": min(line["work"], budget.work),
        "seconds": min(line["seconds"], budget.seconds),
    }
    start = math.nan if line["start"] is None else line["start"]
    return RecordedSolve(
        head["problem"], head["class"], line["method"], line["instance"], head["checks"], start, trace, ends
    )


def targets(recorded: Profiles, tolerance: float) -> dict[tuple[str, int], float]:
    """Return the merit at which a solve has converged, by problem and instance.

    Where a start is not finite, f_0 is the largest merit that any method has first found from it.
    """
    found = {}
    for problem in recorded.problems:
        solves = recorded.of(problem)
        lowest = min(each.lowest for each in solves)
        for instance in {each.instance for each in solves}:
            same = [each for each in solves if each.instance == instance]
            first = same[0].start
            if not math.isfinite(first):
                first = max((float(each.trace[0, 2]) for each in same if len(each.trace)), default=lowest)
            found[problem, instance] = lowest + tolerance * (first - lowest)
    return found


def costs(recorded: Profiles, tolerance: float, axis: Axis, problems: Iterable[str] = ()) -> dict[str, Array]:
    """Return by method what each (problem, instance) took to converge, ascending; inf where it did not.

    A method that does not apply to a problem counts as one that does not converge. ``problems``: none: all.
    """
    merits = targets(recorded, tolerance)
    wanted = set(problems) or set(recorded.problems)
    cases = [case for case in merits if case[0] in wanted]
    found = {(each.problem, each.instance, each.method): each for each in recorded.solves}
    profiles = {}
    for method in recorded.methods:
        ends = [
            found[*case, method].reached(merits[case], axis) if (*case, method) in found else math.inf for case in cases
        ]
        profiles[method] = np.sort(np.array(ends))
    return profiles


def running_time(solves: Sequence[RecordedSolve], merits: dict[tuple[str, int], float], axis: Axis) -> float:
    """Return the expected running time of the solves of one problem by one method; inf without a success."""
    times = [
        each.met(axis) if each.checks else each.reached(merits[each.problem, each.instance], axis) for each in solves
    ]
    successes = sum(math.isfinite(time) for time in times)
    total = sum(time if math.isfinite(time) else each.ends[axis] for time, each in zip(times, solves, strict=True))
    return total / successes if successes else math.inf


def running_times(recorded: Profiles, axis: Axis) -> dict[str, dict[str, float]]:
    """Return expected running times by problem and method."""
    merits = targets(recorded, SUCCESS)
    return {
        problem: {m: running_time(recorded.of(problem, m), merits, axis) for m in recorded.methods}
        for problem in recorded.problems
    }


def ratios(times: dict[str, dict[str, float]], problems: Iterable[str]) -> dict[str, float]:
    """Return by method the geometric mean over problems of its expected running time over that of the best method.

    A ratio counts as ``WORST`` at most, and so does that of a method that never succeeds; problems that no method
    solves are left out.
    """
    rows = [times[problem] for problem in problems if math.isfinite(min(times[problem].values()))]
    if not rows:
        return {}
    logs = {m: [math.log(min(row[m] / min(row.values()), WORST)) for row in rows] for m in rows[0]}
    return {method: math.exp(fmean(each)) for method, each in logs.items()}


def shares(recorded: Profiles, group: str, method: str) -> dict[str, float | None]:
    """Return the shares of the solves of a class that converge at each tolerance, and that meet everything."""
    problems = [each for each in recorded.problems if recorded.group(each) == group]
    found: dict[str, float | None] = {}
    for tolerance in TOLERANCES:
        found[f"{tolerance:g}"] = float(np.isfinite(costs(recorded, tolerance, "work", problems)[method]).mean())
    checked = [each for problem in problems for each in recorded.of(problem, method) if each.checks]
    met = sum(math.isfinite(each.met("work")) for each in checked)
    return found | {"met": met / len(checked) if checked else None}


def advice(recorded: Profiles) -> list[str]:
    """Return which method to take when: of those that converge about as often as any, the quickest.

    A line for each class: the method that it gives, and where another is quicker, that one.
    """
    lines = []
    times = running_times(recorded, "seconds")
    for group in recorded.groups:
        problems = [each for each in recorded.problems if recorded.group(each) == group]
        shares = costs(recorded, SUCCESS, "seconds", problems)
        share = {method: float(np.isfinite(found).mean()) for method, found in shares.items()}
        ratio = ratios(times, problems)
        sure = [method for method in ratio if share[method] >= max(share.values()) - ABOUT]
        taken = sorted({min(sure, key=ratio.__getitem__), min(ratio, key=ratio.__getitem__)}, key=lambda m: -share[m])
        words = [f"{each} ({percent(share[each])}, {number(ratio[each])} times the best)" for each in taken]
        lines.append(f"{group} ({len(problems)}): take {'; quicker where it succeeds: '.join(words)}")
    return lines


def percent(share: float) -> str:
    """Return a share in whole percents."""
    return f"{100 * share:.0f} %"


def number(value: float) -> str:
    """Return two digits, or a dash where there is no number."""
    if not math.isfinite(value):
        return NEVER
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}"
