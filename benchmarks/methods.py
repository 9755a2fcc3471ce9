"""How much work does each solver need on the ball throw of Degrave et al. and on problems that need smoothing?

Their ball throw (2016): counts of gradients and rollouts, medians over seeds, and for other distances. Then problems
that friction holds, whose gradient is zero at the guess, and others, with stages of smoothing and without. Objectives
are exact. Counts do not depend on the machine; seconds do, so their ratios are what to compare.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import median
from time import perf_counter

from bench import Row

from symphys.problem import load_problem, validate_options
from symphys.problems import find
from symphys.solvers import Outcome, solver
from symphys.transcription import Transcription, transcribe

COLUMNS = {
    "problem": "and what is changed of it",
    "solver": "with the options of the problem's file",
    "smoothing": "stages, one after the other",
    "solved": "seeds that end with everything met, of all",
    "objective": "exact, median over seeds",
    "slopes": "gradients and Jacobians, median over seeds",
    "rollouts": "without derivatives, median over seeds",
    "seconds": "median over seeds",
    "paper": "iterations that were published",
}
PAPER = {"gradient": 88, "cma": 2422}
DISTANCES = (6, 7, 8, 9, 11, 12, 13, 14)
SCHEDULES: tuple[tuple[float, ...], ...] = ((0.0,), (0.1,), (0.01,), (0.01, 0.0), (0.1, 0.01, 0.0))
DESCENTS = ("gradient", "least_squares", "ipopt")
CASES: tuple[tuple[str, str, dict[str, object], Sequence[str], int], ...] = (
    ("a sled that friction holds", "sled", {}, (*DESCENTS, "cma"), 5),
    ("a sled, pushed harder by the guess: it slides", "sled", {"variable.push.guess": [5.0, 0.0]}, DESCENTS, 5),
    ("a ball thrown: nothing holds it", "ball_throw", {}, DESCENTS, 5),
    ("a bank shot: nothing holds it", "bank_shot", {}, ("gradient", "least_squares"), 5),
    ("two balls, a guess that misses", "two_balls", {"variable.force.guess": [3.0, 1.0]}, ("gradient", "ipopt"), 1),
)
"""Title, problem, settings, solvers, seeds."""


def rows(quick: bool = False, seeds: int = 10) -> Iterator[Row]:
    """Yield the ball throw, its other distances, and the problems with stages of smoothing."""
    made = transcribe(load_problem(find("ball_throw")), exact=True)
    for name in DESCENTS[:2] if quick else (*DESCENTS, "cma"):
        yield solves(made, "ball throw", name, (0.0,), 1 if quick else seeds) | {"paper": PAPER.get(name)}
    if quick:
        return
    for distance in DISTANCES:
        settings = {"target.0.value": f"ball.position[0:2] - [{distance}, 0]"}
        made = transcribe(load_problem(find("ball_throw"), settings), exact=True)
        for name in DESCENTS:
            yield solves(made, f"ball throw to {distance} m", name, (0.0,), 1)
    for title, problem, settings, solvers, count in CASES:
        made = transcribe(load_problem(find(problem), settings))
        for name in solvers:
            for stages in SCHEDULES:
                yield solves(made, title, name, stages, count)


def solves(made: Transcription, title: str, name: str, stages: tuple[float, ...], seeds: int) -> Row:
    """Solve from several seeds by one solver with one schedule."""
    found = [solved(made, name, stages, seed) for seed in range(seeds)]
    outcomes = [outcome for outcome, _ in found]
    verdicts = [made.judge(outcome.z) for outcome in outcomes]
    return {
        "problem": title,
        "solver": name,
        "smoothing": ", ".join(f"{each:g}" for each in stages),
        "solved": f"{sum(verdict.solved for verdict in verdicts)} of {seeds}",
        "objective": median(verdict.objective for verdict in verdicts),
        "slopes": median(outcome.counts.gradients + outcome.counts.jacobians for outcome in outcomes),
        "rollouts": median(outcome.counts.rollouts for outcome in outcomes),
        "seconds": median(seconds for _, seconds in found),
        "paper": None,
    }


def solved(made: Transcription, name: str, stages: tuple[float, ...], seed: int) -> tuple[Outcome, float]:
    """Solve once; returns the outcome and the seconds of the solver."""
    chosen, problem = solver(name), made.problem
    options = validate_options(chosen.Options, problem.solver_tables.get(name, {}), problem.file, name)
    shooting = replace(made.shooting, smoothing=stages)
    chosen.prepare()
    began = perf_counter()
    outcome = chosen.solve(shooting, shooting.start(seed), options, seed)
    return outcome, perf_counter() - began
