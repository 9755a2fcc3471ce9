"""How long does a user wait for the first iteration, and what does the Python interface add to a kernel?

Each start is a process of its own, with a cache of kernels that is empty at the cold start and filled at the warm one.
It ends with the first iteration after the guess. Modules are bytecode, as in an installed package: a start before the
first one writes it. Python's own start (20 ms) is left out.
"""

from __future__ import annotations

import fcntl
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from bench import Row, all_turns, in_process, peak, spent

STEPS, ROBOTS = 100, 128
BEGINNING = 2.0
"""[s] until a compiler that goes on has locked what it builds."""
MORE = 3
"""Iterations of the cold start: kernels that are called twice are compiled."""
COLUMNS = {
    "problem": "a shipped one",
    "solver": "the first that the problem names, or that is chosen for it",
    "cold": "seconds of the clock from import to the end of the first iteration, nothing cached",
    "cold_spent": "seconds of processors until then, compilers included",
    "warm": "seconds of the clock with all machine code in the cache",
    "read": "of these, for import and reading",
    "warm_spent": "seconds of processors until then",
    "memory": "most memory of the warm process [MiB]",
    "cold_memory": "most memory of the cold process [MiB]",
    "cache": "of kernels after both starts [MiB]",
    "fault": "why a start did not get to an iteration",
    "call": "what is compared with what it calls",
    "inner_ms": "milliseconds of the inner call",
    "ratio": "median ratio of the outer call to the inner one",
}


def rows(
    quick: bool = False, problems: tuple[str, ...] = (), every: int = 0, limit: float = 300.0, repeats: int = 15
) -> Iterator[Row]:
    """Yield two starts of each problem, then what calls through the interface take.

    Args:
        quick: the ball throw alone.
        problems: names or files; all shipped ones if there are none.
        every: 1 takes all solvers that a problem names, not the first alone.
        limit: seconds after which a start is given up.
        repeats: turns of the calls.
    """
    from symphys.problems import catalogue

    with TemporaryDirectory() as bytecode:
        for name in ["ball_throw"] if quick else problems or catalogue():
            named = in_process(solvers, name, env={"PYTHONPYCACHEPREFIX": bytecode})
            for solver in named if every else named[:1]:
                yield starts(name, solver, bytecode, limit)
    yield from interface(2 if quick else ROBOTS, 5 if quick else STEPS, 1 if quick else repeats)


def solvers(name: str) -> list[str]:
    """Return the solvers that a problem names, or those that are chosen for it; none where nothing is asked for."""
    import symphys
    from symphys.runs.choice import chosen

    problem = symphys.load(name)
    if not (problem.costs or problem.targets or problem.constraints):
        return []  # of `symphys identify`
    return list(problem.solvers or ()) or [each.solver for each in chosen(problem)]


def starts(name: str, solver: str, bytecode: str, limit: float) -> Row:
    """Return a cold start and a warm one, with the size of the cache."""
    row: Row = {"problem": name, "solver": solver}
    with TemporaryDirectory() as folder:
        own = {"SYMPHYS_CACHE": folder, "SYMPHYS_WAIT": ""}
        own |= {"PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
        try:
            cold = dict(in_process(start, name, solver, MORE, env=own, timeout=limit))
            time.sleep(BEGINNING)
            while any(map(is_held, Path(folder).glob(".*.lock"))):  # compilers that go on
                time.sleep(0.2)
            warm = dict(in_process(start, name, solver, 1, env=own, timeout=limit))
        except Exception as error:  # a table of all problems does not end with one
            return row | {"fault": " ".join(str(error).split())[-200:]}
        kept = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file()) / 2**20
    row |= {"cold": cold["wall"], "cold_spent": cold["spent"], "warm": warm["wall"], "read": warm["read"]}
    return row | {"warm_spent": warm["spent"], "memory": warm["memory"], "cold_memory": cold["memory"], "cache": kept}


def is_held(lock: Path) -> bool:
    """Whether a process builds what this file locks; one that was killed leaves its file."""
    try:
        with lock.open() as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return False
    return False


class Enough(BaseException):
    """Ends a solve at once, without judging."""


def start(name: str, solver: str, last: int) -> dict[str, Any]:
    """Measure a start in this process, which ends after so many iterations."""
    began = perf_counter()
    import symphys

    problem = symphys.load(name)
    read, found = perf_counter() - began, dict[str, Any]()

    def progress(row: Any) -> None:
        if row.iteration < 2:
            found.update(wall=perf_counter() - began, read=read, spent=spent(), memory=peak())
        if row.iteration >= last:
            raise Enough

    try:
        symphys.solve(problem, solver, progress=progress)
    except Enough:
        pass
    except symphys.SymphysError:  # ipopt ends with an error of its own
        if not found:
            raise
    return found


def interface(robots: int, steps: int, repeats: int) -> Iterator[Row]:
    """Yield ``rollout.gradient`` against its kernel, and ``symphys.solve`` against its solver."""
    import numpy as np
    from measured_worlds import table_problem

    import symphys

    rollout = symphys.compile(table_problem([], steps))
    rollout.finish()
    Z = rollout.z() + 0.01 * np.random.default_rng(0).standard_normal((robots, rollout.n))
    evaluator = rollout._made.shooting.evaluator.make()
    kernel, parameters, seeds = evaluator.kernel, evaluator.parameters(0.0), evaluator.steepest
    calls = {"inner": lambda: kernel.gradient(Z, seeds, parameters), "outer": lambda: rollout.gradient(Z)}
    times = all_turns(calls, repeats)
    ratio = statistics.median(b / a for a, b in zip(times["inner"], times["outer"], strict=True))
    name = f"rollout.gradient of {robots} table robots, {steps} steps, by its kernel"
    yield {"call": name, "inner_ms": 1e3 * statistics.median(times["inner"]), "ratio": ratio}
    problem, inner, ratios = symphys.load("ball_throw"), list[float](), list[float]()
    for _ in range(repeats + 1):  # the first one compiles
        began = perf_counter()
        found = symphys.solve(problem, "least_squares")
        inner.append(found.run.seconds["solve"])
        ratios.append((perf_counter() - began) / inner[-1])
    ms = 1e3 * statistics.median(inner[1:])
    name = "symphys.solve of the ball throw, by its solver"
    yield {"call": name, "inner_ms": ms, "ratio": statistics.median(ratios[1:])}
