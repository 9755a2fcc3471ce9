"""What the front door costs: a batch of gradients against the kernel alone, a solve against its solver, the import."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from table_robot import table_problem

import symphys

ROBOTS, STEPS, REPEATS = 128, 100, 15


def seconds(call: Callable[[], object]) -> float:
    """Of one call."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def gradients(robots: int = ROBOTS, steps: int = STEPS, repeats: int = REPEATS) -> tuple[float, float]:
    """(seconds of the kernel alone, ratio of ``rollout.gradient`` to it): medians of calls in turns."""
    rollout = symphys.compile(table_problem([], steps))
    rollout.finish()
    Z = rollout.z() + 0.01 * np.random.default_rng(0).standard_normal((robots, rollout.n))
    evaluator = rollout._made.shooting.evaluator
    kernel, parameters, seeds = evaluator.kernel, evaluator.parameters(0.0), evaluator.steepest
    alone, whole = [], []
    for _ in range(repeats):
        alone.append(seconds(lambda: kernel.gradient(Z, seeds, parameters)))
        whole.append(seconds(lambda: rollout.gradient(Z)))
    ratios = [b / a for a, b in zip(alone, whole, strict=True)]
    return statistics.median(alone), statistics.median(ratios)


def solves(repeats: int = REPEATS) -> tuple[float, float]:
    """(seconds of the solver, seconds of ``symphys.solve`` beside it): medians, everything compiled and kept."""
    problem = symphys.load("ball_throw")
    symphys.solve(problem, "least_squares")
    solver, beside = [], []
    for _ in range(repeats):
        began = time.perf_counter()
        found = symphys.solve(problem, "least_squares")
        beside.append(time.perf_counter() - began - found.run.seconds["solve"])
        solver.append(found.run.seconds["solve"])
    return statistics.median(solver), statistics.median(beside)


def imports(repeats: int = REPEATS) -> float:
    """Seconds that ``import symphys`` takes in a process of its own, that of Python's start left out."""
    code = "import time; began = time.perf_counter(); import symphys; print(time.perf_counter() - began)"
    done = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
            for _ in range(repeats)]  # fmt: skip
    return statistics.median(map(float, done))


def main() -> None:
    """Print the three."""
    kernel, ratio = gradients()
    print(f"{ROBOTS} table robots, {STEPS} steps: kernel alone {kernel:.3f} s, rollout.gradient {ratio:.3f} of it")
    solver, beside = solves()
    print(f"ball throw: solver {1e3 * solver:.1f} ms, symphys.solve {1e3 * beside:.1f} ms beside it")
    print(f"import symphys: {1e3 * imports():.1f} ms")


if __name__ == "__main__":
    main()
