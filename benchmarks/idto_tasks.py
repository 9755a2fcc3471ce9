"""The tasks of IDTO: iterations and seconds of iLQR, and the answer at half the time step.

    python benchmarks/idto_tasks.py [pendulum acrobot spinner planar_hopper air_hockey arm_ball mini_cheetah_ahead]

Seconds are of the process, over all its threads, after the kernels are compiled and called once; wall seconds are
beside them. ``worst`` is the largest error of a target in units of its tolerance. Both columns at half the step
are the same controls, judged by the exact rollout there.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from time import perf_counter, process_time

from symphys import threads

threads.limit()  # before numpy is loaded, as the command line does

from symphys.problem import load_problem, validate_options  # noqa: E402
from symphys.problems import find  # noqa: E402
from symphys.solvers import solver  # noqa: E402
from symphys.transcription import transcribe  # noqa: E402
from symphys.verification.refinement import FINER_DT, finer_problem  # noqa: E402

TASKS = ("pendulum", "acrobot", "spinner", "planar_hopper", "air_hockey", "arm_ball", "mini_cheetah_ahead")


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=TASKS)
    print("| task | steps | iterations | s of CPU | s | cost | worst | cost at dt / 2 | worst at dt / 2 |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in parser.parse_args().tasks:
        print(row(name), flush=True)


def row(name: str) -> str:
    """Of one task."""
    problem = load_problem(find(name))
    made = transcribe(problem)
    chosen = solver("ilqr")
    options = validate_options(chosen.Options, problem.solver_tables.get("ilqr", {}), problem.file, "ilqr")
    chosen.solve(made.shooting, made.shooting.start(0), replace(options, iterations=1), 0)  # compiles what it calls
    began, worked = perf_counter(), process_time()
    found = chosen.solve(made.shooting, made.shooting.start(0), options, 0)
    wall, cpu = perf_counter() - began, process_time() - worked
    verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
    numbers = f"{verdict.objective:.4g} | {verdict.worst:.2f} | {finer.objective:.4g} | {finer.worst:.2f}"
    work = f"{problem.simulation.steps} | {found.trace[-1].iteration} | {cpu:.1f} | {wall:.1f}"
    return f"| `{name}` | {work} | {numbers} |"


if __name__ == "__main__":
    main()
