"""What each option of the solver ``stochastic`` does for a walk: one thing changed at a time, two seeds each.

    python benchmarks/lessons.py [ITERATIONS [SEEDS]]

From ``walking.LONG``, over fewer batches, so that differences show. Then 500 samples that were not seen.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import Any

import numpy as np
from walking import LONG, SEED, UNSEEN, Walks

from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.solvers import SOLVERS

CHANGES: dict[str, dict[str, Any]] = {
    "nothing changed": {},
    "adjoint discount 0: exact gradients": {"adjoint_discount": 0.0},
    "adjoint discount 2": {"adjoint_discount": 2.0},
    "adjoint discount 20": {"adjoint_discount": 20.0},
    "clip inf: plain mean": {"clip": inf},
    "samples 8": {"samples": 8},
    "width 0: one sample": {"width": 0.0},
    "fallen 1: no more weight": {"fallen": 1.0},
    "validation 0: the last point": {"validation": 0},
    "hold 1: no falling rate": {"hold": 1.0},
    "rate 0.03": {"rate": 0.03},
    "rate 0.003": {"rate": 0.003},
    "horizons 2, 5 s first": {"horizons": (2.0, 5.0)},
    "evolution 0.5": {"evolution": 0.5},
    "twice as many of half the size, rate 0.02": {"samples": 16, "rate": 0.02, "iterations": 200},
}


def main() -> None:
    """A line for each change and seed."""
    iterations, seeds = int(sys.argv[1] if len(sys.argv) > 1 else 100), int(sys.argv[2] if len(sys.argv) > 2 else 2)
    walks = Walks(load_problem(find("quadruped_walk")))
    shooting, options = walks.made.shooting, solver_options(walks.problem, "stochastic")
    for change, values in CHANGES.items():
        for seed in range(seeds):
            began = perf_counter()
            asked = replace(options, **{**LONG, "iterations": iterations, **values})
            found = SOLVERS["stochastic"].solve(shooting, shooting.start(seed), asked, seed)
            spent = perf_counter() - began
            unseen = walks.scenario.draw(np.random.default_rng(SEED), UNSEEN)
            speed, upright = walks(found.z, unseen)
            mean = speed[upright].mean() if upright.any() else 0.0
            print(
                f"{change:<42} seed {seed}: nominal {speed[0]:5.2f} m/s{'' if upright[0] else ' (falls)'}, unseen "
                f"{mean:5.2f} m/s, {upright.mean():.3f} upright, {spent:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
