"""Force laws: of second order against closed forms, with exact slopes, by every backend; what cannot be is said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tools.repeats import few

from symphys.errors import ProblemError
from symphys.problem import Problem, problem_of_tables
from symphys.trajectory import Trajectory
from symphys.transcription import transcribe

MASS, G = 0.5, 9.81
BALL = {"name": "ball", "mass": MASS, "shape": {"sphere": {"radius": 0.1}}}
HINGE = {"name": "hinge", "between": ["world", "ball"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0], "start": 0.5}
SPRING = {"name": "spring", "on": "ball.force", "value": "-spring.k * ball.position", "numbers": {"k": 20}}
DRAG = {"name": "drag", "on": "ball.force", "value": "-drag.c * norm(ball.velocity) * ball.velocity"}
MAGNUS = {"name": "lift", "on": "ball.force", "value": "lift.c * cross(ball.angular_velocity, ball.velocity)"}


def problem(forces: list[Any], dt: float, duration: float = 2.0, down: float = 0.0, **tables: Any) -> Problem:
    return problem_of_tables(
        {
            "simulation": {"duration": duration, "dt": dt},
            "world": {"gravity": [0, 0, -down]},
            "body": [{**BALL, **tables.pop("start", {})}],
            "force": forces,
            "variable": [{"name": "throw", "sets": "ball.velocity"}],
            "cost": [{"name": "place", "value": "sumsqr(ball.position - [1, 2, 3])"}],
            **tables,
        }
    )


def motion(forces: list[Any], dt: float, **more: Any) -> Trajectory:
    made = transcribe(problem(forces, dt, **more), backend="casadi")
    return made.simulate(made.shooting.start(0))


def test_a_spring_swings_with_its_period_and_keeps_its_energy() -> None:
    errors = []
    for dt in (0.02, 0.01):
        found = motion([SPRING], dt, duration=4.0, start={"position": [1, 0, 0]})
        x, v = found.position[:, 0, 0], found.velocity[:, 0, 0]
        errors.append(np.abs(x - np.cos(np.sqrt(20 / MASS) * found.time)).max())
        energy = MASS * v**2 / 2 + 10 * x**2
        assert energy == pytest.approx(10, rel=12 * dt**2)  # it swings about its value and does not drift
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)


def test_a_ball_that_falls_through_air_follows_tanh() -> None:
    errors = []
    for dt in (0.02, 0.01):
        found = motion([{**DRAG, "numbers": {"c": 0.05}}], dt, duration=4.0, down=G)
        last = np.sqrt(MASS * G / 0.05)
        expected = -last * np.tanh(G * found.time / last)
        errors.append(np.abs(found.velocity[:, 0, 2] - expected).max())
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


OIL = {"name": "oil", "on": "ball.force", "value": "-oil.c * ball.velocity"}


@pytest.mark.parametrize("share", [0.5, 1.5, 3, 20])
def test_thick_oil_stops_a_ball_after_m_v_over_c(share: float) -> None:
    """The momentum is c times the way, at any c dt / m; up to 2 nothing overshoots."""
    found = motion([{**OIL, "numbers": {"c": share * MASS / 0.01}}], 0.01, start={"velocity": [1, 0, 0]})
    way = found.position[:, 0, 0]
    assert way[-1] == pytest.approx(0.01 / share, rel=1e-9)
    assert way.max() < 0.01 / share * (1 + 1e-9 if share < 2 else 2)


@pytest.mark.parametrize("share", [1.5, 15.0])
def test_strong_quadratic_drag_stops_a_ball(share: float) -> None:
    """It loses speed in every step; at last it is slow enough to follow 1 / (1 / v + c t / m)."""
    found = motion([{**DRAG, "numbers": {"c": share * MASS / 0.01}}], 0.01, start={"velocity": [1, 0, 0]})
    speed = found.velocity[:, 0, 0]
    assert (np.diff(np.abs(speed)) < 0).all()
    assert np.abs(speed[-1]) == pytest.approx(1 / (1 + 200 * share), rel=0.05)


JOINTED = [
    ("ball.torque", "-oil.c * ball.angular_velocity"),
    ("hinge.command", "-oil.c * hinge.rate"),
    ("ball.force", "-oil.c / 0.09 * ball.velocity"),
]


@few(("on", "value"), JOINTED, 1)
def test_an_arm_in_oil_stops_after_its_momentum_over_c(on: str, value: str) -> None:
    """As a torque on the body, as a motor's command, and as a force 0.3 m from the hinge."""
    inertia, share = 0.4 * MASS * 0.01 + MASS * 0.09, 1.5
    law = {"name": "oil", "on": on, "value": value, "numbers": {"c": share * inertia / 0.01}}
    hinge = {**HINGE, "start": 0, "motor": {"torque": {"torque": 1e6}}}
    start = {"position": [0, 0, -0.3], "velocity": [-0.6, 0, 0], "angular_velocity": [0, 2, 0]}
    found = motion([law], 0.01, duration=0.5, joint=[hinge], start=start)
    assert found.joint_value[-1, 0, 0] == pytest.approx(0.02 / share, rel=1e-4)


def test_oil_that_turns_with_a_body_stops_its_spin() -> None:
    inertia = 0.4 * MASS * 0.01
    law = {
        "name": "oil",
        "on": "ball.torque",
        "value": "-oil.c * ball.angular_velocity",
        "numbers": {"c": inertia * 300},
    }
    found = motion([law], 0.01, duration=0.3, start={"angular_velocity": [0, 3, 0]})
    assert np.abs(found.angular_velocity[-1]).max() < 1e-9
    assert 2 * np.arcsin(found.orientation[-1, 0, 2]) == pytest.approx(0.01, rel=1e-9)


def test_magnus_force_bends_the_path_as_scipy_integrates_it() -> None:
    forces = [{**DRAG, "numbers": {"c": 0.005}}, {**MAGNUS, "numbers": {"c": 0.002}}]
    spin = np.array([0, 10.0, 60.0])
    start = {"velocity": [20, 0, 5], "angular_velocity": spin.tolist()}

    def slope(_: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        v = y[3:]
        force = -0.005 * np.linalg.norm(v) * v + 0.002 * np.cross(spin, v)
        return np.concatenate([v, [0, 0, -G] + force / MASS])

    exact = solve_ivp(slope, (0, 1), [0, 0, 0, 20, 0, 5], rtol=1e-11, atol=1e-11).y[:, -1]
    found = motion(forces, 0.001, duration=1.0, down=G, start=start)
    assert found.position[-1, 0] == pytest.approx(exact[:3], abs=1e-6)
    assert found.velocity[-1, 0] == pytest.approx(exact[3:], abs=1e-6)


@pytest.mark.parametrize("on", ["hinge.command", "ball.torque[1]"])
def test_laws_on_motors_and_on_bodies_of_joints_are_of_second_order(on: str) -> None:
    law = {"name": "law", "on": on, "value": "-0.08 * hinge.angle - 0.004 * hinge.rate"}
    inertia = 0.4 * MASS * 0.01
    decay, errors = 0.004 / (2 * inertia), []
    rate = np.sqrt(0.08 / inertia - decay**2)
    for dt in (0.01, 0.005):
        joint = [{**HINGE, "motor": {"torque": {"torque": 1000}}}]
        found = motion([law], dt, joint=joint)
        t = found.time
        expected = 0.5 * np.exp(-decay * t) * (np.cos(rate * t) + decay / rate * np.sin(rate * t))
        errors.append(np.abs(found.joint_value[:, 0, 0] - expected).max())
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_laws_add_to_controllers_and_to_each_other() -> None:
    push = {"name": "push", "on": "ball.force", "value": "[ball.mass, 0, 0]"}
    controller = [{"name": "steady", "drives": "ball.force[1]", "senses": ["clock"], "linear": {"offsets": [1.0]}}]
    clock = [{"name": "clock", "reads": "time"}]
    made = transcribe(problem([push, {**push, "name": "again"}], 0.01, controller=controller, sensor=clock))
    found = made.simulate(made.shooting.start(0))
    assert found.force[:, 0] == pytest.approx(np.tile([2 * MASS, 1, 0], (200, 1)), rel=1e-12)
    value = made.shooting.evaluator.value(made.shooting.start(0)[None], 0.0)
    assert value.objective[0] == pytest.approx(np.sum((found.position[-1, 0] - [1, 2, 3]) ** 2), rel=1e-12)


def test_a_spring_between_two_bodies_keeps_their_momentum() -> None:
    other = {**BALL, "name": "other", "mass": 1.5, "position": [1, 0, 0], "collides_with": []}
    spring = {"name": "spring", "on": "ball.force", "against": "other.force"}
    spring["value"] = "20 * (norm(other.position - ball.position) - 0.5) * (other.position - ball.position)"
    made = transcribe(problem([spring], 0.005, body=[{**BALL, "velocity": [0, 0.3, 0]}, other]), backend="casadi")
    found = made.simulate(made.shooting.start(0))
    momentum = MASS * found.velocity[:, 0] + 1.5 * found.velocity[:, 1]
    assert momentum == pytest.approx(np.tile(momentum[0], (len(momentum), 1)), abs=1e-12)
    assert np.abs(found.force).max() > 5


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"on": "ball.velocity"}, r'"drag".on: .*"ball.velocity"'),
        ({"on": "ball.force[0]"}, r'"drag".value: has 3 components, but ball.force\[0\] has 1 component'),
        ({"value": "ball.velocty"}, r'"drag".value: .*"ball.velocity"'),
        ({"value": "end.ball.velocity"}, r"is of a whole motion; costs"),
        ({"against": "ball.torque"}, r'"drag".against: .*ball.force'),
        ({"against": "post.force"}, r'"drag".against: .*"post.force"'),
        ({"value": "throw"}, '"throw"'),
        ({"value": "ball.accelerometer"}, r"is not known while the force is"),
        ({"value": "ball.velocity / ball.velocity[0]"}, r"is not a finite number at the start of the guess"),
        ({"numbers": {"c": "fast"}}, r'"drag".numbers.c'),
        ({"name": "ball"}, '"ball"'),
    ],
)
def test_what_cannot_be_names_table_and_key(law: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem([{**DRAG, "numbers": {"c": 0.1}, **law}], 0.01)
