"""Pendulums on joints move as Lagrange's equations say, integrated on their own; what half the step refutes is told."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, solve
from worlds import swings

from symphys.findings.verdict import DOUBTED, judge_run
from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.record import judged
from symphys.transcription import transcribe
from symphys.verification.refinement import refine


def test_the_cart_and_pole_move_as_their_equations_say() -> None:
    """Under the guess."""
    made = shipped("cart_pole", "casadi")
    push = made.shooting.start(0)
    motion = made.simulate(push)
    end = np.concatenate([motion.joint_value[-1, :, 0], motion.joint_rate[-1, :, 0]])
    assert (np.abs(end - swings.CART_POLE.swung(push)) < [0.005, 0.03, 0.01, 0.1]).all()
    np.testing.assert_allclose(motion.joint_value[:, 0, 0], motion.position[:, 0, 0], rtol=0, atol=1e-6)
    assert motion.joint_separation.max() < 1e-5


@pytest.mark.slow
def test_the_double_pendulum_moves_as_its_equations_say() -> None:
    """For half a second, under pushes at random; what the time step leaves is of its size."""
    pushes = 1.0 + 3 * np.random.default_rng(3).standard_normal(61)
    motion = shipped("cart_double_pendulum", "casadi").simulate(pushes)
    places, rates = np.split(swings.DOUBLE_PENDULUM.swung(pushes, [0, 0.5])[-1], 2)
    found = [motion[name][50] for name in ("rail.position", "pivot.angle", "elbow.angle")]
    np.testing.assert_allclose(found, places, atol=1e-3)
    np.testing.assert_allclose([motion[f"{name}.rate"][50] for name in ("rail", "pivot", "elbow")], rates, atol=0.05)


def test_without_walls_the_pole_falls() -> None:
    """The motor alone cannot hold it: a pole that leans by more than atan(F / (M + m) g) is out of its reach."""
    made = transcribe(load_problem(find("cart_pole_walls"), {"force.walls.numbers.k": 0}), backend="casadi")
    pushed = made.simulate(np.full(41, 3.0))
    assert np.abs(pushed["pivot.angle"]).max() > 2
    assert np.tan(0.5) > 3 / ((1.0 + 0.1) * 9.81)


@pytest.mark.slow
def test_a_swing_that_half_the_step_refutes_is_not_solved() -> None:
    """Torques that are held, in steps of 0.1 s: what meets all there misses by twenty tolerances at half the step."""
    held = {"simulation.dt": 0.1, "twist.interpolation": "constant", "twist.knots": 20}
    made = transcribe(load_problem(find("acrobot"), held), exact=True, backend="casadi")
    found = solve("ilqr", made)
    trust = refine(made, found.z)
    verdict = judged(made.judge(found.z))
    assert verdict.met and trust["refined"][0]["worst"] > 3
    given = judge_run(found.status.value, verdict, trust)
    assert given.word == DOUBTED
    assert any("dt / 2" in doubt for doubt in given.doubts)
