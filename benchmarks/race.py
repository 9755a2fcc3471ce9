"""How soon a gait is fast: gradients, an evolution strategy and CMA-ES on the same walk, and CMA-ES with MuJoCo.

    python benchmarks/race.py [PROBLEM [FOLDER [SEEDS]]]

Each solver has the options of the shipped file, so that all take about the same time, but validates from the start.
What counts is the nominal speed of the point that the solver would keep so far, by its validation in 64 samples. At
the end each gait walks in 500 samples that none has seen. MuJoCo runs beside ``quadruped_walk``: the robot is the
same by our exporter, with contacts and servos of its own, 2 ms a step; it is alone, without feedback and without
samples that differ: ``rollout`` takes commands that are known before.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from walking import SEED, UNSEEN, Walks

from symphys.problem import load_problem
from symphys.problems import find
from symphys.report.figures import style
from symphys.runs.job import solver_options
from symphys.solvers import SOLVERS, TraceRow
from symphys.types import Array

WALK = "quadruped_walk"
PAPER, AN_HOUR = 1.17, 3600.0
MARKS = (1.17, 2.0, 2.5)
NAMES = {"stochastic": "gradients", "evolution": "evolution strategy", "cma": "CMA-ES"}


@dataclass(frozen=True)
class Course:
    """One solve: seconds (k,) and the speed (k,) [m/s] of what was kept by then."""

    name: str
    seconds: Array
    speed: Array

    def reaches(self, speed: float) -> float:
        """[s] from which on it is that fast; inf if never."""
        slow = np.flatnonzero(self.speed < speed)
        first = slow[-1] + 1 if slow.size else 0
        return float(self.seconds[first]) if first < len(self.seconds) else np.inf


def main() -> None:
    """A line for each solve, then a figure."""
    name, folder, seeds = [*sys.argv[1:], *(WALK, "build", "3")[len(sys.argv) - 1 :]]
    walks = Walks(load_problem(find(name)))
    courses = [raced(walks, solver, seed) for solver in NAMES for seed in range(int(seeds))]
    if name == WALK:
        courses += raced_in_mujoco(int(seeds))
    Path(folder).mkdir(exist_ok=True)
    drawn(courses).savefig(Path(folder) / f"race-{name}.svg")


def raced_in_mujoco(seeds: int) -> list[Course]:
    """The same with MuJoCo, where it is installed."""
    try:
        from mujoco_gaits import raced_there
    except ImportError as error:
        print(f"without MuJoCo: {error}")
        return []
    return [raced_there(seed, seconds=80.0) for seed in range(seeds)]


def raced(walks: Walks, name: str, seed: int) -> Course:
    """A solve, and what its gait is worth."""
    options: Any = solver_options(walks.problem, name)
    if name != "cma":
        options = replace(options, patience=0.0)
    rows: list[TraceRow] = []
    SOLVERS[name].prepare()
    shooting, began = walks.made.shooting, perf_counter()
    found = SOLVERS[name].solve(shooting, shooting.start(seed), options, seed, monitor=rows.append)
    spent = perf_counter() - began
    course = Course(
        NAMES[name], np.array([row.seconds for row in rows]), np.array([row.outputs["speed [m/s]"] for row in rows])
    )
    speed, upright = walks(found.z, walks.scenario.draw(np.random.default_rng(SEED), UNSEEN))
    marks = ", ".join(f"{mark} m/s after {course.reaches(mark):.0f} s" for mark in MARKS)
    print(
        f"{course.name} seed {seed}: {marks}; after {spent:.0f} s nominal {speed[0]:.2f} m/s, {UNSEEN} unseen "
        f"{speed[upright].mean():.2f} m/s, {upright.mean():.3f} upright",
        flush=True,
    )
    return course


def drawn(courses: Sequence[Course]) -> Figure:
    """Speed against wall time, a line for each seed."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    for name, colour in zip(dict.fromkeys(course.name for course in courses), style.BODIES, strict=False):
        for k, course in enumerate(each for each in courses if each.name == name):
            label = name if k == 0 else None
            axes.plot(course.seconds, course.speed, color=colour, linewidth=1.3, drawstyle="steps-post", label=label)
    axes.axhline(PAPER, color=style.GREY, linewidth=0.8, linestyle=(0, (4, 2)))
    axes.plot([AN_HOUR], [PAPER], "D", color=style.GREY, label="Degrave et al. 2019, another robot")
    axes.set(xscale="log", xlabel="time of the solve on two cores [s]", ylabel="speed of what is kept [m/s]")
    axes.set_xlim(0.3, 6000)
    axes.legend(frameon=False, fontsize=8)
    return figure


if __name__ == "__main__":
    main()
