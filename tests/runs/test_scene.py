"""scene.json has the sizes, places and joints that the variables set, in SI units."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from symphys.problem import Problem, load_problem
from symphys.results.scene import Solid
from symphys.results.scene_joints import SceneJoint
from symphys.results.scene_of_problem import make_scene
from symphys.transcription import transcribe

SHAPES = """
[simulation]
duration = 0.1
dt = 0.01
[[body]]
name = "tower"
shape = { parts = [
    { box = { size = [1, 2, 3] }, orientation = { yaw_deg = 90 } },
    { sphere = { radius = 0.5 }, centre = [0, 0, 1] },
    { sphere = { radius = 0.5 }, centre = [0, 0, -1] },
] }
mass = 2.0
position = [0, 0, 9]
[[body]]
name = "bar"
shape = { capsule = { radius = 0.1, length = 2 } }
mass = 1.0
position = [4, 1, 9]
[ground]
[[block]]
name = "ramp"
shape = { box = { size = [2, 1, 0.5] } }
position = [1, 2, 0]
[[terrain]]
name = "hills"
height = "x - 2 * y"
[[variable]]
name = "build"
sets = ["bar.length"]
[[variable]]
name = "where"
sets = "ramp.position[0:2]"
"""
BALL = """
[simulation]
duration = 1.0
dt = 0.1
[[body]]
name = "ball"
shape = { sphere = { radius = 0.5 } }
mass = 1.0
position = [0, 0, 50]
velocity = [20, 0, 0]
[[terrain]]
name = "hills"
height = "sqrt(8 - x)"
[[variable]]
name = "throw"
sets = "ball.velocity"
"""
ARM = """
[simulation]
duration = 0.1
dt = 0.01
[world]
gravity = [0, 0, -5]
[[body]]
name = "upper"
mass = 2.0
inertia = 0.1
position = [0, 0, -0.5]
[[body]]
name = "lower"
mass = 1.0
inertia = 0.1
position = [0, 0, -1.5]
[[joint]]
name = "shoulder"
between = ["world", "upper"]
universal = { axes = [[0, 1, 0], [1, 0, 0]] }
point = [0, 0, 0]
motor = { velocity = { torque = 3, velocity = 4 } }
[[joint]]
name = "elbow"
between = ["upper", "lower"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, -1]
limits = [-inf, 2]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
[[joint]]
name = "strut"
between = ["world", "lower"]
ball = {}
point = [0, 0, -2]
frequency = 2
[[variable]]
name = "made"
sets = "elbow.torque"
guess = 30.0
"""
Z = {"build": np.array([[3.0]]), "where": np.array([[7.0], [8.0]])}


def problem_of(folder: Path, text: str) -> Problem:
    path = folder / "problem.toml"
    path.write_text(text, encoding="utf-8")
    return load_problem(path)


@pytest.mark.slow
def test_shapes_have_the_sizes_that_variables_set(tmp_path: Path) -> None:
    found = make_scene(problem_of(tmp_path, SHAPES), Z).to_json()
    tower, bar = found["bodies"]
    box, ball, _ = tower["shapes"]
    assert {**box, "orientation": None} == {"kind": "box", "size": [1, 2, 3], "centre": [0, 0, 0], "orientation": None}
    assert box["orientation"] == pytest.approx([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert ball == {"kind": "sphere", "radius": 0.5, "centre": [0, 0, 1]}
    upright = {"centre": [0, 0, 0], "orientation": [1, 0, 0, 0]}
    assert bar["shapes"] == [{"kind": "capsule", "radius": 0.1, "length": 3.0, **upright}]
    assert found["planes"] == [{"name": "ground", "normal": [0, 0, 1], "offset": 0}]
    (ramp,) = found["fixtures"]
    assert ramp == {
        "name": "ramp",
        "shape": {"kind": "box", "size": [2, 1, 0.5], "centre": [7, 8, 0], "orientation": [1, 0, 0, 0]},
    }
    json.dumps(found, allow_nan=False)


ROUND = """
[simulation]
duration = 0.1
dt = 0.01
[ground]
[[body]]
name = "crate"
shape = { box = { size = [1, 2, 3], edge = 0.1 } }
mass = 2.0
position = [0, 0, 9]
[[variable]]
name = "edge"
sets = "crate.edge"
[[variable]]
name = "centre"
sets = "crate.centre_of_mass"
[[variable]]
name = "tilt"
sets = "ground.tilt"
[[cost]]
name = "none"
value = "0"
"""


def test_round_edges_centres_of_mass_and_tilt_are_drawn(tmp_path: Path) -> None:
    z = {"edge": np.array([0.2]), "centre": np.array([0.1, 0, 0]), "tilt": np.array([0, 0.3])}
    scene = make_scene(problem_of(tmp_path, ROUND), z)
    (solid,) = scene.bodies[0].solids
    assert (solid.radius, solid.half.tolist()) == (0.2, pytest.approx([0.3, 0.8, 1.3]))
    assert solid.centre.tolist() == [-0.1, 0, 0]
    assert scene.planes[0].normal == pytest.approx([np.sin(0.3), 0, np.cos(0.3)])
    again = Solid.from_json(json.loads(json.dumps(solid.to_json(), allow_nan=False)))
    assert again is not None
    assert (again.radius, again.corners.tolist()) == (solid.radius, solid.corners.tolist())


@pytest.mark.slow
def test_terrain_is_sampled_around_the_start(tmp_path: Path) -> None:
    (hills,) = make_scene(problem_of(tmp_path, SHAPES), Z).to_json()["terrain"]
    x, y, z = (np.array(hills[key]) for key in "xyz")
    assert hills["name"] == "hills"
    np.testing.assert_allclose(z, x - 2 * y[:, None], atol=1e-5)
    assert x[0] < -1.8
    assert x[-1] > 4 + 1.6
    assert y[0] < -1.8
    assert y[-1] > 1 + 1.6
    assert z.shape == (len(y), len(x))
    assert z.size <= 49 * 49


def test_terrain_is_sampled_along_the_motion(tmp_path: Path) -> None:
    """Where its formula has no value, there is none."""
    problem = problem_of(tmp_path, BALL)
    bare = replace(problem, parametric=replace(problem.parametric, statics=()))
    motion = transcribe(bare, backend="casadi").simulate(np.array([20.0, 0, 0]))
    (hills,) = make_scene(problem, {}, motion).to_json()["terrain"]
    x, z = np.array(hills["x"]), np.array(hills["z"])
    assert x[-1] > 20.5
    assert np.isnan(z[:, x > 8]).all()
    assert np.isfinite(z[:, x < 8]).all()


def test_joints_are_told_with_all_that_a_report_needs(tmp_path: Path) -> None:
    """Frames in the frames of the bodies; the motor's bound is that which a variable sets."""
    found = make_scene(problem_of(tmp_path, ARM), {"made": np.array([[12.0]])}).to_json()
    assert found["gravity"] == [0, 0, -5]
    assert [(body["name"], body["mass"]) for body in found["bodies"]] == [("upper", 2.0), ("lower", 1.0)]
    shoulder, elbow, strut = found["joints"]
    assert (elbow["name"], elbow["kind"], elbow["first"], elbow["second"]) == ("elbow", "hinge", "lower", "upper")
    assert elbow["motor"] == {"kind": "servo", "gain": 20, "torque": 12, "velocity": 8}
    assert elbow["limits"] == [None, 2]
    assert elbow["coordinates"] == [{"name": "angle", "turns": True, "side": 1, "axis": 0}]
    assert [frame["point"] for frame in elbow["sockets"]] == [[0, 0, 0.5], [0, 0, -0.5]]
    turned = Rotation.from_quat(np.roll(elbow["sockets"][0]["orientation"], -1))
    np.testing.assert_allclose(turned.apply([1, 0, 0]), [0, 1, 0], atol=1e-12)
    assert (shoulder["second"], shoulder["sockets"][1]["point"]) == (None, [0, 0, 0])
    assert shoulder["motor"] == {"kind": "velocity", "torque": 3, "velocity": 4}
    assert [each["name"] for each in shoulder["coordinates"]] == ["angle1", "angle2"]
    assert (strut["motor"], strut["coordinates"], strut["limits"]) == (None, [], [None, None])
    json.dumps(found, allow_nan=False)
    (read,) = [SceneJoint.from_json(elbow)]
    assert read is not None and (read.axes, read.rotates) == (((1, 0),), True)


@pytest.mark.parametrize("more", [{}, {"side": 2, "axis": 0}], ids=["old", "damaged"])
def test_axes_of_files_without_them_are_those_of_the_kind(more: dict[str, Any]) -> None:
    side = {"point": [0, 0, 0], "orientation": [1, 0, 0, 0]}
    rail = {"name": "rail", "kind": "slider", "first": "cart", "second": None, "sockets": [side, side]}
    read = SceneJoint.from_json({**rail, "coordinates": [{"name": "position", "turns": False, **more}]})
    assert read is not None and (read.axes, read.rotates) == (((1, 0),), False)
