"""Kernels against casadi on the table robot: microseconds for a robot and step, one thread, with and without gradient.

    python benchmarks/robot_kernels.py

The kernel computes 8 robots at once; casadi's virtual machine and its own C code one after the other. All compute the
same rollout of the robot with its net of 1,296 weights, and agree.
"""

from __future__ import annotations

import time

import numpy as np
from table_robot import fastest, starts, table_problem

from symphys.transcription import transcribe

STEPS = 20
ROBOTS = {"simd": 128, "c": 4, "casadi": 4}
ROUNDS = 5


def main() -> None:
    """Measure every backend in turn."""
    problem = table_problem([], STEPS)
    weights, found = problem.variables[0].guess, {}
    for name, robots in ROBOTS.items():
        began = time.perf_counter()
        made = transcribe(problem, exact=True, backend=name, threads=1)
        evaluator = made.shooting.evaluator
        rows = np.hstack([np.tile(weights, (robots, 1)), starts(robots)])
        first = evaluator.gradient(rows[:1], 0.0)
        ready = time.perf_counter() - began
        value = fastest(lambda: evaluator.value(rows, 0.0), ROUNDS)[0]  # noqa: B023
        gradient = fastest(lambda: evaluator.gradient(rows, 0.0), ROUNDS)[0]  # noqa: B023
        scale = 1e6 / (robots * STEPS)
        found[name] = first
        print(
            f"{name:<7} ready after {ready:6.1f} s, {value * scale:8.2f} us, with gradient {gradient * scale:8.2f} us"
        )
        print(f"        {made.backend}", flush=True)
    for name in ("c", "casadi"):
        a, b = found["simd"].gradient, found[name].gradient
        assert a is not None and b is not None
        print(f"gradients of simd and {name} differ by {np.abs(a - b).max() / np.abs(b).max():.1e}")


if __name__ == "__main__":
    main()
