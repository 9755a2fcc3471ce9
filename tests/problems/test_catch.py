"""A bowl catches a ball: its flight, its rest between two plates, and the catch."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve

from symphys.verification.refinement import FINER_DT, finer_problem

RADIUS, LEAN = 0.05, np.deg2rad(20)


def test_the_guess_catches_the_ball_and_puts_it_elsewhere() -> None:
    """A parabola until the catch; then the ball touches both plates, r / cos(20 degrees) above their seam."""
    made = shipped("catch", "casadi")
    motion = made.simulate(made.shooting.start(0))
    flies = motion.time < 0.55
    time = motion.time[flies]
    flight = np.stack([-1 + 1.6 * time, 1 + 2.6 * time - 9.81 / 2 * time**2], axis=1)
    np.testing.assert_allclose(motion["ball.position"][flies][:, [0, 2]], flight, atol=1e-9)
    rest = motion["ball.position"][-1] - motion["bowl.position"][-1]
    np.testing.assert_allclose(rest, [0, 0, RADIUS / np.cos(LEAN)], atol=1e-3)
    assert abs(motion["bowl.position"][-1, 0] - 1) > 0.4


@pytest.mark.thorough
def test_the_ball_is_caught_put_down_and_half_the_step_agrees() -> None:
    """From each of five seeds, and at half the step of most; rounding decides at which kinks iLQR ends."""
    made = shipped("catch")
    finer, found = finer_problem(made, FINER_DT), [solve("ilqr", made, seed).z for seed in range(5)]
    assert all(made.judge(z).solved for z in found)
    assert all(made.judge(z).objective < 0.07 for z in found)
    assert sum(finer.judge(z).worst < 1 for z in found) >= 3
