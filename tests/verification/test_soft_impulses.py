"""Recorded forces of soft contacts account for all momentum, in the steps in which surfaces meet or part too."""

from __future__ import annotations

import pytest

import symphys
from symphys.transcription import transcribe
from symphys.verification.balance import balance


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_ball_that_bounces_on_soft_ground_keeps_its_account(friction: float) -> None:
    ball = {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 0.4]}
    tables = {
        "simulation": {"duration": 1.0, "dt": 0.01},
        "body": [ball | {"velocity": [1, 0, 0]}],
        "ground": {"friction": friction},
        "contact": {"frequency": 15.0, "damping": 0.3},
        "variable": [{"name": "throw", "sets": "ball.velocity", "guess": [1, 0, 0]}],
        "cost": [{"name": "way", "value": "ball.position[0]"}],
    }
    made = transcribe(symphys.load(tables), backend="casadi")
    record = made.record(made.shooting.start(0))
    assert balance(made.timed(record).rollout, record)["momentum"] < 1e-12
