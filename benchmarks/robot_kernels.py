"""Kernels against casadi on the table robot: microseconds for a robot and step, one thread, with and without gradient.

    python benchmarks/robot_kernels.py

The kernel computes 8 robots at once; casadi's virtual machine and its own C code one after the other. All compute the
same rollout of the robot with its net of 1,296 weights, and agree. Rounds take turns; the fastest counts. Two threads
share the 128 robots of the kernel.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from casadi_code import compiled_by_casadi
from table_robot import starts, table_problem

from symphys.codegen import compile_program
from symphys.transcription import Transcription, transcribe
from symphys.transcription.program import rollout_program
from symphys.types import Array

STEPS, ROBOTS, FEW, ROUNDS = 20, 128, 4, 7
LEVEL = "-O1"
"""Of optimisation of casadi's C: more takes the compiler beyond what was waited for."""


def main() -> None:
    """Build each way, measure them in turn, print a line for each."""
    problem = table_problem([], STEPS)
    made = transcribe(problem, exact=True, backend="casadi", threads=1)
    rows = np.hstack([np.tile(problem.variables[0].guess, (ROBOTS, 1)), starts(ROBOTS)])
    with ExitStack() as stack:
        calls = {**kernels(made, rows), **casadis(made, rows[:FEW], stack)}
        best = dict.fromkeys(calls, np.inf)
        for _ in range(ROUNDS):
            for way, (call, robots) in calls.items():
                began = time.perf_counter()
                call()
                best[way] = min(best[way], (time.perf_counter() - began) / (robots * STEPS))
        for way, seconds in best.items():
            print(f"{way:<40} {1e6 * seconds:8.2f} us", flush=True)
        slopes = [np.asarray(calls[way][0]()) for way in calls if way.endswith("with gradient")]
        for slope in slopes[1:]:
            difference = np.abs(slope[:FEW] - slopes[0][:FEW]).max() / np.abs(slopes[0]).max()
            print(f"gradients differ by {difference:.1e} of the largest")


def kernels(made: Transcription, rows: Array) -> dict[str, tuple[Callable[[], Any], int]]:
    """The kernel on one thread and on two."""
    found: dict[str, tuple[Callable[[], Any], int]] = {}
    for threads, words in ((1, "one thread"), (2, "two threads")):
        kernel = compile_program(rollout_program(made.rollout, True), seeded=("merit",), threads=threads)
        found[f"kernel, {words}"] = (lambda kernel=kernel: kernel.forward(rows, [0.0]), len(rows))
        found[f"kernel, {words}, with gradient"] = (
            lambda kernel=kernel: kernel.gradient(rows, [1.0], [0.0])[1],
            len(rows),
        )
    print(f"kernel of {kernel.report.lanes} lanes: ready in {kernel.report.seconds:.0f} s", end=" ")
    print("(from the cache)" if kernel.report.cached else "(compiled)")
    return found


def casadis(made: Transcription, rows: Array, stack: ExitStack) -> dict[str, tuple[Callable[[], Any], int]]:
    """Casadi's virtual machine and its compiled C."""
    found: dict[str, tuple[Callable[[], Any], int]] = {}
    for name, tail in (("value", ""), ("gradient", ", with gradient")):
        function = getattr(made.functions, name)
        code, seconds = stack.enter_context(compiled_by_casadi(function, LEVEL))
        print(f"casadi's C of the {name}, {LEVEL}: compiled in {seconds:.0f} s", flush=True)
        for way, each in (("casadi's C", code), ("casadi's virtual machine", function)):
            found[way + tail] = (
                lambda each=each: np.array([np.array(each(row, 0.0)[-1]).ravel() for row in rows]),
                len(rows),
            )
    return found


if __name__ == "__main__":
    main()
