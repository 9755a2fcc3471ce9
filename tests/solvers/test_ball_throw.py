"""Every solver meets the shipped ball throw from its guess, with default options and bounded work.

The bounds are those of the reference experiment (Degrave et al. 2016: 88 gradients) or tighter.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from data.shipped import seeds
from tools.repeats import few
from worlds.toys import solve

import symphys.problems
from symphys.problem import load_problem
from symphys.shooting import ShootingProblem
from symphys.solvers import Status
from symphys.transcription import transcribe

SHIPPED = Path(next(iter(symphys.problems.__path__))) / "ball_throw.toml"
FEWEST_GRADIENTS = 45
FEWEST_JACOBIANS = 15
TARGETS = [6.0, 8.0, 10.0, 12.0, 14.0]
QUICK = [("casadi", 6.0), ("casadi", 14.0), ("simd", 10.0)]
OTHERS = [("c", 10.0), *((backend, distance) for backend in ("casadi", "simd") for distance in TARGETS)]
every_throw = pytest.mark.parametrize(
    ("backend", "distance"),
    [*QUICK, *(pytest.param(*each, marks=pytest.mark.thorough) for each in OTHERS if each not in QUICK)],
)


@cache
def throw(distance: float, backend: str = "auto") -> ShootingProblem:
    """The shipped problem with another target [m]; in casadi's C, which grows with the steps, a fifth of these."""
    settings: dict[str, object] = {"target.0.value": f"ball.position[0:2] - [{distance:g}, 0]"}
    if backend == "c":
        settings["simulation.dt"] = 0.05
    made = transcribe(load_problem(SHIPPED, settings), backend=backend)
    if backend not in ("auto", made.backend.name):
        pytest.skip(made.backend.note)
    return made.shooting


@pytest.mark.slow
@every_throw
def test_descent(backend: str, distance: float) -> None:
    found = solve("gradient", throw(distance, backend))
    assert found.status is Status.MET
    assert found.counts.gradients <= FEWEST_GRADIENTS


@pytest.mark.slow
@every_throw
def test_least_squares(backend: str, distance: float) -> None:
    found = solve("least_squares", throw(distance, backend))
    assert found.status is Status.MET
    assert found.counts.jacobians <= FEWEST_JACOBIANS


@pytest.mark.slow
@pytest.mark.parametrize("hessian", ["limited-memory", "exact"])
@every_throw
def test_ipopt(backend: str, distance: float, hessian: str) -> None:
    assert solve("ipopt", throw(distance, backend), options={"hessian": hessian}).status is Status.MET


@pytest.mark.slow
@few("backend", ["casadi", "c", "simd"], 1)
@seeds(3)
def test_cma(backend: str, seed: int) -> None:
    assert solve("cma", throw(10.0, backend), seed=seed).status is Status.MET


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3, 10))
def test_cma_with_every_seed(seed: int) -> None:
    assert solve("cma", throw(10.0), seed=seed).status is Status.MET


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(2, 6))])
def test_derivatives_lead_there_from_perturbed_guesses(seed: int) -> None:
    for name in ("gradient", "least_squares", "ipopt"):
        assert solve(name, throw(10.0), seed=seed).status is Status.MET
