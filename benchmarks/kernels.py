"""How fast are compiled kernels, against casadi's C and against the number of contacts?

Spheres on the ground and the table robot with its net of 1,296 weights, one thread; casadi's virtual machine and its
own C code, compiled, compute the same rollouts one after the other. Then heaps of N spheres on each other: what a step,
the compiler and the memory take, against the number of contact constraints.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from bench import Call, Row, in_turns
from measured_worlds import around, guess_of, pile, robots_of, spheres_on_ground, table_problem

from symphys.codegen import Cache, Kernel, compile_program
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription import rollout_program, transcribe
from symphys.transcription.rollout import symbolic_rollout
from symphys.types import Array

COLUMNS = {
    "world": "what is rolled out; exact or smoothed steps",
    "way": "what computes it, on how many threads",
    "constraints": "contact constraints of a step",
    "step_us": "microseconds for a step of one instance",
    "gradient_us": "the same with the gradient",
    "compile_s": "seconds to compile, nothing cached",
    "memory_mib": "of a lane [MiB]",
    "differ": "largest difference of gradients from the kernel's, relative to the largest entry",
}
BATCH, SPHERES, STEPS, ROBOT_STEPS, FEW = 128, 20, 50, 20, 4
HEAPS = (2, 4, 8, 16, 32, 64)
LEVEL = "-O1"
"""Optimisation of casadi's C of the robot: with more its compiler takes many minutes."""


def rows(quick: bool = False, turns: int = 7) -> Iterator[Row]:
    """Yield the spheres, the robot, the ball throw and the heaps."""
    count = 2 if quick else SPHERES
    for sweeps, exact in ((10, False),) if quick else ((20, True), (10, True), (20, False), (10, False)):
        problem = spheres_on_ground(count, sweeps, STEPS)
        kind = "exact" if exact else "smoothed"
        Z = around(guess_of(problem), BATCH)
        against = "-O2" if not exact and sweeps == 10 else ""
        yield from measured(f"{count} spheres, {sweeps} sweeps, {kind}", problem, Z, exact, against, turns)
    if not quick:
        robot = table_problem([], ROBOT_STEPS)
        yield from measured("table robot, exact", robot, robots_of(robot, BATCH), True, LEVEL, turns)
        throw = load_problem(find("ball_throw"))
        yield from measured("ball throw, exact", throw, around(guess_of(throw), BATCH), True, "", turns)
    for balls in HEAPS[:1] if quick else HEAPS:
        heap = pile(balls)
        yield from measured(f"heap of {balls}, exact", heap, around(guess_of(heap), 8), True, "", turns)


def measured(name: str, problem: Problem, Z: Array, exact: bool, level: str, turns: int) -> Iterator[Row]:
    """Yield the kernel on one thread and on two and, with a level of optimisation for its C, casadi."""
    kernel, constraints = kernel_of(problem, exact)
    ways: dict[str, tuple[Call, Call, int]] = {}
    for threads in (1, 2):
        other = kernel if threads == 1 else kernel_of(problem, exact, threads)[0]
        way = f"kernel of {kernel.report.lanes} lanes, {threads} thread{'s' if threads > 1 else ''}"
        ways[way] = partial(other.forward, Z, [0.0]), partial(other.gradient, Z, [1.0], [0.0]), len(Z)
    compiled = dict.fromkeys(ways, kernel.report.seconds)
    with ExitStack() as stack:
        if level:
            for way, found in casadis(problem, exact, Z[:FEW], level, stack).items():
                ways[way], compiled[way] = found[0], found[1]
        calls = {(way, k): found[k] for way, found in ways.items() for k in (0, 1)}
        times = in_turns(calls, turns)  # type: ignore[arg-type]
        slopes = {way: gradient_in(found[1]()) for way, found in ways.items()}
    first = next(iter(slopes.values()))
    for way, (_, _, rollouts) in ways.items():
        off = np.abs(slopes[way] - first[: len(slopes[way])]).max() / np.abs(first).max()
        each = 1e6 / (rollouts * problem.simulation.steps)
        yield {
            "world": name,
            "way": way,
            "constraints": constraints,
            "step_us": each * times[way, 0],  # type: ignore[index]
            "gradient_us": each * times[way, 1],  # type: ignore[index]
            "compile_s": compiled[way],
            "memory_mib": kernel.report.bytes_per_lane / 2**20 if "kernel" in way else None,
            "differ": float(off),
        }


def kernel_of(problem: Problem, exact: bool, threads: int = 1) -> tuple[Kernel, int]:
    """Compile the gradient of the merit with an empty cache; return it with the number of contact constraints."""
    rollout = symbolic_rollout(problem)
    with tempfile.TemporaryDirectory() as folder:
        program = rollout_program(rollout, exact)
        kernel = compile_program(program, seeded=("merit",), threads=threads, cache=Cache(Path(folder)))
    return kernel, 3 * len(rollout.world.pairs)


def casadis(
    problem: Problem, exact: bool, Z: Array, level: str, stack: ExitStack
) -> dict[str, tuple[tuple[Call, Call, int], float]]:
    """Return casadi's virtual machine and its compiled C: calls of values and gradients, and compile seconds."""
    functions = transcribe(problem, exact=exact, backend="casadi", threads=1).functions
    own = [functions.value, functions.gradient]
    compiled = [stack.enter_context(compiled_by_casadi(function, level)) for function in own]
    found = {"casadi's virtual machine": own, f"casadi's C, {level}": [code for code, _ in compiled]}
    seconds = {"casadi's virtual machine": 0.0, f"casadi's C, {level}": sum(each for _, each in compiled)}

    def call(function: Any) -> Any:
        outputs = [function(z, 0.0) for z in Z]  # merit, objective, errors and, of the gradient, its slopes
        return np.array([np.array(each[min(3, len(each) - 2)]).ravel() for each in outputs])

    return {
        way: ((partial(call, pair[0]), partial(call, pair[1]), len(Z)), seconds[way]) for way, pair in found.items()
    }


def gradient_in(found: Any) -> Array:
    """Return the gradients (batch, n) in what a call of either returns."""
    return np.asarray(found[1] if isinstance(found, tuple) else found)


@contextmanager
def compiled_by_casadi(function: ca.Function, level: str) -> Iterator[tuple[ca.Function, float]]:
    """Compile casadi's own C of a function; gives the function and the seconds of the compiler."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path.cwd()
        os.chdir(folder)  # casadi generates into the current folder only
        try:
            function.generate("code.c")
            began = perf_counter()
            command = [*find_compiler().command, level, "-march=native", "-w", "-fPIC", "-shared", "code.c"]
            subprocess.run([*command, "-o", "code.so"], check=True)
            seconds = perf_counter() - began
            yield ca.external(function.name(), str(Path(folder) / "code.so")), seconds
        finally:
            os.chdir(here)
