"""Arms and fingers of shipped problems are where their links put them, and touch nothing in the guess."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, short_descent

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe


@pytest.mark.slow
def test_the_guess_of_arm_ball_touches_nothing_and_the_arm_does_not_fall() -> None:
    """Where the fingertip is follows from the lengths of the links; without torques it stays there for a second."""
    made = shipped("arm_ball", "casadi")
    motion = made.simulate(made.shooting.start(0))
    upper, fore = -0.5, -0.5 + 1.8
    elbow = np.array([0.0, 0.5]) + 0.3 * np.array([np.sin(upper), -np.cos(upper)])
    tip = elbow + 0.3 * np.array([np.sin(fore), -np.cos(fore)])
    assert np.linalg.norm(tip - [0.135, 0.06]) - 0.02 - 0.06 == pytest.approx(0.01702, abs=1e-5)
    np.testing.assert_allclose(motion["fore.position"][:, [0, 2]], np.tile((elbow + tip) / 2, (101, 1)), atol=1e-9)
    assert np.ptp(motion["ball.position"][:, 0]) == 0.0


@pytest.mark.slow
def test_without_the_laws_that_hold_the_arm_it_falls() -> None:
    held = load_problem(find("arm_ball")).set({"force.upper_held.value": "0", "force.fore_held.value": "0"})
    fallen = transcribe(held, backend="casadi")
    assert np.abs(fallen.simulate(fallen.shooting.start(0))["shoulder.rate"]).max() > 1.0


def test_the_net_of_arm_reach_has_as_many_weights_as_that_of_the_paper() -> None:
    assert sum(variable.guess.size for variable in load_problem(find("arm_reach")).variables) == 17284


@pytest.mark.slow
def test_the_guess_of_the_spinner_touches_nothing_and_influences_nothing() -> None:
    made = shipped("spinner", "casadi")
    motion = made.simulate(made.shooting.start(0))
    tip = np.array([np.sin(0.3) + 0.95 * np.sin(1.8), np.cos(0.3) + 0.95 * np.cos(1.8)])
    assert np.linalg.norm(tip - [1.5, 1.0]) - 0.05 - 0.25 == pytest.approx(0.08195, abs=1e-5)
    far = motion["far.position"][0, [0, 2]]
    np.testing.assert_allclose(far, tip - 0.45 * np.array([np.sin(1.8), np.cos(1.8)]), atol=1e-12)
    assert np.abs(motion["axle.angle"]).max() == 0.0


@pytest.mark.slow
def test_a_short_descent_lowers_the_cost_of_the_spinner() -> None:
    before, after = short_descent("spinner", 6)
    assert after < before - 0.05


@pytest.mark.thorough
def test_a_controller_turns_a_heavier_spinner_and_lets_it_rest() -> None:
    """With half the step and masses 10 % off: more flicks than one, and it stays within the tolerance for a second."""
    off = {"mpc.plant.masses": 1.1, "mpc.plant.latency": 0.004, "mpc.duration": 4.0}
    problem = load_problem(find("spinner"), off)
    record = record_of(close_loop(Controller(problem, threads=1), Plant(problem)))
    assert record.done and record.held > 1.0
