"""A finger turns a spinner that it does not touch in the guess."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, short_descent, solve

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find
from symphys.verification.refinement import FINER_DT, finer_problem


def test_the_guess_touches_nothing_and_influences_nothing() -> None:
    made = shipped("spinner", "casadi")
    motion = made.simulate(made.shooting.start(0))
    tip = np.array([np.sin(0.3) + 0.95 * np.sin(1.8), np.cos(0.3) + 0.95 * np.cos(1.8)])
    gap = np.linalg.norm(tip - [1.5, 1.0]) - 0.05 - 0.25
    assert gap == pytest.approx(0.08195, abs=1e-5)
    far = motion["far.position"][0, [0, 2]]
    np.testing.assert_allclose(far, tip - 0.45 * np.array([np.sin(1.8), np.cos(1.8)]), atol=1e-12)
    assert np.abs(motion["axle.angle"]).max() == 0.0


def test_a_short_descent_lowers_the_cost() -> None:
    before, after = short_descent("spinner", 6)
    assert after < before - 0.05


@pytest.mark.thorough
def test_smoothing_finds_the_contact() -> None:
    made = shipped("spinner")
    found = solve("ilqr", made)
    verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
    assert verdict.solved
    assert verdict.objective < 2.0
    assert finer.checks[0].error < 0.2


@pytest.mark.thorough
def test_a_controller_turns_a_heavier_spinner_and_lets_it_rest() -> None:
    """With half the step and masses 10 % off: more flicks than one, and it stays within the tolerance for a second."""
    off = {"mpc.plant.masses": 1.1, "mpc.plant.latency": 0.004, "mpc.duration": 4.0}
    problem = load_problem(find("spinner"), off)
    record = record_of(close_loop(Controller(problem, threads=1), Plant(problem)))
    assert record.done and record.held > 1.0
