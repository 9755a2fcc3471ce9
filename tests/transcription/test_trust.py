"""The examination of a solution: right gradients pass, wrong ones do not, coarse answers are told apart from fine."""

from __future__ import annotations

import numpy as np
import pytest

from symphys import trust
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import judge_for, transcribe

THROW = np.array([3.0, 0.1, 3.0, 0.0, -9.0, 0.5])


@pytest.fixture(scope="module")
def throw():
    return transcribe(load_problem(find("ball_throw")), backend="casadi")


def test_right_gradients_pass(throw):
    for row in trust.compare_gradient(throw, THROW):
        assert row["error"] < 1e-6
        assert row["scale"] > 0


def test_wrong_gradients_are_rejected(throw):
    """The derivative of another problem (weaker gravity) does not pass as this one's."""
    other = transcribe(load_problem(find("ball_throw"), {"world.gravity": [0, 0, -8]}))
    value, _ = trust.probe(throw)
    _, gradient = trust.probe(other)
    wrong = np.array(gradient(THROW)).ravel()
    errors = [trust._compare_block(value, block, THROW, wrong)["error"] for block in throw.shooting.blocks]
    assert max(errors) > 1e-2


def test_examination_reports_refinements_and_contacts(throw):
    found = trust.examine(throw, THROW)
    assert [row["what"] for row in found["refined"]] == ["dt / 2", "sweeps x 2"]
    assert found["refined"][0]["objective"] == pytest.approx(throw.judge(THROW).objective, rel=1e-2)
    assert found["residual"] < 1e-9
    assert found["deepest"] < 1e-9
    assert found["multiple_impacts"] == 0


def test_refined_answers_are_those_of_the_refined_problem():
    """The same numbers as a file with half the step, or twice the sweeps; on a shot that depends on both."""
    settings = {"simulation.dt": 0.02, "simulation.duration": 3}
    shot = transcribe(load_problem(find("bank_shot"), settings))
    z = shot.shooting.start(1)
    halved = judge_for(load_problem(find("bank_shot"), settings | {"simulation.dt": 0.01}))(z)
    doubled = judge_for(
        load_problem(find("bank_shot"), settings | {"simulation.sweeps": 2 * shot.problem.simulation.sweeps})
    )(z)
    found = trust.examine(shot, z)["refined"]
    assert [row["objective"] for row in found] == [halved.objective, doubled.objective]
    assert [row["worst"] for row in found] == [halved.worst, doubled.worst]
    assert halved.objective != pytest.approx(shot.judge(z).objective, rel=1e-6)
