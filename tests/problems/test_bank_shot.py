"""The bank shot: solvers that know nothing of each other find one stroke, at half the time step too."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import seeds, shipped, solve, work

from symphys import problems
from symphys.problem import load_problem
from symphys.transcription import transcribe

STROKE = [1.1299, 0.5717, 7.55, -18.18]
"""Velocity [m/s] and spin [rad/s], pursued to the last digit by least squares."""


@pytest.mark.thorough
def test_solvers_agree_on_the_stroke() -> None:
    made = shipped("bank_shot")
    found = [solve(name, made, polish=True).z for name in ("least_squares", "ipopt", "gradient")]
    assert found[0] == pytest.approx(STROKE, rel=1e-3)
    assert found[1:] == [pytest.approx(found[0], rel=1e-4)] * 2


@pytest.mark.parametrize(("name", "most"), [("gradient", 25), ("least_squares", 4), ("ipopt", 14), ("cma", 350)])
@seeds(2)
def test_every_solver_sinks_it(name: str, most: int, seed: int) -> None:
    made = shipped("bank_shot")
    found = solve(name, made, seed)
    assert made.judge(found.z).solved
    assert work(found) <= most


@pytest.mark.thorough
def test_the_stroke_holds_at_half_the_step() -> None:
    """To half a millimetre."""
    finer = transcribe(load_problem(problems.find("bank_shot"), {"simulation.dt": 0.005}), backend="casadi")
    ends = [made.simulate(np.array(STROKE)).position[-1] for made in (shipped("bank_shot"), finer)]
    assert np.abs(ends[1] - ends[0]).max() < 5e-4
