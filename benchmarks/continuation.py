"""What smoothing and stages of it buy, and what they cost: every solver on problems that need them and that do not.

Run with ``make bench``. All objectives are exact. Counts do not depend on the machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from symphys.problem import load_problem, validate_options
from symphys.problems import find
from symphys.solvers import Outcome, solver
from symphys.transcription import Transcription, transcribe

SCHEDULES: tuple[tuple[float, ...], ...] = ((0.0,), (0.1,), (0.01,), (0.01, 0.0), (0.1, 0.01, 0.0))
DESCENTS = ("gradient", "least_squares", "ipopt")
CASES: tuple[tuple[str, str, dict[str, object], Sequence[str], int], ...] = (
    ("a sled that friction holds", "sled", {}, (*DESCENTS, "cma"), 5),
    ("the same, pushed harder by the guess: it slides", "sled", {"variable.push.guess": [5.0, 0.0]}, DESCENTS, 5),
    ("a ball thrown: nothing holds it", "ball_throw", {}, DESCENTS, 5),
    ("a bank shot: nothing holds it", "bank_shot", {}, ("gradient", "least_squares"), 5),
    ("two balls, a guess that misses", "two_balls", {"variable.force.guess": [3.0, 1.0]}, ("gradient", "ipopt"), 1),
)
"""What it is, problem, settings, solvers, seeds."""


def main() -> None:
    """Print a table for each case."""
    for title, name, settings, solvers, seeds in CASES:
        made = transcribe(load_problem(find(name), settings))
        print(f"\n{title} ({name}, {seeds} seeds): solved, exact objective, gradients and Jacobians + rollouts")
        print(f"{'':14}" + "".join(f"{', '.join(f'{each:g}' for each in stages):>30}" for stages in SCHEDULES))
        for each in solvers:
            cells = (cell(made, each, stages, seeds) for stages in SCHEDULES)
            print(f"{each:14}" + "".join(f"{found:>30}" for found in cells), flush=True)


def cell(made: Transcription, name: str, stages: tuple[float, ...], seeds: int) -> str:
    """How one solver does with one schedule, medians over the seeds."""
    found = [solve(made, name, stages, seed) for seed in range(seeds)]
    verdicts = [made.judge(outcome.z) for outcome in found]
    solved = sum(verdict.solved for verdict in verdicts)
    objective = median(verdict.objective for verdict in verdicts)
    slopes = median(outcome.counts.gradients + outcome.counts.jacobians for outcome in found)
    rollouts = median(outcome.counts.rollouts for outcome in found)
    return f"{solved}/{seeds} {objective:8.2g} {slopes:4.0f} + {rollouts:.0f}"


def solve(made: Transcription, name: str, stages: tuple[float, ...], seed: int) -> Outcome:
    """With the options of the problem's file."""
    chosen, problem = solver(name), made.problem
    options = validate_options(chosen.Options, problem.solver_tables.get(name, {}), problem.file, name)
    shooting = replace(made.shooting, smoothing=stages)
    return chosen.solve(shooting, shooting.start(seed), options, seed)


if __name__ == "__main__":
    main()
