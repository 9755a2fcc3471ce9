"""Compiled kernels on the engine's own worlds: against casadi's C, compile time and memory, threads, the ball throw.

Every ratio is of one run, best of seven. Run with ``make bench``.
"""

from __future__ import annotations

import os
import platform
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from casadi_code import compiled_by_casadi
from measured_worlds import spheres_on_ground

from symphys.codegen import Cache, Kernel, Program, compile_program
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription import rollout_program, transcribe
from symphys.transcription.rollout import symbolic_rollout

BATCH, REPEATS, COUNT, STEPS = 128, 7, 20, 50


def fastest(call: Callable[[], Any]) -> float:
    """Seconds, the best of REPEATS."""
    times = []
    for _ in range(REPEATS):
        began = perf_counter()
        call()
        times.append(perf_counter() - began)
    return min(times)


def around(guess: np.ndarray, batch: int = BATCH) -> np.ndarray:
    """(batch, n) decision vectors near the guess."""
    return guess + 0.01 * np.random.default_rng(0).standard_normal((batch, guess.size))


def guess_of(problem: Problem) -> np.ndarray:
    """(n,)."""
    return np.concatenate([variable.guess for variable in problem.variables])


def per_step(seconds: float) -> float:
    """Microseconds for one step of one robot."""
    return 1e6 * seconds / (BATCH * STEPS)


def kernel_of(program: Program, **more: Any) -> Kernel:
    """The gradient of the merit."""
    return compile_program(program, seeded=("merit",), **more)


def compile_costs(program: Program) -> Kernel:
    """Cold and warm compile time, and the largest memory of a compiler."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Cache(Path(folder))
        cold, warm = (kernel_of(program, cache=cache, threads=1) for _ in range(2))
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
        print(
            f"   compile cold {cold.report.seconds:.2f} s, warm {warm.report.seconds:.2f} s, {memory:.2f} GiB", end=""
        )
        print(f"; {cold.report.functions} functions, {cold.report.bytes_per_lane / 1024:.0f} KiB a lane")
        return warm


def spheres(sweeps: int, exact: bool) -> tuple[float, float]:
    """Seconds for BATCH rollouts without and with gradient, one thread."""
    problem = spheres_on_ground(COUNT, sweeps, STEPS)
    print(f"{COUNT} spheres, {3 * COUNT} rows, {sweeps} sweeps, {BATCH} copies,", "exact" if exact else "smoothed")
    kernel = compile_costs(rollout_program(symbolic_rollout(problem), exact))
    Z = around(guess_of(problem))
    forward = fastest(lambda: kernel.forward(Z, [0.0]))
    gradient = fastest(lambda: kernel.gradient(Z, [1.0], [0.0]))
    kernel.threads = 2
    both = fastest(lambda: kernel.gradient(Z, [1.0], [0.0]))
    print(f"   us a step and robot: {per_step(forward):.2f}, with gradient {per_step(gradient):.2f}", end="")
    print(f", ratio {gradient / forward:.2f}; two threads {gradient / both:.2f} times one; lanes {kernel.report.lanes}")
    return forward, gradient


def casadi_c(problem: Problem, name: str) -> float:
    """Seconds for BATCH rollouts by casadi's own C code and ``map``, compiled with -O2."""
    function = getattr(transcribe(problem, backend="casadi").functions, name).map(BATCH)
    Z = around(guess_of(problem)).T
    with compiled_by_casadi(function) as (code, compiled):
        seconds = fastest(lambda: code(Z, np.zeros((1, BATCH))))
    print(f"   casadi C, map({BATCH}), {name}: {per_step(seconds):.2f} us a step and robot, compile {compiled:.1f} s")
    return seconds


def throws() -> None:
    """128 throws with gradient."""
    problem = load_problem(find("ball_throw"))
    Z = around(guess_of(problem))
    kernel = kernel_of(rollout_program(symbolic_rollout(problem), exact=True))
    one = {}
    for threads in (1, 2):
        kernel.threads = threads
        one[threads] = [fastest(lambda: kernel.forward(Z, [0.0])), fastest(lambda: kernel.gradient(Z, [1.0], [0.0]))]
        print(f"ball throw, {BATCH} rollouts of 500 steps, {threads} threads: {1e3 * one[threads][0]:.2f} ms", end="")
        print(f", with gradient {1e3 * one[threads][1]:.2f} ms")


def main() -> None:
    """Print everything."""
    print(f"machine: {platform.machine()}, {os.cpu_count()} cores; {find_compiler().version}")
    throws()
    for sweeps in (20, 10):
        spheres(sweeps, exact=True)
    spheres(20, exact=False)
    ours = spheres(10, exact=False)
    problem = spheres_on_ground(COUNT, 10, STEPS)
    for name, seconds in zip(("value", "gradient"), ours, strict=True):
        print(f"   kernel {casadi_c(problem, name) / seconds:.1f} times faster")


if __name__ == "__main__":
    main()
