"""The Mini Cheetah stands by the laws of statics, and walks ahead from where it stands."""

from __future__ import annotations

import numpy as np
import pytest
from data.shipped import shipped, short_descent, solve

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find
from symphys.verification.refinement import FINER_DT, finer_problem

LEGS = ("fl", "fr", "hl", "hr")
THIGH, SHANK, FOOT, GRAVITY = 0.209, 0.182126, 0.0175, 9.81


def leg(height: float, ahead: float) -> tuple[float, float]:
    """Angles of hip and knee [rad] that put a foot so far below and ahead of its hip [m], the knee behind."""
    knee = np.arccos((height**2 + ahead**2 - THIGH**2 - SHANK**2) / (2 * THIGH * SHANK))
    return np.arctan2(ahead, height) - np.arctan2(SHANK * np.sin(knee), THIGH + SHANK * np.cos(knee)), knee


def energy(height: float, ahead: float) -> float:
    """[J] of the weight of the robot, its four hips so high above its feet: masses and centres as published."""
    hip, knee = leg(height, ahead)
    thigh = height - 0.02 * np.cos(hip)
    shank = height - THIGH * np.cos(hip) - 0.061 * np.cos(hip + knee)
    return GRAVITY * (3.3 * height + 4 * (0.54 * height + 0.634 * thigh + 0.064 * shank))


def test_it_is_as_published() -> None:
    """8.25 kg, at a height of 0.29 m on legs (0, -0.8, 1.6)."""
    problem = shipped("mini_cheetah_ahead", "casadi").problem
    assert sum(float(body.mass) for body in problem.world().bodies) == pytest.approx(8.25, abs=0.005)
    assert (THIGH + SHANK) * np.cos(0.8) + FOOT == pytest.approx(problem.initial["body.position"][2], abs=1e-6)
    assert [variable.guess[0] for variable in problem.variables] == [0, -0.8, 1.6] * 4
    assert len(problem.world().pairs) == 4


def test_the_guess_stands_by_statics() -> None:
    """Feet bear the weight; and as the hips rise by dh over feet that stay, motors do the work that the weight takes.

    Feet that pull at each other by friction do no work then, so that however they do it, the law holds.
    """
    made = shipped("mini_cheetah_ahead", "casadi")
    motion = made.simulate(made.shooting.start(0))
    hip, knee = (np.mean([motion[f"{each}_{joint}.angle"][-1] for each in LEGS]) for joint in ("hip", "knee"))
    height = THIGH * np.cos(hip) + SHANK * np.cos(hip + knee)
    ahead = THIGH * np.sin(hip) + SHANK * np.sin(hip + knee)
    step = 1e-5
    up, down = leg(height + step, ahead), leg(height - step, ahead)
    rates = (np.array(up) - np.array(down)) / (2 * step)
    torques = [sum(motion[f"{each}_{joint}.torque"][-20:].mean() for each in LEGS) for joint in ("hip", "knee")]
    work = (energy(height + step, ahead) - energy(height - step, ahead)) / (2 * step)
    assert np.dot(torques, rates) == pytest.approx(work, rel=0.02)
    assert motion["body.position"][-1] == pytest.approx([0, 0, 0.29], abs=0.01)
    assert motion["body.orientation"][-1] == pytest.approx([1, 0, 0, 0], abs=2e-3)


def test_a_short_descent_lowers_the_cost() -> None:
    before, after = short_descent("mini_cheetah_ahead", 4)
    assert after < before - 0.02


@pytest.mark.thorough
def test_it_walks_ahead_and_half_the_step_agrees() -> None:
    made = shipped("mini_cheetah_ahead")
    found = solve("ilqr", made)
    verdict, finer = made.judge(found.z), finer_problem(made, FINER_DT).judge(found.z)
    assert verdict.solved
    assert verdict.objective < 2.0
    assert finer.worst < 1.0
    motion = made.simulate(found.z)
    lifted = np.stack([motion[f"{each}_shank.position"][:, 2] for each in LEGS], axis=1)
    assert (np.ptp(lifted, axis=0) > 0.01).all()


@pytest.mark.thorough
def test_a_controller_walks_a_heavier_robot_ahead() -> None:
    """With half the step and masses 10 % off: after two seconds it is 0.8 m ahead, at its height and upright."""
    problem = load_problem(find("mini_cheetah_mpc"), {"mpc.plant.masses": 1.1, "mpc.plant.latency": 0.01})
    record = record_of(close_loop(Controller(problem, threads=1), Plant(problem)))
    assert not record.stopped
    assert record.done
