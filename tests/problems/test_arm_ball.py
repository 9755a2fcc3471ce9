"""An arm rolls a ball that it does not touch in the guess."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve

from symphys.transcription import transcribe
from symphys.verification.refinement import FINER_DT, finer_problem

SHOULDER, LINK, ANGLES = np.array([0.0, 0.5]), 0.3, np.array([-0.5, 1.8])


def test_the_guess_touches_nothing_and_the_arm_does_not_fall() -> None:
    """Where the fingertip is follows from the lengths of the links; without torques it stays there for a second."""
    made = shipped("arm_ball", "casadi")
    motion = made.simulate(made.shooting.start(0))
    upper, fore = ANGLES[0], ANGLES.sum()
    elbow = SHOULDER + LINK * np.array([np.sin(upper), -np.cos(upper)])
    tip = elbow + LINK * np.array([np.sin(fore), -np.cos(fore)])
    gap = np.linalg.norm(tip - [0.135, 0.06]) - 0.02 - 0.06
    assert gap == pytest.approx(0.01702, abs=1e-5)
    middle = elbow + LINK / 2 * np.array([np.sin(fore), -np.cos(fore)])
    np.testing.assert_allclose(motion["fore.position"][:, [0, 2]], np.tile(middle, (101, 1)), atol=1e-9)
    assert np.ptp(motion["ball.position"][:, 0]) == 0.0


def test_gravity_acts_on_the_ball_alone() -> None:
    """Without the laws that hold the arm it falls."""
    made = shipped("arm_ball", "casadi")
    held = made.problem.set({"force.upper_held.value": "0", "force.fore_held.value": "0"})
    fallen = transcribe(held, backend="casadi")
    motion = fallen.simulate(fallen.shooting.start(0))
    assert np.abs(motion["shoulder.rate"]).max() > 1.0


@pytest.mark.thorough
def test_stages_roll_the_ball_and_half_the_step_agrees() -> None:
    made = shipped("arm_ball")
    found = solve("ilqr", made)
    verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
    assert verdict.solved
    assert verdict.objective < 0.5
    assert finer.worst < 1.0
    motion = made.simulate(found.z)
    rolled = -np.ptp(motion["ball.position"][:, 0]) / 0.06
    turned = np.trapezoid(motion["ball.angular_velocity"][:, 1], motion.time)
    assert turned == pytest.approx(rolled, rel=0.05)
