"""Which method to take when: how often and how soon does each solve the shipped problems from many starts?

Problems are those of the catalogue that have no scenarios and no net to learn, and whose gradient takes at most 50 ms.
Each is built and compiled once; instance 0 starts from its guess, the others from one perturbed by its spread. Solves
are lines of files in ``--folder``. A run that was ended goes on where it was; another budget needs another folder.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from bench import Row, in_process
from profile_runs import Budget, Cases, Profiles, advice, ratios, read, read_lines, running_times, shares

from symphys.problems import catalogue

COLUMNS = {
    "class": "of problems",
    "problem": "one of the class; none: all of them",
    "method": "a solver with its default options",
    "at_0.1": "share of starts that converge at this tolerance",
    "at_0.001": "share of starts that converge at this tolerance",
    "at_1e-05": "share of starts that converge at this tolerance",
    "all_met": "share of starts from which everything is met",
    "rollouts": "expected work until a success; of a class, relative to the best method, geometric mean",
    "seconds": "expected seconds until a success; of a class, relative to the best method, geometric mean",
}
SHARES = tuple(COLUMNS)[3:7]
PATIENCE, BUILDING = 3.0, 600.0
"""A problem is given up after so many times the budget of its solves, and so many seconds more."""


def rows(
    quick: bool = False,
    folder: str = "build/profiles",
    instances: int = 15,
    seconds: float = Budget.seconds,
    work: float = Budget.work,
    jobs: int = 2,
    problems: tuple[str, ...] = (),
    methods: tuple[str, ...] = (),
) -> Iterator[Row]:
    """Do the solves that are missing; yield a row for each class and method, then for each problem and method.

    Args:
        quick: one start of one problem by two methods.
        folder: where solves are kept.
        instances: starts of each problem.
        seconds: of the processor, for each solve.
        work: rollouts for each solve.
        jobs: worker processes.
        problems: none: the catalogue.
        methods: of those that apply; none: all.
    """
    if quick:
        instances, problems, methods, folder = 1, ("free_kick",), ("gradient", "least_squares"), f"{folder}/quick"
    solve = partial(worked, folder=folder, instances=instances, work=work, seconds=seconds, methods=methods)
    with ThreadPoolExecutor(jobs) as pool:
        lost = list(filter(None, pool.map(solve, problems or catalogue())))
    recorded = read(Path(folder))
    yield from tabled(recorded)
    print("\n".join(["", *advice(recorded), *lost]))
    print("\n".join(f"left out: {name}: {why}" for name, why in recorded.left_out.items()))


def worked(name: str, folder: str, instances: int, work: float, seconds: float, methods: tuple[str, ...]) -> str:
    """Solve one problem in a process of its own; returns a line where that process failed."""
    limit = BUILDING + PATIENCE * instances * (len(methods) or 8) * seconds
    try:
        in_process(solves, name, folder, instances, work, seconds, methods, timeout=limit)
    except subprocess.TimeoutExpired:
        return f"{name}: given up, it takes too long"
    except RuntimeError as error:
        return f"{name}: {error}"
    return ""


def solves(name: str, folder: str, instances: int, work: float, seconds: float, methods: list[str]) -> int:
    """Solve one problem in this process; returns how many solves there are."""
    Cases(name, Path(folder), Budget(work, seconds)).run(instances, tuple(methods))
    return len(read_lines(Path(folder) / f"{name}.jsonl")) - 1


def tabled(recorded: Profiles) -> Iterator[Row]:
    """Yield the rows of recorded solves."""
    work, seconds = (running_times(recorded, axis) for axis in ("work", "seconds"))  # type: ignore[arg-type]
    for group in recorded.groups:
        problems = [each for each in recorded.problems if recorded.group(each) == group]
        by_work, by_seconds = ratios(work, problems), ratios(seconds, problems)
        for method in recorded.methods:
            if any(recorded.of(problem, method) for problem in problems):
                found = dict(zip(SHARES, shares(recorded, group, method).values(), strict=True))
                row: Row = {"class": group, "problem": None, "method": method, **found}
                yield row | {"rollouts": by_work.get(method), "seconds": by_seconds.get(method)}
    for problem in recorded.problems:
        for method in recorded.methods:
            if recorded.of(problem, method):
                row = {"class": recorded.group(problem), "problem": problem, "method": method}
                yield row | {"rollouts": work[problem][method], "seconds": seconds[problem][method]}
