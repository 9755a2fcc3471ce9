"""How a quadruped learns to walk, and what its gait is worth in samples of scenarios that it has not seen.

    python benchmarks/walking.py [PROBLEM [SEEDS]]

Each seed solves the shipped problem; then the gait walks in 500 samples drawn from a stream that nothing else uses,
at half the time step, with twice the sweeps, and for three times as long. Upright: the torso within 30 degrees at every
step. Times are of the descent alone, on all cores; those of a processor are the sum over cores.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.codegen import Place
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.shooting import ScenarioSamples
from symphys.solvers import SOLVERS
from symphys.transcription import Transcription, transcribe
from symphys.transcription.randomization.transcription import KernelScenarioEvaluator
from symphys.types import Array

UNSEEN, SEED, LEAST = 500, 20161105, 0.7
LONG: dict[str, Any] = {"iterations": 250, "samples": 32, "rate": 0.01, "horizons": (), "patience": 0.3}
"""Options of ``quadruped_walk`` without shorter motions first, which comparisons of single options begin with."""


class Walks:
    """Rollouts of a problem in samples: how far the torso comes, and whether it stays upright."""

    def __init__(self, problem: Problem) -> None:
        """Compile it."""
        made = transcribe(problem, exact=True)
        assert isinstance(made.shooting.scenario, KernelScenarioEvaluator), made.backend.note
        self.problem, self.made, self.scenario = problem, made, made.shooting.scenario
        names = [*(f"target {t.name}" for t in problem.targets), *(c.name for c in problem.constraints)]
        self.upright = names.index("stays upright")

    def __call__(self, z: Array, drawn: ScenarioSamples) -> tuple[Array, Array]:
        """(count,) mean speed [m/s], and whether upright at every step."""
        errors = self.scenario.value(z[None], drawn, 0.0).errors
        kernel, rows = self.scenario.kernels[0], np.hstack([np.tile(z, (len(drawn.numbers), 1)), drawn.numbers])
        state = kernel.program.discounted.state  # type: ignore[union-attr]
        last = Place(state.offset + self.problem.simulation.steps * state.stride, state.size)
        ends = kernel.trajectory(rows, last, 1, [0.0])[:, 0, 0]
        return ends / self.problem.simulation.duration, errors[:, self.upright] <= 1

    def draw(self, count: int) -> ScenarioSamples:
        """Samples as the tables say, the problem's own first."""
        return self.scenario.draw(np.random.default_rng(SEED), count)


def main() -> None:
    """A line for each seed and way to walk."""
    name, seeds = (sys.argv[1] if len(sys.argv) > 1 else "quadruped_walk"), int(sys.argv[2]) if len(sys.argv) > 2 else 3
    problem = load_problem(name if name.endswith(".toml") else find(name))
    walks = Walks(problem)
    simulation = problem.simulation
    others = {
        "half the step": Walks(replace(problem, simulation=replace(simulation, dt=simulation.dt / 2))),
        "twice the sweeps": Walks(replace(problem, simulation=replace(simulation, sweeps=2 * simulation.sweeps))),
        "three times as long": Walks(
            replace(problem, simulation=replace(simulation, duration=3 * simulation.duration))
        ),
    }
    for seed in range(seeds):
        told(walks, others, seed, learnt(walks.made, seed))


def learnt(made: Transcription, seed: int) -> Array:
    """(n,) what a seed finds."""
    shooting, began, worked = made.shooting, time.perf_counter(), time.process_time()
    found = SOLVERS["stochastic"].solve(
        shooting, shooting.start(seed), solver_options(made.problem, "stochastic"), seed
    )
    spent, worked = time.perf_counter() - began, time.process_time() - worked
    print(f"seed {seed}: {len(found.trace)} iterations, {spent:.0f} s, {worked:.0f} s of a processor", flush=True)
    return found.z


def told(walks: Walks, others: dict[str, Walks], seed: int, z: Array) -> None:
    """What a gait is worth."""
    speed, upright = walks(z, walks.draw(UNSEEN))
    fast = upright & (speed >= LEAST * speed[0])
    verdict = walks.made.judge(z)
    checks = ", ".join(f"{check.name} {'met' if check.met else 'missed'}" for check in verdict.checks)
    print(f"  nominal {speed[0]:.2f} m/s ({checks}); {UNSEEN} unseen: {upright.mean():.3f} upright, "
          f"{fast.mean():.3f} and at 70 % of the speed, {speed[upright].mean():.2f} m/s", flush=True)  # fmt: skip
    for way, other in others.items():
        speed, upright = other(z, other.draw(64))
        print(
            f"  {way}: nominal {speed[0]:.2f} m/s{'' if upright[0] else ' (falls)'}; 64: {upright.mean():.3f} upright"
        )


if __name__ == "__main__":
    main()
