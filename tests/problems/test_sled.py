"""The sled: without smoothing nothing that follows gradients moves it; in stages all bring it to its place."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from data.shipped import seeds
from tools.repeats import thorough

from symphys import problems
from symphys.problem import load_problem, validate_options
from symphys.solvers import Outcome, Status, solver
from symphys.transcription import Transcription, transcribe


@cache
def staged() -> Transcription:
    return transcribe(load_problem(problems.find("sled")))


def sled(smoothing: tuple[float, ...] = ()) -> Transcription:
    """In these stages, or in the file's; one kernel serves all."""
    made = staged()
    return replace(made, shooting=replace(made.shooting, smoothing=smoothing)) if smoothing else made


def solve(name: str, made: Transcription, seed: int = 0) -> Outcome:
    chosen, problem = solver(name), made.problem
    options = validate_options(chosen.Options, problem.solver_tables.get(name, {}), problem.file, name)
    return chosen.solve(made.shooting, made.shooting.start(seed), options, seed)


@pytest.mark.parametrize("name", ["gradient", "least_squares", "ipopt"])
@seeds(2)
def test_friction_holds_it(name: str, seed: int) -> None:
    """Below 3.9 N it stays where it is, so that the gradient is rounding and nothing else."""
    made = sled((0.0,))
    found = solve(name, made, seed)
    gradient = made.shooting.evaluator.gradient(made.shooting.start(seed)[None], 0.0).gradient
    assert gradient is not None and np.abs(gradient).max() < 1e-10
    assert found.status is Status.CONVERGED and "friction holds" in found.advice
    assert made.judge(found.z).objective == pytest.approx(1.25, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "most"), [("gradient", 160), ("least_squares", 60), thorough("ipopt", 250), ("cma", 0)]
)
@seeds(2)
def test_stages_let_go_of_it(name: str, most: int, seed: int) -> None:
    made = sled()
    found = solve(name, made, seed)
    assert found.status is Status.MET
    assert made.judge(found.z).solved
    assert found.counts.gradients + found.counts.jacobians <= most
    assert [stage.smoothing for stage in found.stages] == [0.1, 0.01, 0.0]


@pytest.mark.parametrize("name", ["gradient", "least_squares"])
def test_smoothing_alone_does_not_do(name: str) -> None:
    """At a constant smoothing the solver is content with what the exact sled misses."""
    made = sled((0.1,))
    assert not made.judge(solve(name, made).z).solved
