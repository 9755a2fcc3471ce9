"""A dribbled ball, against what each bounce takes and each push must give."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import met, shipped

from symphys.trajectory import Trajectory

GRAVITY, TOP, RADIUS, RESTITUTION, PERIOD, STEP = 9.81, 0.9, 0.12, 0.8, 0.65, 0.01
BACK = np.sqrt(2 * GRAVITY * (TOP - RADIUS))
"""[m/s] Speed at the ground of a flight back to the hand."""


def bounces(motion: Trajectory) -> list[int]:
    """The samples after the ball turned around near the ground; one in each period, and at its end the ball is up."""
    height, speed = motion["ball.position"][:, 2], motion["ball.velocity"][:, 2]
    turned = np.flatnonzero((height[1:] < RADIUS + 0.1) & (speed[1:] > 0.5) & (speed[:-1] < -0.5)) + 1
    assert [int(motion.time[k] / PERIOD) for k in turned] == [0, 1, 2]
    for period in (1, 2, 3):
        top = round(period * PERIOD / STEP)
        assert abs(height[top] - TOP) < 0.02
        assert abs(speed[top]) < 0.2
    return turned.tolist()


@pytest.mark.thorough
def test_a_descent_finds_three_dribbles() -> None:
    made = shipped("dribble")
    (found,) = met("gradient", made, of=6, wanted=1)
    motion = made.simulate(found.z)
    speed = motion["ball.velocity"][:, 2]
    for k in bounces(motion):
        assert speed[k] > BACK - 0.4
        assert speed[k] < -RESTITUTION * speed[k - 1] + 2 * GRAVITY * STEP


@pytest.mark.thorough
def test_each_push_gives_what_the_bounce_takes() -> None:
    """A push down to 1 / e of the speed that a flight back takes; a fall from rest has that speed itself."""
    made = shipped("dribble")
    (found,) = met("cma", made, of=2, wanted=1)
    motion = made.simulate(found.z)
    speed = motion["ball.velocity"][:, 2]
    for k in bounces(motion):
        assert speed[k] == pytest.approx(BACK, abs=0.15)
        assert -speed[k - 1] == pytest.approx(BACK / RESTITUTION, abs=0.25)


def test_without_a_hand_the_ball_comes_less_high() -> None:
    """A hand that carries itself only: the ball falls, and comes back to 0.64 of its height."""
    motion = shipped("dribble").simulate(np.full(40, GRAVITY))
    height = motion["ball.position"][:, 2] - RADIUS
    first = int(np.argmin(height[:60]))
    assert height[first:100].max() == pytest.approx(RESTITUTION**2 * (TOP - RADIUS), abs=0.01)
