"""A finger pushes a box on the ground: the friction of the box, and the goal that it reaches."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve

from symphys import problems
from symphys.problem import load_problem
from symphys.transcription import transcribe
from symphys.verification.refinement import FINER_DT, finer_problem


def test_the_ground_stops_the_box_as_coulomb_says() -> None:
    """From 1 m/s it slides by v^2 / (2 mu g) without a turn."""
    problem = load_problem(problems.find("push_box"))
    sliding = problem.set({"body.box.velocity": [1, 0, 0], "body.feet.velocity": [1, 0, 0]})
    made = transcribe(sliding, backend="casadi")
    motion = made.simulate(made.shooting.start(0))
    assert motion["box.position"][-1, 0] == pytest.approx(1 / (2 * 0.5 * 9.81), rel=0.02)
    assert np.abs(motion["box.position"][:, 1]).max() < 1e-6


@pytest.mark.thorough
def test_the_box_comes_to_its_goal_and_half_the_step_agrees() -> None:
    made = shipped("push_box")
    found = solve("ilqr", made)
    assert made.judge(found.z).solved
    assert finer_problem(made, FINER_DT).judge(found.z).worst < 1.0
