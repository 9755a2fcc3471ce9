"""The shipped problems, transcribed once, and solved with the options of their files."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from symphys import problems
from symphys.codegen.backends import BEST
from symphys.problem import load_problem, validate_options
from symphys.solvers import Outcome, solver
from symphys.transcription import Transcription, transcribe
from symphys.types import Array


def seeds(count: int) -> pytest.MarkDecorator:
    """The first seed in every run of the tests, the others of ``count`` with ``make thorough``."""
    others = (pytest.param(seed, marks=pytest.mark.thorough) for seed in range(1, count))
    return pytest.mark.parametrize("seed", [0, *others])


@cache
def shipped(name: str, backend: str = BEST, settings: tuple[tuple[str, object], ...] = ()) -> Transcription:
    """A shipped problem; "casadi" is cheaper than a kernel where few rollouts are asked for."""
    return transcribe(load_problem(problems.find(name), dict(settings)), backend=backend)


def solve(name: str, made: Transcription, seed: int = 0, polish: bool = False) -> Outcome:
    """What ``symphys solve --solver NAME`` finds from that seed; ``polish``: it goes on when all is met."""
    chosen, problem, shooting = solver(name), made.problem, made.shooting
    if polish:
        shooting = replace(shooting, stop_when_met=False)
    options = validate_options(chosen.Options, problem.solver_tables.get(name, {}), problem.file, name)
    return chosen.solve(shooting, shooting.start(seed), options, seed)


def met(name: str, made: Transcription, of: int, wanted: int) -> list[Outcome]:
    """The first ``wanted`` of seeds that meet all; rounding decides which ones do where descents are rough."""
    found: list[Outcome] = []
    for seed in range(of):
        outcome = solve(name, made, seed)
        found += [outcome] if made.judge(outcome.z).solved else []
        if len(found) == wanted:
            return found
    raise AssertionError(f"only {len(found)} of {of} seeds met all")


def short_descent(name: str, iterations: int) -> tuple[float, float]:
    """Merits of a shipped problem's guess, and after so many iterations of first-order descent."""
    made = transcribe(load_problem(problems.find(name), {"solver.gradient.iterations": iterations}), backend="casadi")
    found = solve("gradient", made)
    merits = made.shooting.evaluator.value(np.stack([made.shooting.start(0), found.z]), 0.0).merit
    return float(merits[0]), float(merits[1])


def first_steps(name: str, seconds: float, evaluations: int, searches: int = 1) -> tuple[Transcription, list[Array]]:
    """A shipped robot over a time so short that no kernel pays, with the file's own numbers, and what CMA-ES finds."""
    problem = load_problem(problems.find(name), {"simulation.duration": seconds})
    made = transcribe(replace(problem, scenarios=None), exact=True, backend="casadi")
    chosen = solver("cma")
    asked = {"evaluations": evaluations, "samples": 8, "sigma": 0.05}
    options = validate_options(chosen.Options, asked, problem.file, "cma")
    start = made.shooting.start(0)
    return made, [chosen.solve(made.shooting, start, options, seed).z for seed in range(searches)]


def work(found: Outcome) -> int:
    """Gradients and Jacobians, or rollouts where there are none."""
    counts = found.counts
    return counts.gradients + counts.jacobians or counts.rollouts
