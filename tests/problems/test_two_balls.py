"""Two balls, one push: with the options in the file every solver comes down to the goal, and ends by itself there.

The optimum is 1.396542, at a kink of the objective.
"""

from __future__ import annotations

from functools import cache

import pytest

from symphys import problems
from symphys.problem import load_problem, validate_options
from symphys.solvers import Status, solver
from symphys.transcription import Transcription, transcribe


@cache
def two_balls() -> Transcription:
    return transcribe(load_problem(problems.find("two_balls")))


@pytest.mark.parametrize(
    ("name", "most", "iterations"),
    [
        ("gradient", 1.3975, 60),
        pytest.param("least_squares", 1.3970, 30, marks=pytest.mark.thorough),
        ("ipopt", 1.3975, 60),
        pytest.param("cma", 1.400, 700, marks=pytest.mark.thorough),
    ],
)
def test_the_goal_is_reached_without_waste(name: str, most: float, iterations: int) -> None:
    transcription = two_balls()
    chosen, problem = solver(name), transcription.problem
    options = validate_options(chosen.Options, problem.solver_tables[name], problem.file, name)
    found = chosen.solve(transcription.shooting, transcription.shooting.start(0), options)
    assert 1.3965 < transcription.judge(found.z).objective <= most
    assert found.trace[-1].iteration <= iterations
    assert found.status is not Status.FAILED
