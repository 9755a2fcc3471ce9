"""Walking robots of shipped problems: statics, the published trot, first steps here, whole lessons as ``thorough``."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from data.shipped import first_steps, shipped, short_descent
from gradients import compared, gait
from tools.repeats import thorough
from worlds.hops import LEGS

from symphys.mpc import Controller, Plant, close_loop, record_of
from symphys.problem import load_problem
from symphys.problems import find
from symphys.runs.job import solver_options
from symphys.shooting import ScenarioEvaluator
from symphys.solvers import SOLVERS, Outcome
from symphys.transcription import Transcription, transcribe
from symphys.types import Array

pytestmark = pytest.mark.slow

THIGH, SHANK, FOOT, GRAVITY = 0.209, 0.182126, 0.0175, 9.81
UNSEEN, SPEED = 4711, "speed [m/s]"


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


def test_the_mini_cheetah_is_as_published() -> None:
    """8.25 kg, at a height of 0.29 m on legs (0, -0.8, 1.6)."""
    problem = shipped("mini_cheetah_ahead", "casadi").problem
    assert sum(float(body.mass) for body in problem.world().bodies) == pytest.approx(8.25, abs=0.005)
    assert (THIGH + SHANK) * np.cos(0.8) + FOOT == pytest.approx(problem.initial["body.position"][2], abs=1e-6)
    assert [variable.guess[0] for variable in problem.variables] == [0, -0.8, 1.6] * 4
    assert len(problem.world().pairs) == 4


@pytest.mark.slow
def test_the_guess_of_the_mini_cheetah_stands_by_statics() -> None:
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


@pytest.mark.slow
def test_a_short_descent_lowers_the_cost_of_the_mini_cheetah() -> None:
    before, after = short_descent("mini_cheetah_ahead", 4)
    assert after < before - 0.02


@pytest.mark.thorough
def test_a_controller_walks_a_heavier_robot_ahead() -> None:
    """With half the step and masses 10 % off: after two seconds it is 0.8 m ahead, at its height and upright."""
    problem = load_problem(find("mini_cheetah_mpc"), {"mpc.plant.masses": 1.1, "mpc.plant.latency": 0.01})
    record = record_of(close_loop(Controller(problem, threads=1), Plant(problem)))
    assert not record.stopped
    assert record.done


@cache
def trot(dt: float) -> Transcription:
    """The hand-tuned trot of the journal."""
    return transcribe(load_problem(find("gait_robot_trot"), {"simulation.dt": dt}), backend="casadi")


@pytest.mark.thorough
@pytest.mark.parametrize("dt", [0.01, 0.005])
def test_the_gait_robot_trots_as_published(dt: float) -> None:
    """0.7 m/s; 80 N m is what the published engine's 4 N m come to in 20 iterations."""
    made = trot(dt)
    speed = made.simulate(np.array([80.0])).position[-1, 0, 0] / made.problem.simulation.duration
    assert 0.55 < speed < 0.85
    assert made.judge(np.array([80.0])).solved


def test_four_newton_metres_do_not_hold_the_gait_robot() -> None:
    """Over the first 4 s."""
    spine = trot(0.01).simulate(np.array([4.0])).position[400, 0]
    assert spine[2] < 0.15
    assert abs(spine[0] / 4) < 0.1


@pytest.mark.thorough
def test_without_its_net_the_quadruped_stays() -> None:
    made = shipped("quadruped_shift")
    assert made.shooting.n == 976
    assert np.abs(made.simulate(np.zeros(976)).position[-1, 0, :2]).max() < 5e-3


def taught(name: str, settings: dict[str, Any], seed: int = 0) -> tuple[Transcription, ScenarioEvaluator, Outcome]:
    """The problem with these settings, its samples, and what the solver found."""
    made = transcribe(load_problem(find(name), settings), exact=True)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    options = solver_options(made.problem, "stochastic")
    found = SOLVERS["stochastic"].solve(made.shooting, made.shooting.start(seed), options, seed)
    return made, made.shooting.scenario, found


def short_lesson(name: str, seconds: float, **options: Any) -> tuple[Transcription, ScenarioEvaluator, Outcome]:
    """Sixty batches of 16 over so many seconds."""
    asked = {"iterations": 60, "samples": 16} | options
    return taught(name, {"simulation.duration": seconds} | {f"solver.stochastic.{k}": v for k, v in asked.items()})


def ahead_and_up(made: Transcription, z: Array) -> Any:
    """(x, up) of the torso: how far it came [m], and the least height of its axis."""
    motion = made.simulate(z)
    torso = motion.body_names.index("torso")
    q = motion.orientation[:, torso]
    return motion.position[-1, torso, 0], (1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2)).min()


@pytest.mark.parametrize(
    ("seconds", "evaluations", "share", "searches"), [thorough(1.0, 120, 0.9, 1), thorough(1.5, 240, 0.8, 3)]
)
def test_the_first_steps_of_the_quadruped_help(seconds: float, evaluations: int, share: float, searches: int) -> None:
    """Over a second and more, from values alone: what stood steps ahead, by the middle one of some searches."""
    made, found = first_steps("quadruped_walk", seconds, evaluations, searches)
    start = made.shooting.start(0)
    assert np.median([made.judge(z).objective for z in found]) < share * made.judge(start).objective
    assert all(ahead_and_up(made, z)[0] > ahead_and_up(made, start)[0] + 0.1 for z in found)


@pytest.mark.thorough
def test_a_short_lesson_helps_the_quadruped() -> None:
    """What stood walks, and costs less in samples that are new.

    And over these 200 steps the adjoint of a calm walk is its derivative, against central differences.
    """
    made, scenario, found = short_lesson("quadruped_walk", 2)
    assert np.median(compared(made, gait(made, 0.05))[0]) < 1e-6
    start = made.shooting.start(0)
    still, learnt = (
        scenario.value(each[None], scenario.draw(np.random.default_rng(UNSEEN), 32), 0.0) for each in (start, found.z)
    )
    assert learnt.objective.mean() < 0.8 * still.objective.mean()
    assert learnt.alive is not None and learnt.alive.mean() > 0.6
    assert ahead_and_up(made, found.z)[0] > ahead_and_up(made, start)[0] + 1.0


@pytest.mark.thorough
def test_the_adjoint_of_a_calm_walk_is_its_derivative() -> None:
    """Against central differences over a thousand steps, in samples that differ."""
    made = transcribe(load_problem(find("quadruped_walk")), exact=True)
    if made.shooting.scenario is None:
        pytest.skip(made.backend.note)
    errors, _ = compared(made, gait(made, 0.05))
    assert np.median(errors) < 1e-6


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(("name", "speed", "share"), [("quadruped_walk", 2.5, 0.98), ("quadruped_walk_net", 1.5, 0.95)])
def test_the_quadruped_walks(name: str, speed: float, share: float, seed: int) -> None:
    """As fast as it shall, upright, straight on, and upright in most samples that it has not seen."""
    made, scenario, found = taught(name, {}, seed)
    assert made.judge(found.z).solved
    x, up = ahead_and_up(made, found.z)
    assert x > 10 * speed and up > 0.866
    errors = scenario.value(found.z[None], scenario.draw(np.random.default_rng(UNSEEN), 500), 0.0).errors
    upright = [constraint.name for constraint in made.problem.constraints].index("stays upright")
    assert (errors[:, upright] <= 1).mean() >= share


@pytest.mark.thorough
def test_the_first_steps_of_the_gait_robot_get_faster() -> None:
    """Over a second and a half, from values alone: faster than by hand."""
    made, (z,) = first_steps("gait_robot_fast", 1.5, 160)
    assert made.judge(z).outputs[SPEED] > 1.3 * made.judge(made.shooting.start(0)).outputs[SPEED]


@pytest.mark.thorough
def test_a_short_lesson_helps_the_gait_robot() -> None:
    """Faster than by hand, as the trace tells it."""
    made, _, found = short_lesson("gait_robot_fast", 3, patience=0.0)
    after = made.judge(found.z).outputs[SPEED]
    assert after > 1.3 * made.judge(made.shooting.start(0)).outputs[SPEED]
    assert found.trace[-1].outputs[SPEED] == pytest.approx(after, rel=1e-9)
    assert found.z[0] == 80


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_gait_robot_is_faster_than_the_journal_s(seed: int) -> None:
    """Upright, within its joints' 45 degrees, which the servos hold."""
    made, _, found = taught("gait_robot_fast", {}, seed)
    assert made.judge(found.z).solved
    assert made.judge(found.z).outputs[SPEED] > 1.17


@pytest.mark.thorough
def test_legs_and_motors_are_chosen_too() -> None:
    made, _, found = taught("gait_robot_build", {})
    z = made.shooting.by_block(found.z)
    assert made.judge(found.z).outputs[SPEED] > 1.17
    assert abs(z["front_thighs"][0, 0] + 0.1) > 0.005 or abs(z["hind_thighs"][0, 0] + 0.1) > 0.005
    assert np.abs(made.simulate(found.z).joint_separation).max() < 5e-3
