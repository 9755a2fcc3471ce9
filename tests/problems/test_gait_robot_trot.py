"""The hand-tuned trot of the journal: at the speed that was published, on both time steps."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe


def trot(**settings: object) -> Transcription:
    found = {key.replace("__", "."): value for key, value in settings.items()}
    return transcribe(load_problem(find("gait_robot_trot"), found), backend="casadi")


def speed(made: Transcription, torque: float) -> float:
    """Ahead [m/s]."""
    return float(made.simulate(np.array([torque])).position[-1, 0, 0]) / made.problem.simulation.duration


@pytest.mark.parametrize("dt", [0.01, pytest.param(0.005, marks=pytest.mark.thorough)])
def test_it_trots_as_published(dt: float) -> None:
    """0.7 m/s; 80 N m is what the published engine's 4 N m come to in 20 iterations."""
    made = trot(simulation__dt=dt)
    assert 0.55 < speed(made, 80.0) < 0.85
    assert made.judge(np.array([80.0])).solved


def test_four_newton_metres_do_not_hold_it() -> None:
    made = trot(simulation__duration=4)
    assert made.simulate(np.array([4.0])).position[-1, 0, 2] < 0.15
    assert abs(speed(made, 4.0)) < 0.1
