"""Screws in MJCF: a hinge and a slide that follows it by an equality, written, moved by MuJoCo and read again."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

from symphys import simulate
from symphys.export import problem_model
from symphys.importing.records import ImportOptions
from symphys.importing.robot import read_robot
from symphys.problem import Problem, problem_of_tables

mujoco = pytest.importorskip("mujoco")
MODEL = """
<mujoco>
  <worldbody>
    <body name="table">
      <joint name="swing" axis="0 1 0"/>
      <geom type="box" size="0.2 0.1 0.05"/>
      <body name="nut" pos="0.3 0 0" euler="0 20 0">
        <joint name="screw" axis="0 0 1" pos="0.1 0 0" armature="0.01" range="-400 400"/>
        <joint name="lift" type="slide" axis="0 0 {way}" {more}/>
        <geom type="sphere" size="0.05" mass="1"/>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="{first}" joint2="{second}" polycoef="0 {ratio} {square} 0 0"/></equality>
  <actuator><motor joint="screw" gear="2"/></actuator>
  <sensor><jointpos name="turned" joint="screw"/></sensor>
</mujoco>
"""


def arm(pitch: float, dt: float = 0.002) -> Problem:
    """A nut on an oblique screw of an arm that swings, away from where the coordinates are 0."""
    inertia = [0.02, 0.02, 0.01]
    screw = {"axis": [1, 0.2, 0.5], "pitch": pitch}
    acting = {
        "armature": 0.001,
        "start": 0.7,
        "spring": {"stiffness": 0.02, "damping": 0.001, "rest": 0.1},
        "motor": {"torque": {"torque": 1.0}},
    }
    return problem_of_tables(
        {
            "simulation": {"duration": 0.4, "dt": dt},
            "body": [
                {"name": "arm", "mass": 1.0, "inertia": inertia, "position": [0, 0, 1], "collides_with": []},
                {"name": "nut", "mass": 0.7, "inertia": inertia, "position": [0.3, 0, 1], "collides_with": []},
            ],
            "joint": [
                {"name": "swing", "between": ["world", "arm"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 1.2]},
                {"name": "screw", "between": ["arm", "nut"], "helical": screw, "point": [0.2, 0, 1], **acting},
            ],
        }
    )


@pytest.mark.parametrize("pitch", [0.2, -0.1])
def test_mujoco_moves_a_screw_alike(pitch: float) -> None:
    """With its equality as stiff as its step allows."""
    problem = arm(pitch, dt=0.001)
    model = mujoco.MjModel.from_xml_string(problem_model(problem).text)
    model.eq_solref[:], model.eq_solimp[:] = (0.002, 1), (0.9999, 0.99999, 0.001, 0.5, 2)
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    motion, nut = simulate(problem), model.body("nut").id
    assert data.xpos[nut] == pytest.approx(motion.position[0, 1], abs=1e-12)
    for _ in range(400):
        mujoco.mj_step(model, data)
    assert np.abs(motion.position[-1, 1] - motion.position[0, 1]).max() > 0.1
    assert data.xpos[nut] == pytest.approx(motion.position[-1, 1], abs=2e-6)
    assert data.qpos[:2] == pytest.approx([motion["swing.angle"][-1], motion["screw.angle"][-1]], abs=1e-5)


@few("pitch", [0.2, -0.1], 1)
def test_a_screw_comes_back(pitch: float, tmp_path: Path) -> None:
    problem = arm(pitch)
    made = problem_model(problem)
    assert [each.what for each in made.departures] == [("screw.thread",)]
    path = tmp_path / "arm.xml"
    path.write_text(made.text, encoding="utf-8")
    tables = read_robot(path, ImportOptions(keyframe="start")).tables
    assert not tables.get("coupling")
    _, screw = tables["joint"]
    (_, was) = problem.parametric.joints
    assert screw["helical"]["pitch"] == pytest.approx(pitch)
    assert (screw["name"], screw["start"], screw["armature"]) == ("screw", pytest.approx(0.7), 0.001)
    assert screw["spring"] == pytest.approx({"stiffness": 0.02, "damping": 0.001, "rest": 0.1})
    again = problem_of_tables({"simulation": {"duration": 0.4, "dt": 0.002}, **tables})
    assert again.parametric.joints[1].kind.numbers["pitch"] == pytest.approx(was.kind.numbers["pitch"])
    assert simulate(again).position[-1] == pytest.approx(simulate(problem).position[-1], abs=1e-9)


def imported(tmp_path: Path, **given: Any) -> dict[str, Any]:
    words = {"way": 1, "more": "", "first": "lift", "second": "screw", "ratio": 0.01, "square": 0, **given}
    path = tmp_path / "model.xml"
    path.write_text(MODEL.format(**words), encoding="utf-8")
    return read_robot(path, ImportOptions()).tables


@few(
    ("given", "pitch"),
    [
        ({}, 0.02 * pi),
        ({"way": -1}, -0.02 * pi),
        ({"first": "screw", "second": "lift", "ratio": -50}, -0.04 * pi),
    ],
    1,
    ids=["slide follows", "axes against each other", "hinge follows"],
)
def test_a_slide_that_follows_a_hinge_is_a_screw(tmp_path: Path, given: dict[str, Any], pitch: float) -> None:
    tables = imported(tmp_path, **given)
    swing, screw = tables["joint"]
    assert "hinge" in swing
    assert screw["helical"]["pitch"] == pytest.approx(pitch)
    assert screw["helical"]["axis"] == pytest.approx([np.sin(np.deg2rad(20)), 0, np.cos(np.deg2rad(20))])
    assert screw["limits"] == pytest.approx(np.deg2rad([-400, 400]))
    assert (screw["armature"], screw["motor"]["affine"]["gear"]) == (0.01, 2)
    assert [body["name"] for body in tables["body"]] == ["table", "nut"]
    assert not tables.get("coupling")
    assert [sensor["name"] for sensor in tables["sensor"]] == ["turned"]


@few(
    "given",
    [{"more": 'damping="1"'}, {"more": 'range="-1 1"'}, {"more": 'stiffness="3"'}, {"square": 0.3}],
    1,
    ids=["damped", "limited", "sprung", "curved"],
)
def test_other_slides_stay_coupled(tmp_path: Path, given: dict[str, Any]) -> None:
    tables = imported(tmp_path, **given)
    kinds = [next(iter({"hinge", "slider", "helical"} & joint.keys())) for joint in tables["joint"]]
    assert kinds == ["hinge", "hinge", "slider"]
    assert len(tables["coupling"]) == 1
