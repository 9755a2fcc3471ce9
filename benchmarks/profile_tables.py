"""Data profiles and expected running times of recorded solves, and tables of both.

A solve has converged at tolerance tau where its exact merit is at most f_L + tau (f_0 - f_L): f_0 is that of its start
and f_L the lowest that any solve of the problem has found (Moré and Wild, SIAM J. Optim. 20, 2009, eq. 2.2; they take
the lowest from the same start). A data profile is the share of solves that have converged within a budget. Budgets are
in rollouts here, not in simplex gradients, and in seconds.

The expected running time is the sum of what all solves took, up to their success or their end, over the number of
successes (Hansen et al., COCO, Optimization Methods and Software 36, 2021). Success: everything is met; of a problem
that asks for nothing to be met, convergence at 1e-3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from profile_runs import Budget, read_lines

from symphys.types import Array

Axis = Literal["work", "seconds"]

TOLERANCES = (1e-1, 1e-3, 1e-5)
SUCCESS = 1e-3
"""The tolerance that is success where nothing is to be met."""
AXES: tuple[Axis, ...] = ("work", "seconds")
WORST = 1e3
"""A ratio of running times that is as bad as no success."""
ABOUT = 0.05
"""Methods whose shares of convergence differ by less are as sure as each other."""
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
        """Its lowest merit; inf without any."""
        return float(self.trace[:, 2].min(initial=math.inf))

    def reached(self, merit: float, axis: Axis) -> float:
        """Work or seconds until a merit; inf if never."""
        return self._first(self.trace[:, 2] <= merit, axis)

    def met(self, axis: Axis) -> float:
        """Work or seconds until everything was met; inf if never."""
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
        """Those with solves, by class."""
        return tuple(dict.fromkeys(each.problem for each in sorted(self.solves, key=lambda s: (s.group, s.problem))))

    @property
    def methods(self) -> tuple[str, ...]:
        """In the order in which they were recorded."""
        return tuple(dict.fromkeys(each.method for each in self.solves))

    @property
    def groups(self) -> tuple[str, ...]:
        """Classes of problems."""
        return tuple(sorted({each.group for each in self.solves}))

    def of(self, problem: str, method: str = "") -> list[RecordedSolve]:
        """The solves of a problem, by one method or by all."""
        return [each for each in self.solves if each.problem == problem and method in ("", each.method)]

    def group(self, problem: str) -> str:
        """The class of a problem."""
        return self.of(problem)[0].group


def read(folder: Path) -> Profiles:
    """What a folder holds; ValueError where there is nothing."""
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
    """A line, cut at its budget."""
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
    """The merit at which a solve has converged, by problem and instance.

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
    """By method, what each of all (problem, instance) took to converge, ascending; inf where it did not.

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
    """The expected running time of the solves of one problem by one method; inf without a success, or without any."""
    times = [
        each.met(axis) if each.checks else each.reached(merits[each.problem, each.instance], axis) for each in solves
    ]
    successes = sum(math.isfinite(time) for time in times)
    total = sum(time if math.isfinite(time) else each.ends[axis] for time, each in zip(times, solves, strict=True))
    return total / successes if successes else math.inf


def running_times(recorded: Profiles, axis: Axis) -> dict[str, dict[str, float]]:
    """Expected running times by problem and method."""
    merits = targets(recorded, SUCCESS)
    return {
        problem: {m: running_time(recorded.of(problem, m), merits, axis) for m in recorded.methods}
        for problem in recorded.problems
    }


def ratios(times: dict[str, dict[str, float]], problems: Iterable[str]) -> dict[str, float]:
    """By method, the geometric mean over problems of its expected running time over that of the best method there.

    A ratio counts as ``WORST`` at most, and so does that of a method that never succeeds; problems that no method
    solves are left out.
    """
    rows = [times[problem] for problem in problems if math.isfinite(min(times[problem].values()))]
    if not rows:
        return {}
    logs = {m: [math.log(min(row[m] / min(row.values()), WORST)) for row in rows] for m in rows[0]}
    return {method: math.exp(fmean(each)) for method, each in logs.items()}


def class_table(recorded: Profiles, group: str) -> str:
    """Of one class a line for each method: shares that converge or meet everything, and relative running times."""
    problems = [each for each in recorded.problems if recorded.group(each) == group]
    shares = [costs(recorded, tolerance, "work", problems) for tolerance in TOLERANCES]
    times = {axis: ratios(running_times(recorded, axis), problems) for axis in AXES}
    head = [group, *(f"at {tolerance:g}" for tolerance in TOLERANCES), "all met", "rollouts", "seconds"]
    rows = []
    for method in recorded.methods:
        solves = [each for problem in problems for each in recorded.of(problem, method)]
        if not solves:
            continue
        checked = [each for each in solves if each.checks]
        met = sum(math.isfinite(each.met("work")) for each in checked)
        rows.append(
            [
                f"`{method}`",
                *(percent(float(np.isfinite(share[method]).mean())) for share in shares),
                percent(met / len(checked)) if checked else NEVER,
                *(number(times[axis].get(method, math.inf)) for axis in AXES),
            ]
        )
    return markdown(head, rows)


def problem_table(recorded: Profiles, axis: Axis) -> str:
    """Expected running times, a line for each problem."""
    times, unit = running_times(recorded, axis), {"work": "rollouts", "seconds": "seconds"}[axis]
    rows = []
    for problem in recorded.problems:
        best = min(times[problem].values())
        cells = [
            f"**{number(t)}**" if math.isfinite(t) and t == best else number(t)
            for t in (times[problem][method] for method in recorded.methods)
        ]
        rows.append([f"`{problem}`", *cells])
    return markdown([f"expected {unit}", *(f"`{method}`" for method in recorded.methods)], rows)


def advice(recorded: Profiles) -> list[str]:
    """Which method to take when, by a rule: of those that converge about as often as any, the quickest.

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
    """A share in whole percents."""
    return f"{100 * share:.0f} %"


def number(value: float) -> str:
    """Two digits, or a dash where there is none."""
    if not math.isfinite(value):
        return NEVER
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
