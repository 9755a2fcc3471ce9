"""How soon does a robot learn to walk, and does its gait hold in samples of scenarios that it has not seen?

Each seed solves a shipped problem; then the gait walks in 500 samples drawn from a stream that nothing else uses, and
in 64 at half the time step, with twice the sweeps and for three times as long. Upright: the torso within 30 degrees at
every step. With several solvers each has the options of the shipped file, so that all take about the same time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bench import Row

from symphys.codegen import Place
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.shooting import ScenarioSamples
from symphys.solvers import SOLVERS, TraceRow
from symphys.transcription import transcribe
from symphys.transcription.transcribe import KernelSamples, ScenarioGrids
from symphys.types import Array

UNSEEN, FEWER, SEED = 500, 64, 20161105
LEAST = 0.7
"""Share of the nominal speed that counts as success in a sample."""
MARKS = (1.17, 2.0, 2.5)
"""Speeds that a gait reaches [m/s]; the first one is that of Degrave et al. (2019)."""
COLUMNS = {
    "problem": "a shipped problem with scenarios",
    "solver": "that learns",
    "seed": "of the solve",
    "iterations": "of the solver",
    "wall_s": "seconds of the clock",
    "cpu_s": "seconds of processors",
    **{f"reaches_{mark:g}": f"seconds until the kept gait is at least {mark:g} m/s fast" for mark in MARKS},
    "speed": "nominal, in the problem's own sample [m/s]",
    "unseen_speed": "mean of the upright ones of 500 unseen samples [m/s]",
    "upright": "share of 500 unseen samples in which it stays upright",
    "success": "share in which it also keeps 70 % of its nominal speed",
    "half_step": "upright in 64 samples at half the time step",
    "twice_sweeps": "upright in 64 samples with twice the sweeps",
    "three_times": "upright in 64 samples for three times as long",
}


class Walks:
    """Rollouts of a problem in samples of its scenarios."""

    def __init__(self, problem: Problem) -> None:
        """Compile the problem."""
        made = transcribe(problem, exact=True)
        scenario = made.shooting.scenario
        assert isinstance(scenario, ScenarioGrids), made.backend.note
        assert isinstance(scenario.evaluators[0], KernelSamples), "nets are within the step"
        self.problem, self.made, self.scenario, self.kernel = problem, made, scenario, scenario.evaluators[0].kernel
        names = [*(f"target {t.name}" for t in problem.targets), *(c.name for c in problem.constraints)]
        self.upright = names.index("stays upright")

    def __call__(self, z: Array, drawn: ScenarioSamples) -> tuple[Array, Array]:
        """Return mean speeds (count,) [m/s], and whether the robot is upright at every step (count,)."""
        errors = self.scenario.value(z[None], drawn, 0.0).errors
        lanes = np.hstack([np.tile(z, (len(drawn.numbers), 1)), drawn.numbers])
        state = self.kernel.program.discounted.state  # type: ignore[union-attr]
        last = Place(state.offset + self.problem.simulation.steps * state.stride, state.size)
        ends = self.kernel.trajectory(lanes, last, 1, [0.0])[:, 0, 0]
        return ends / self.problem.simulation.duration, errors[:, self.upright] <= 1

    def draw(self, count: int) -> ScenarioSamples:
        """Draw samples as the tables say, the problem's own first."""
        return self.scenario.draw(np.random.default_rng(SEED), count)


def rows(
    quick: bool = False,
    problems: tuple[str, ...] = ("quadruped_walk", "quadruped_walk_net", "gait_robot_fast"),
    solvers: tuple[str, ...] = ("stochastic",),
    seeds: int = 3,
) -> Iterator[Row]:
    """Yield a row for each problem, solver and seed.

    Args:
        quick: two iterations of the first problem.
        problems: shipped problems with scenarios whose robot shall walk.
        solvers: for instance stochastic, evolution and cma.
        seeds: of each.
    """
    for name in problems[:1] if quick else problems:
        problem = load_problem(find(name))
        walks, simulation = Walks(problem), problem.simulation
        others = {
            "half_step": replace(simulation, dt=simulation.dt / 2),
            "twice_sweeps": replace(simulation, sweeps=2 * simulation.sweeps),
            "three_times": replace(simulation, duration=3 * simulation.duration),
        }
        there = {} if quick else {key: Walks(replace(problem, simulation=each)) for key, each in others.items()}
        for solver in solvers:
            for seed in range(1 if quick else seeds):
                row, z = learned(walks, solver, seed, {"iterations": 2, "samples": 2} if quick else {})
                held = {key: float(other(z, other.draw(FEWER))[1].mean()) for key, other in there.items()}
                unseen = worth(walks, z, 8 if quick else UNSEEN)
                yield {"problem": name, **row, **unseen, **dict.fromkeys(others), **held}


def learned(walks: Walks, solver: str, seed: int, changes: dict[str, Any]) -> tuple[Row, Array]:
    """Solve; returns what it took and the gait (n,)."""
    options: Any = replace(solver_options(walks.problem, solver), **changes)
    SOLVERS[solver].prepare()
    trace, shooting = list[TraceRow](), walks.made.shooting
    began, worked = time.perf_counter(), time.process_time()
    found = SOLVERS[solver].solve(shooting, shooting.start(seed), options, seed, monitor=trace.append)
    wall, cpu = time.perf_counter() - began, time.process_time() - worked
    row: Row = {"solver": solver, "seed": seed, "iterations": len(found.trace), "wall_s": wall, "cpu_s": cpu}
    return row | {f"reaches_{mark:g}": reaches(trace, mark) for mark in MARKS}, found.z


def reaches(trace: Sequence[TraceRow], speed: float) -> float | None:
    """Return the seconds from which on the kept gait is that fast, if it ever is."""
    slow = [k for k, row in enumerate(trace) if row.outputs.get("speed [m/s]", 0.0) < speed]
    first = slow[-1] + 1 if slow else 0
    return trace[first].seconds if first < len(trace) else None


def worth(walks: Walks, z: Array, count: int) -> Row:
    """Let a gait walk in unseen samples."""
    speed, upright = walks(z, walks.draw(count))
    fast = upright & (speed >= LEAST * speed[0])
    unseen = float(speed[upright].mean()) if upright.any() else None
    found = {"speed": float(speed[0]), "unseen_speed": unseen}
    return found | {"upright": float(upright.mean()), "success": float(fast.mean())}
