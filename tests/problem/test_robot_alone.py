"""A robot file by itself: put above the ground, its motors holding the start where they can."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys import ProblemError
from symphys.problem import Problem, is_robot, robot_alone
from symphys.transcription import transcribe

ROBOT = """
title = "A leg"
[[body]]
name = "torso"
mass = 2.0
shape = { box = { size = [0.4, 0.4, 0.1] } }
position = [0, 0, -3]
[[body]]
name = "leg"
mass = 0.2
shape = { capsule = { radius = 0.05, length = 0.3 } }
position = [0, 0, -3.25]
[[joint]]
name = "hip"
between = ["torso", "leg"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, -3.05]
start_deg = 90
motor = { affine = { gain = 40, kp = 40, kv = 4, offset = 2 } }
"""


def alone(tmp_path: Path, text: str, **settings: object) -> Problem:
    path = tmp_path / "leg.toml"
    path.write_text(text, encoding="utf-8")
    return robot_alone(path, settings)


@pytest.mark.thorough
def test_it_begins_just_above_a_ground_and_holds_its_pose(tmp_path: Path) -> None:
    """The leg, lifted to the side, is the lowest: 0.05 m below its centre."""
    problem = alone(tmp_path, ROBOT)
    assert (problem.name, problem.title, problem.simulation.duration) == ("leg", "A leg", 2.0)
    assert problem.initial["leg.position"][2] - 0.05 == pytest.approx(0.02, abs=1e-9)
    (controller,) = problem.controllers
    assert controller.drives == (("hip.command", 0),)
    assert controller.weights[f"{controller.name}.offsets"] == pytest.approx([np.pi / 2 - 2 / 40])
    made = transcribe(problem.set("simulation.duration", 1.0), backend="casadi")
    motion = made.simulate(made.shooting.start(0)).arrays()
    assert np.abs(motion["velocity"][-1]).max() < 1e-3
    assert motion["position"][-1, :, 2].min() > 0.05
    assert np.abs(motion["joint_value"][:, 0, 0] - np.pi / 2).max() < 0.1


def test_what_stands_already_stays(tmp_path: Path) -> None:
    """A ground of its own, or a joint to the world: no ground is added, nothing is lifted."""
    ground = alone(tmp_path, ROBOT + "[ground]\nheight = -4\n")
    assert ground.initial["torso.position"][2] == -3
    held = alone(tmp_path, ROBOT + '[[joint]]\nname = "root"\nbetween = ["world", "torso"]\nfixed = {}\n')
    assert held.initial["torso.position"][2] == -3
    assert "ground" not in [static.name for static in held.world().statics]


def test_motors_that_the_file_drives_are_left_to_it(tmp_path: Path) -> None:
    own = '[[controller]]\nname = "own"\ndrives = "hip.command"\nperiodic = { frequency = 1, offsets = 1 }\n'
    assert [controller.name for controller in alone(tmp_path, ROBOT + own).controllers] == ["own"]


def test_a_motor_without_aim_is_at_rest(tmp_path: Path) -> None:
    torque = ROBOT.replace("affine = { gain = 40, kp = 40, kv = 4, offset = 2 }", "torque = { torque = 5 }")
    assert not alone(tmp_path, torque).controllers


def test_what_is_a_robot(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_text(ROBOT, encoding="utf-8")
    assert is_robot(path) and is_robot(Path("a.xml")) and is_robot(Path("A.URDF"))
    path.write_text(ROBOT + "[simulation]\nduration = 1\ndt = 0.01\n", encoding="utf-8")
    assert not is_robot(path)


def test_faults_name_the_robot_file(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"leg.toml: body \"torso\".mass"):
        alone(tmp_path, ROBOT.replace("mass = 2.0", "mass = -2.0"))


@pytest.mark.slow
def test_show_draws_a_path(tmp_path: Path) -> None:
    path = tmp_path / "leg.toml"
    path.write_text(ROBOT, encoding="utf-8")
    figure = symphys.show(path)
    assert figure.axes
