"""How many iterations and seconds does iLQR take on the tasks of IDTO, and do its answers hold at half the time step?

Seconds are those of the process over all its threads, after the kernels are compiled and called once. The columns at
half the step are the same controls, judged by the exact rollout there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter, process_time

from bench import Row

from symphys.problem import load_problem, validate_options
from symphys.problems import find
from symphys.solvers import solver
from symphys.transcription import transcribe
from symphys.verification.refinement import FINER_DT, finer_problem

TASKS = ("pendulum", "acrobot", "spinner", "planar_hopper", "air_hockey", "arm_ball", "mini_cheetah_ahead")
COLUMNS = {
    "task": "a shipped problem",
    "steps": "of the motion",
    "iterations": "of iLQR",
    "cpu_s": "seconds of processors",
    "wall_s": "seconds of the clock",
    "cost": "in the end",
    "worst": "largest error of a target in units of its tolerance",
    "cost_finer": "cost at half the time step",
    "worst_finer": "largest error at half the time step",
}


def rows(quick: bool = False, tasks: tuple[str, ...] = TASKS) -> Iterator[Row]:
    """Yield a row for each task; ``quick``: three iterations of the pendulum."""
    for name in tasks[:1] if quick else tasks:
        problem = load_problem(find(name))
        made, chosen = transcribe(problem), solver("ilqr")
        options = validate_options(chosen.Options, problem.solver_tables.get("ilqr", {}), problem.file, "ilqr")
        if quick:
            options = replace(options, iterations=3)
        shooting = made.shooting
        chosen.solve(shooting, shooting.start(0), replace(options, iterations=1), 0)  # compiles what it calls
        began, worked = perf_counter(), process_time()
        found = chosen.solve(shooting, shooting.start(0), options, 0)
        wall, cpu = perf_counter() - began, process_time() - worked
        verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
        row: Row = {"task": name, "steps": problem.simulation.steps, "iterations": found.trace[-1].iteration}
        row |= {"cpu_s": cpu, "wall_s": wall, "cost": verdict.objective, "worst": verdict.worst}
        yield row | {"cost_finer": finer.objective, "worst_finer": finer.worst}
