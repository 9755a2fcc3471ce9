"""Feedback as a result: a file of the run, and motions by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from worlds.swung import TABLES

import symphys
from symphys.errors import SymphysError
from symphys.problem import problem_of_tables

UPRIGHT = {
    "simulation": {"duration": 0.8, "dt": 0.02},
    "body": [{**TABLES["body"][0], "position": [0, 0, 1]}],
    "joint": [{**TABLES["joint"][0], "motor": {"torque": {"torque": 100.0}}}],
    "variable": [{"name": "twist", "sets": "pivot.command", "knots": 20, "guess": 0.5, "scale": 2.0}],
    "cost": [
        {"name": "way", "at": "always", "squares": "[pivot.angle, 0.1 * pivot.rate]", "weight": 40},
        {"name": "effort", "at": "always", "squares": "pivot.command", "weight": 0.001},
    ],
}
"""A pole on a motor, to be held upright."""


@pytest.mark.slow
def test_a_pole_is_held_from_a_disturbed_start_with_gains_and_falls_without(tmp_path: Path) -> None:
    symphys.solve(problem_of_tables(UPRIGHT), "ilqr", folder=tmp_path, backend="casadi", iterations=10)
    (folder,) = [each.parent for each in tmp_path.rglob("gains.npz")]
    solution = symphys.read(folder)
    assert solution.gains["by_state"].shape == (len(solution.gains["knot"]), 3)
    planned = solution.trajectory["pivot.angle"]
    np.testing.assert_allclose(solution.rollout()["pivot.angle"], planned, atol=1e-9)
    off = {each: solution.rollout({"pivot.angle": 0.1}, each)["pivot.angle"][-1] for each in (False, True)}
    assert abs(off[False] - planned[-1]) > 0.3
    assert abs(off[True] - planned[-1]) < 0.01
    with pytest.raises(SymphysError, match=r"pivot\.angl"):
        solution.rollout({"pivot.angl": 0.1})


@pytest.mark.slow
def test_solvers_without_feedback_say_so(tmp_path: Path) -> None:
    solution = symphys.solve("ball_throw", "least_squares", folder=tmp_path, backend="casadi", iterations=1)
    assert solution.gains == {}
    with pytest.raises(SymphysError, match="ilqr"):
        solution.rollout()
