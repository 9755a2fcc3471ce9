"""The ball throw of Degrave et al. (2016): work and time of every solver, beside the paper's.

Run with ``make bench``. Counts do not depend on the machine; times do, so ratios are what to compare.
"""

from __future__ import annotations

import os
import platform
from statistics import median
from time import perf_counter

from symphys.problem import load_problem
from symphys.problems import find
from symphys.shooting import ShootingProblem
from symphys.solvers import solver
from symphys.solvers.core.outcome import Counts, Status
from symphys.transcription import Transcription, transcribe

SEEDS = 10
DISTANCES = range(6, 15)
REPEATS = 25
PAPER = {"gradient iterations": 88, "CMA-ES iterations": 2422, "ratio of iterations": 27, "ratio of times": 3.7}


def transcription(distance: int = 10) -> Transcription:
    """The throw to another distance, otherwise the shipped file, by the default backend."""
    value = f"ball.position[0:2] - [{distance}, 0]"
    return transcribe(load_problem(find("ball_throw"), {"target.0.value": value}), exact=True)


def shooting(distance: int = 10) -> ShootingProblem:
    """Its shooting problem."""
    return transcription(distance).shooting


def solve(problem: ShootingProblem, name: str, seed: int = 0) -> tuple[bool, Counts, float]:
    """(met, counts, seconds) of one solve with the solver's defaults."""
    chosen = solver(name)
    chosen.prepare()
    began = perf_counter()
    outcome = chosen.solve(problem, problem.start(seed), chosen.Options(), seed)
    return outcome.status is Status.MET, outcome.counts, perf_counter() - began


def call_times(problem: ShootingProblem) -> dict[str, float]:
    """Milliseconds of one call, the best of REPEATS."""
    Z = problem.start(1)[None]
    times = {}
    for name in ("value", "gradient", "jacobian"):
        function = getattr(problem.evaluator, name)
        runs = []
        for _ in range(REPEATS):
            began = perf_counter()
            function(Z, 0.0)
            runs.append(perf_counter() - began)
        times[name] = 1e3 * min(runs)
    return times


def main() -> None:
    """Print everything."""
    made = transcription()
    print(f"machine: {platform.machine()}, {os.cpu_count()} cores")
    print(f"evaluated by {made.backend}; {made.backend.seconds:.2f} s until it could")
    times = call_times(made.shooting)
    print("500 steps, ms, best of", REPEATS, {name: round(value, 2) for name, value in times.items()})
    print("\ndistance  gradient: met, gradients, rollouts   least squares: met, jacobians   ipopt: met, gradients")
    for distance in DISTANCES:
        problem = shooting(distance)
        (met, counts, _), (fit, jacobians, _), (done, steps, _) = (
            solve(problem, name) for name in ("gradient", "least_squares", "ipopt")
        )
        print(f"{distance:8d}  {met!s:>13} {counts.gradients:10d} {counts.rollouts:9d}", end="")
        print(f"   {fit!s:>18} {jacobians.jacobians:10d}   {done!s:>9} {steps.gradients:10d}")
    compare()


def compare() -> None:
    """CMA-ES against first-order descent over the seeds, as the paper compares them."""
    problem = shooting()
    descents = [solve(problem, "gradient", seed) for seed in range(SEEDS)]
    searches = [solve(problem, "cma", seed) for seed in range(SEEDS)]
    gradients = median(counts.gradients for _, counts, _ in descents)
    evaluations = median(counts.rollouts for _, counts, _ in searches)
    fits = [solve(problem, "least_squares", seed) for seed in range(SEEDS)]
    seconds = [median(t for _, _, t in runs) for runs in (descents, searches, fits)]
    print(f"\nseeds met: gradient {sum(m for m, _, _ in descents)}, cma {sum(m for m, _, _ in searches)} of {SEEDS}")
    print("cma evaluations by seed:", [counts.rollouts for _, counts, _ in searches])
    print(f"median gradients {gradients}, median evaluations {evaluations}; seconds {seconds[0]:.3f}, {seconds[1]:.3f}")
    print(f"median seconds of least squares {seconds[2]:.4f}")
    print(f"ratio of evaluations {evaluations / gradients:.1f}, of times {seconds[1] / seconds[0]:.1f}; paper: {PAPER}")


if __name__ == "__main__":
    main()
