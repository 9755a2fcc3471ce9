"""The journal's robot, faster: the first steps here, lessons, with legs and motors too, as ``thorough``."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import first_steps

from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.solvers import SOLVERS, Outcome
from symphys.transcription import Transcription, transcribe

SPEED = "speed [m/s]"


def taught(name: str, settings: dict[str, object], seed: int = 0) -> tuple[Transcription, Outcome]:
    """The problem with these settings, and what the solver found."""
    made = transcribe(load_problem(find(name), settings), exact=True)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    options = solver_options(made.problem, "stochastic")
    return made, SOLVERS["stochastic"].solve(made.shooting, made.shooting.start(seed), options, seed)


@pytest.mark.thorough
def test_its_first_steps_get_faster() -> None:
    """Over a second and a half, from values alone: faster than by hand."""
    made, (z,) = first_steps("gait_robot_fast", 1.5, 160)
    assert made.judge(z).outputs[SPEED] > 1.3 * made.judge(made.shooting.start(0)).outputs[SPEED]


@pytest.mark.thorough
def test_a_short_lesson_helps() -> None:
    """Sixty batches of 16 for 3 s: faster than by hand, as the trace tells it."""
    asked = {"iterations": 60, "samples": 16, "patience": 0.0}
    made, found = taught("gait_robot_fast", {"simulation.duration": 3} | {f"solver.stochastic.{k}": v
                                                                          for k, v in asked.items()})  # fmt: skip
    before = made.judge(made.shooting.start(0)).outputs[SPEED]
    after = made.judge(found.z).outputs[SPEED]
    assert after > 1.3 * before
    assert found.trace[-1].outputs[SPEED] == pytest.approx(after, rel=1e-9)
    assert found.z[0] == 80


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_is_faster_than_the_journal_s(seed: int) -> None:
    """Upright, within its joints' 45 degrees, which the servos hold."""
    made, found = taught("gait_robot_fast", {}, seed)
    assert made.judge(found.z).solved
    assert made.judge(found.z).outputs[SPEED] > 1.17


@pytest.mark.thorough
def test_legs_and_motors_are_chosen_too() -> None:
    made, found = taught("gait_robot_build", {})
    z = made.shooting.by_block(found.z)
    assert made.judge(found.z).outputs[SPEED] > 1.17
    assert abs(z["front_thighs"][0, 0] + 0.1) > 0.005 or abs(z["hind_thighs"][0, 0] + 0.1) > 0.005
    assert np.abs(made.simulate(found.z).joint_separation).max() < 5e-3
