"""Who goes through whom between two instants is found; who bounces, misses or is slow is not taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from tools.repeats import few

from symphys.transcription import Transcription
from symphys.verification.near_misses import tunnelling

SHOT = """
[simulation]
duration = {duration}
dt = 0.01
[world]
gravity = [0, 0, 0]
[[body]]
name = "ball"
shape = {{ sphere = {{ radius = 0.05 }} }}
position = [0, 0, 1]
mass = 1
{surface}
[[variable]]
name = "v"
sets = "ball.velocity"
guess = [{speed}, 0, 0]
[[cost]]
name = "c"
value = "ball.position[0]"
"""
WALL = """
[[block]]
name = "wall"
shape = {{ box = {{ size = [{thickness}, 4, 4] }} }}
position = [1.07, 0, 1]
restitution = 1
"""
RIDGE = """
[[terrain]]
name = "ridge"
height = "3 * exp(-((x - 1.1) / 0.1)**2)"
"""
BODY = """
[[body]]
name = "plate"
shape = { box = { size = [0.02, 1, 1] } }
mass = 1
position = [1.07, 0, 1]
"""


def found(shot: Transcription, moved: float = 0.0) -> dict:
    """Of the guess, whose recorded ball is shifted by ``moved`` [m] along its way from the middle of its motion on."""
    record = shot.record(shot.shooting.start(0))
    position = record.motion.position
    position[len(position) // 2 :, 0, 0] += moved
    return tunnelling(shot.rollout, record)


@few("surface", [WALL.format(thickness=0.02), WALL.format(thickness=0.3), RIDGE, BODY], 2)
def test_a_ball_that_is_before_a_wall_and_then_behind_it_went_through(make, surface):
    """The engine's walls are sent away; the ball then flies as if there was none, 0.4 m a step."""
    shot = make(
        SHOT.format(duration=0.04, surface=surface.replace("[1.07", "[91.07").replace("x - 1.1", "x - 99"), speed=40)
    )
    there = make(SHOT.format(duration=0.04, surface=surface, speed=40))
    record = shot.record(shot.shooting.start(0))
    if len(record.motion.body_names) > 1:
        record.motion.position[:, 1, 0] -= 90
    told = tunnelling(there.rollout, record)
    assert told["passed"] > 1
    assert told["passed_at"]["contact"] in ("ball-wall", "ball-ridge", "ball-plate")
    assert 0.02 <= told["passed_at"]["time"] <= 0.03
    assert told["passed_at"]["depth"] >= 0.05


@pytest.mark.parametrize("speed", [5, 20, 40, 200])
def test_a_ball_that_bounces_went_through_nothing(make, speed):
    """Off the wall before it, as the engine has it; the middle of a step is on the ball's side of the wall."""
    told = found(make(SHOT.format(duration=0.2, surface=WALL.format(thickness=0.1), speed=speed)))
    assert told["passed"] < 0.05


def test_who_is_slow_cannot_pass_unseen(make):
    told = found(make(SHOT.format(duration=0.2, surface=WALL.format(thickness=0.1), speed=1)))
    assert told == {"passed": 0.0, "passed_at": None}


def test_a_body_ends_below_terrain(make):
    """Its last step is looked at to its end, which no recorded gap shows."""
    shot = make(SHOT.format(duration=0.1, surface='[[terrain]]\nname = "hill"\nheight = "0 * x"', speed=0))
    record = shot.record(shot.shooting.start(0))
    record.motion.position[-1, 0, 2] = -1.0
    told = tunnelling(shot.rollout, record)
    assert told["passed_at"] == {"contact": "ball-hill", "time": pytest.approx(0.1), "depth": pytest.approx(1.05)}
    assert np.isfinite(told["passed"])
