"""Files that include others: what they become together, and where."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from worlds.included import MAIN, ROBOT

from symphys.dynamics.observation import gap_function
from symphys.dynamics.observation.joint_coordinates import readings
from symphys.model.state_layout import initial_state
from symphys.problem import Problem, json_schema, load_problem
from symphys.problem.include import LISTS, prefixed

Load = Callable[..., Problem]


def test_included_tables_come_first(load_both: Load) -> None:
    problem = load_both()
    assert [body.name for body in problem.parametric.bodies] == ["torso", "shin", "ball"]
    assert [joint.name for joint in problem.parametric.joints] == ["knee", "rail"]
    assert problem.parametric.contact.friction == 0.3
    assert (problem.title, problem.variables[0].name, problem.costs[0].name) == ("main", "bend", "effort")


def test_it_is_as_if_all_were_in_one_file(load_both: Load, tmp_path: Path) -> None:
    """State for state and gap for gap."""
    include = '[[include]]\nfile = "parts/robot.toml"\n'
    one = tmp_path / "one.toml"
    one.write_text(MAIN.replace(include, ROBOT.replace('title = "Two links"', "")), encoding="utf-8")
    apart, together = load_both(), load_problem(one)
    assert apart.initial.keys() == together.initial.keys()
    for name, value in together.initial.items():
        assert apart.initial[name].tolist() == value.tolist()
    assert apart.world() == together.world()


def test_settings_reach_included_tables(load_both: Load) -> None:
    settings = {"body.torso.mass": 7, "contact.friction": 0.9, "include.0.position": [0, 0, 2]}
    problem = load_both(settings=settings)
    assert (problem.parameters["torso.mass"].tolist(), problem.parametric.contact.friction) == ([7], 0.9)
    assert problem.initial["torso.position"].tolist() == [0, 0, 3]


def test_files_are_put_in_their_places(load_both: Load) -> None:
    """A quarter turn to the left, then a shift; what the problem itself has stays."""
    moved = load_both(problem=('robot.toml"', 'robot.toml"\nposition = [1, 2, 3]\nyaw_deg = 90'))
    initial, world, there = moved.initial, moved.world(), [1, 2, 3]
    assert initial["torso.position"] == pytest.approx(np.array([0, 0, 1]) + there)
    assert initial["shin.position"] == pytest.approx(np.array([0, 0.5, 1]) + there)
    assert initial["torso.velocity"] == pytest.approx([0, 1, 0])
    assert initial["ball.position"].tolist() == [0, 2, 9]
    floor, post = world.statics
    assert (floor.normal, floor.offset) == (pytest.approx([0, 0, 1]), 3.4)
    assert post.shape.centre == pytest.approx(np.array([0, 3, 0.5]) + there)
    assert world.joints[1].frames[1].point == pytest.approx(np.array([0, 0, 1.5]) + there)
    x = initial_state(world, initial)
    for reading in readings(world, x).values():
        assert max(float(reading.separation), float(reading.tilt)) < 1e-9
    plain = load_both().world()
    pairs = [pair.name for pair in plain.pairs]
    assert pairs == [pair.name for pair in world.pairs]
    gaps = [
        np.array(gap_function(each)(state)).ravel()
        for each, state in ((plain, initial_state(plain, load_both().initial)), (world, x))
    ]
    assert gaps[1][pairs.index("shin-floor")] == pytest.approx(gaps[0][pairs.index("shin-floor")])


def test_a_plane_through_a_point_moves_too(load_both: Load) -> None:
    tilted = ("normal = [0, 0, 2]\noffset = 0.4", "normal = [1, 0, 1]\npoint = [0, 0, 0]")
    plane = (
        load_both(robot=tilted, problem=('robot.toml"', 'robot.toml"\nposition = [1, 0, 0]\nyaw_deg = 180'))
        .world()
        .statics[0]
    )
    assert np.array(plane.normal) == pytest.approx(np.array([-1, 0, 1]) / np.sqrt(2))
    assert plane.offset == pytest.approx(-1 / np.sqrt(2))


def test_a_robot_stands_twice_with_prefixes(load_both: Load) -> None:
    twice = (
        'robot.toml"\nprefix = "left_"\n[[include]]\nfile = "parts/robot.toml"\nprefix = "right_"\nposition = [0, 5, 0]'
    )
    text = MAIN.replace('robot.toml"', twice, 1).replace("knee.angle - 0.5", "left_knee.angle + right_bend[1] - 0.5")
    problem = load_both(problem=(MAIN, text))
    assert [body.name for body in problem.parametric.bodies] == [
        "left_torso",
        "left_shin",
        "right_torso",
        "right_shin",
        "ball",
    ]
    assert [(joint.second, joint.first) for joint in problem.parametric.joints[:2]] == [
        ("left_torso", "left_shin"),
        (None, "left_torso"),
    ]
    assert problem.parametric.bodies[1].collides_with == {"left_floor"}
    assert problem.parametric.bodies[2].group == "right_robot"
    assert [variable.slots[0].name for variable in problem.variables] == ["left_knee.command", "right_knee.command"]
    assert [(cost.name, cost.formula.text) for cost in problem.costs] == [
        ("left_effort", "left_knee.command"),
        ("right_effort", "right_knee.command"),
    ]


def test_shipped_robots_are_found_from_anywhere(load_both: Load) -> None:
    text = MAIN.replace("parts/robot.toml", "robots/arm.toml").replace("knee.angle", "elbow.angle")
    problem = load_both(problem=(MAIN, text))
    assert "forearm" in [body.name for body in problem.parametric.bodies]


def test_an_absolute_path_and_a_file_beside_go_before_shipped_ones(load_both: Load, tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    other = tmp_path / "robots" / "arm.toml"
    other.write_text(ROBOT, encoding="utf-8")
    for file in ("robots/arm.toml", str(other)):
        assert load_both(problem=("parts/robot.toml", file)).parametric.bodies[0].name == "torso"


def test_terrain_stays_where_it_is(load_both: Load) -> None:
    problem = load_both(robot=("[[plane]]", '[[terrain]]\nname = "hills"\nheight = "0.1 * x"\n[[plane]]'))
    assert [part.name for part in problem.parametric.statics] == ["floor", "post", "hills"]


def test_prefixes_reach_names_of_the_start_and_the_end() -> None:
    data = {"body": [{"name": "leg"}], "cost": [{"name": "x", "value": "end.leg.position[0] - start.leg.x + my.leg.x"}]}
    assert prefixed(data, "l_")["cost"][0]["value"] == "end.l_leg.position[0] - start.l_leg.x + my.leg.x"


def test_prefixes_reach_tables_of_any_kind() -> None:
    """Names and groups of the file where texts mention them, and no others: keys after a dot, functions, labels."""
    data = {
        "body": [{"name": "eye", "group": "eyes", "collides_with": ["eyes", "ground"]}],
        "sensor": [{"name": "gaze", "on": "eye", "value": "[eye.position[0:2], eyelid.eye, norm(gaze)]"}],
        "cost": [{"name": "norm", "at": "end", "squares": "gaze"}],
        "world": {"gravity": [0, 0, 0]},
    }
    assert prefixed(data, "l_") == {
        "body": [{"name": "l_eye", "group": "l_eyes", "collides_with": ["l_eyes", "ground"]}],
        "sensor": [{"name": "l_gaze", "on": "l_eye", "value": "[l_eye.position[0:2], eyelid.eye, norm(l_gaze)]"}],
        "cost": [{"name": "l_norm", "at": "end", "squares": "l_gaze"}],
        "world": {"gravity": [0, 0, 0]},
    }


BRAIN = """
[[sensor]]
name = "gaze"
reads = ["knee.angle", "torso.gyro"]

[[controller]]
name = "brain"
drives = "knee.command"
senses = ["gaze"]
net = { weights = "gaze.npy", biases = false }
"""


def test_a_robot_brings_its_controller(load_both: Load, tmp_path: Path) -> None:
    """With a prefix; weights lie beside the file that names them."""
    weights = [0.1, 0.2, 0.3, 0.4]
    (tmp_path / "parts").mkdir()
    np.save(tmp_path / "parts" / "gaze.npy", weights)
    fewer = ("knee.angle - 0.5", "left_knee.angle")
    text = MAIN.replace('robot.toml"', 'robot.toml"\nprefix = "left_"').replace(*fewer)
    problem = load_both(robot=("[[variable]]", BRAIN + "[[variable]]"), problem=(MAIN, text))
    (controller,) = problem.controllers
    assert (controller.name, controller.senses, controller.drives) == (
        "left_brain",
        ("left_gaze",),
        (("left_knee.command", 0),),
    )
    assert controller.numbers["weights"].tolist() == weights


def test_every_list_of_a_problem_is_put_together() -> None:
    lists = {name for name, key in json_schema()["properties"].items() if key.get("type") == "array"}
    assert set(LISTS) == lists - {"solvers"}
    assert {"body", "joint", "terrain", "target"} <= lists
