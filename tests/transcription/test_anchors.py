"""Anchors of joints that vary: as a file has it in which the robot is built so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import first

from symphys.errors import ProblemError
from symphys.problem import load_problem, reposition
from symphys.transcription import Transcription, transcribe

LEG = """
[simulation]
duration = 0.4
dt = 0.01
sweeps = 4
cuts = 0
[ground]
friction = 0.8
[[body]]
name = "trunk"
shape = {{ box = {{ size = [0.4, 0.2, 0.1] }} }}
mass = 4
position = [0, 0, {trunk}]
collides_with = []
[[body]]
name = "upper"
shape = {{ box = {{ size = [0.05, 0.05, 0.3] }} }}
mass = 1
inertia = [0.01, 0.01, 0.002]
position = [0, 0, {upper}]
collides_with = []
[[body]]
name = "lower"
shape = {{ spheres = [{{ radius = 0.05, centre = [0, 0, -0.15] }}] }}
mass = 0.6
inertia = [0.005, 0.005, 0.001]
position = [0, 0, 0.2]
[[joint]]
name = "hip"
between = ["trunk", "upper"]
hinge = {{ axis = [0, 1, 0] }}
anchors = [[0, 0, -0.05], [0, 0, 0.15]]
motor = {{ servo = {{ gain = 20, torque = 30, velocity = 8 }} }}
start = 0.4
[[joint]]
name = "knee"
between = ["upper", "lower"]
hinge = {{ axis = [0, 1, 0] }}
anchors = [[0, 0, {knee}], [0, 0, 0.15]]
motor = {{ servo = {{ gain = 20, torque = 30, velocity = 8 }} }}
start = -0.9
[[variable]]
name = "knee_at"
sets = "knee.anchor[2]"
guess = {guess}
[[cost]]
name = "height"
at = "always"
value = "trunk.position[2] + 0.1 * lower.velocity[0]"
{more}
"""


def leg(folder: Path, knee: float, guess: float, **more: Any) -> Transcription:
    """A leg with its foot on the ground, whose upper part reaches down to ``knee``."""
    file = folder / "leg.toml"
    middle = 0.35 - knee
    file.write_text(LEG.format(knee=knee, guess=guess, upper=middle, trunk=middle + 0.2, more="", **more))
    problem = load_problem(file)
    down = -0.05 + 0.2 - 0.15 - lowest(problem)
    placed = file.read_text().replace("position = [0, 0, ", f"position = [0, 0, {down} + ")
    lines = [added(line) if line.startswith("position") else line for line in placed.splitlines()]
    file.write_text("\n".join(lines))
    return transcribe(load_problem(file), backend="casadi")


def lowest(problem: Any) -> float:
    """How deep the foot is below where it should touch, where joints have carried it."""
    lower, q = problem.initial["lower.position"], problem.initial["lower.orientation"]
    return float(lower[2] - 0.15 * (1 - 2 * (q[1] ** 2 + q[2] ** 2)) - 0.05)


def added(line: str) -> str:
    """The sum in the last place of a position."""
    head, tail = line.rsplit("[0, 0, ", 1)
    return f"{head}[0, 0, {sum(map(float, tail.rstrip(']').split('+')))!r}]"


@pytest.mark.slow
@first("longer", [0.05, -0.06])
def test_it_is_the_robot_that_is_built_so(tmp_path: Path, longer: float) -> None:
    """Motion, cost and velocities, and the foot on the ground."""
    built, varied = leg(tmp_path, -0.15 - longer, -0.15 - longer), leg(tmp_path, -0.15, -0.15)
    z = np.array([-0.15 - longer])
    a, b = built.simulate(z), varied.simulate(z)
    assert b.position == pytest.approx(a.position, abs=1e-9)
    assert b.velocity == pytest.approx(a.velocity, abs=1e-7)
    assert np.abs(b.joint_separation[0]).max() < 1e-12
    assert varied.judge(z).objective == pytest.approx(built.judge(z).objective, rel=1e-9)
    assert varied.judge(z).objective != pytest.approx(varied.judge(np.array([-0.15])).objective, rel=1e-3)


@pytest.mark.slow
def test_the_derivative_knows_what_is_carried(tmp_path: Path) -> None:
    made = leg(tmp_path, -0.15, -0.17)
    z, step = np.array([-0.17]), 1e-6
    slope = made.shooting.evaluator.gradient(z[None], 0.0).gradient
    high, low = (made.shooting.evaluator.value((z + sign * step)[None], 0.0).merit[0] for sign in (1, -1))
    assert slope is not None
    assert slope[0, 0] == pytest.approx((high - low) / (2 * step), rel=1e-5)
    assert abs(slope[0, 0]) > 0.1


def test_what_spins_goes_on_as_one(tmp_path: Path) -> None:
    """What is carried moves as it would, were it fixed to what stays."""
    problem = leg(tmp_path, -0.15, -0.15).problem
    state = {name: ca.DM(value) for name, value in problem.initial.items()} | {
        "upper.angular_velocity": ca.DM([1, 2, 3])
    }
    moved = reposition(problem.parametric, {"knee.anchor": ca.DM([0.02, 0, -0.25])}, state)
    by = np.array(moved["lower.position"] - moved["upper.position"]) - np.array(
        state["lower.position"] - state["upper.position"]
    )
    assert np.linalg.norm(by) == pytest.approx(np.hypot(0.02, 0.1))
    assert np.array(moved["lower.velocity"]).ravel() == pytest.approx(np.cross([1, 2, 3], by.ravel()))
    assert np.array_equal(np.array(moved["trunk.velocity"]), np.array(state["trunk.velocity"]))


def test_a_joint_of_a_loop_has_no_anchor_that_varies(tmp_path: Path) -> None:
    file = tmp_path / "loop.toml"
    file.write_text(
        LEG.format(knee=-0.15, guess=-0.15, upper=0.5, trunk=0.7, more="")
        + '[[joint]]\nname = "lock"\nbetween = ["trunk", "lower"]\nball = {}\nanchors = [[0, 0, -0.35], [0, 0, 0.15]]\n'
    )
    with pytest.raises(ProblemError, match=r"knee\.anchor .*loop"):
        load_problem(file)
