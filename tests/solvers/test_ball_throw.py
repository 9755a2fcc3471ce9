"""The shipped ball throw, from its guess, with the default options: what each solver needs for it.

The bounds are those of the reference experiment (Degrave et al. 2016: 88 gradients) or tighter.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from toys import solve

import symphys.problems
from symphys.problem import load_problem
from symphys.shooting import ShootingProblem
from symphys.solvers import Status
from symphys.transcription import transcribe

SHIPPED = Path(next(iter(symphys.problems.__path__))) / "ball_throw.toml"
FEWEST_GRADIENTS = 45
FEWEST_JACOBIANS = 15
TARGETS = [6.0, 8.0, 10.0, 12.0, 14.0]


@cache
def throw(distance: float, folder: Path) -> ShootingProblem:
    """The shipped problem with another target [m]."""
    text = SHIPPED.read_text(encoding="utf-8")
    assert "[10, 0]" in text
    path = folder / f"throw_{distance:g}.toml"
    path.write_text(text.replace("[10, 0]", f"[{distance:g}, 0]"), encoding="utf-8")
    return transcribe(load_problem(path)).shooting


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("throws")


@pytest.mark.parametrize("distance", TARGETS)
def test_descent(distance: float, folder: Path) -> None:
    found = solve("gradient", throw(distance, folder))
    assert found.status is Status.MET
    assert found.counts.gradients <= FEWEST_GRADIENTS


@pytest.mark.parametrize("distance", TARGETS)
def test_least_squares(distance: float, folder: Path) -> None:
    found = solve("least_squares", throw(distance, folder))
    assert found.status is Status.MET
    assert found.counts.jacobians <= FEWEST_JACOBIANS


@pytest.mark.parametrize("hessian", ["limited-memory", "exact"])
@pytest.mark.parametrize("distance", TARGETS)
def test_ipopt(distance: float, hessian: str, folder: Path) -> None:
    assert solve("ipopt", throw(distance, folder), options={"hessian": hessian}).status is Status.MET


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_cma(seed: int, folder: Path) -> None:
    assert solve("cma", throw(10.0, folder), seed=seed).status is Status.MET


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 10))
def test_cma_with_every_seed(seed: int, folder: Path) -> None:
    assert solve("cma", throw(10.0, folder), seed=seed).status is Status.MET


@pytest.mark.parametrize("seed", range(1, 6))
def test_derivatives_lead_there_from_perturbed_guesses(seed: int, folder: Path) -> None:
    for name in ("gradient", "least_squares", "ipopt"):
        assert solve(name, throw(10.0, folder), seed=seed).status is Status.MET
