"""What single precision costs: the table robot's walk and its gradient against those in double precision.

    python benchmarks/rounding.py [ROBOTS]

On the processor: a GPU runs the same text, and rounds alike but for sin, exp and tanh.
"""

from __future__ import annotations

import sys

import numpy as np
from table_robot import starts, table_problem

from symphys.codegen import Kernel, compile_program
from symphys.transcription import rollout_program, symbolic_rollout
from symphys.types import Array

STEPS = (10, 100, 1000)


def main() -> None:
    """A line for each number of steps."""
    robots = int(sys.argv[1]) if len(sys.argv) > 1 else 128
    for steps in STEPS:
        problem = table_problem([], steps)
        program = rollout_program(symbolic_rollout(problem), exact=True)
        rows = np.hstack([np.tile(problem.variables[0].guess, (robots, 1)), starts(robots)])
        (ends, slopes), (near, close) = (
            computed(compile_program(program, precision=precision, seeded=["merit"]), rows)
            for precision in ("double", "single")
        )
        off, wrong = np.abs(near - ends), np.linalg.norm(close - slopes, axis=1) / np.linalg.norm(slopes, axis=1)
        print(
            f"{steps:>5} steps, {robots} robots: distance off by {np.median(off):.1e} m (median), {off.max():.1e} "
            f"(worst); gradient by {np.median(wrong):.1e} of its norm, {wrong.max():.1e}",
            flush=True,
        )


def computed(kernel: Kernel, rows: Array) -> tuple[Array, Array]:
    """(robots,) distances [m], and (robots, n) gradients."""
    outputs, slopes = kernel.gradient(rows, [1.0], [0.0])
    return outputs["objective"][:, 0], slopes


if __name__ == "__main__":
    main()
