"""Sites, sensors, keyframes and what closes loops, as MuJoCo has them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.imported import by_name, model_of, problem_of, read, texts

import symphys
from symphys.expression import parse
from symphys.importing.records import ImportProblem
from symphys.model.state_layout import input_sizes
from symphys.problem.quantities import duration_quantity, quantities
from symphys.problem.start import StartValues, at_guess, formula_names

mujoco = pytest.importorskip("mujoco")

BODY = """<worldbody><site name="mark" pos="1 2 3" euler="0 0 1"/>
<body name="hull" pos="0.3 -0.2 1" euler="0.4 0.2 0.1">
<freejoint/><inertial pos="0.1 0.02 0" mass="2" diaginertia="0.02 0.03 0.04"/><site name="nose" pos="0.3 0 0.1"/>
<body name="mast" pos="0 0.1 0.3" euler="0.5 0 0"><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.015"/>
<site name="top" pos="0 0 0.4" euler="0.3 0.1 0"/><geom name="flag" type="box" size="0.1 0.1 0.1" pos="0 0.2 0"/>
<body name="boom"><joint name="swing" axis="0 0 1" ref="0.3"/><geom size="0.05" pos="0.4 0 0" mass="0.5"/>
</body></body></body></worldbody>"""
SENSORS = """<sensor><framepos name="p" objtype="site" objname="top"/><framelinvel objtype="site" objname="top"/>
<frameangvel objtype="body" objname="mast"/><framequat objtype="xbody" objname="hull"/><framepos objtype="xbody"
objname="mast"/><framepos objtype="geom" objname="flag"/><framezaxis objtype="site" objname="top"/><gyro site="top"/>
<velocimeter site="top"/><jointpos joint="swing"/><jointvel joint="swing"/><subtreecom body="hull"/>
<subtreelinvel body="hull"/><framexaxis objtype="xbody" objname="boom"/><clock/></sensor>"""


def test_sensors_read_what_mujoco_senses() -> None:
    """At the start, in motion: every formula against MuJoCo's sensor, and each site's place."""
    xml = BODY + SENSORS
    tables, findings = read(xml)
    assert "sensors" not in texts(findings, "left out")
    model = model_of(xml)
    data = mujoco.MjData(model)
    speed, spin = np.array([0.5, -0.3, 0.2]), np.array([0.7, 0.4, -0.6])
    data.qvel[:3] = speed
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, data.qpos[3:7])
    data.qvel[3:6] = turn.reshape(3, 3).T @ spin
    mujoco.mj_forward(model, data)
    for body in tables["body"]:
        at = np.array(body["position"])
        body["velocity"] = (speed + np.cross(spin, at - data.xpos[1])).tolist()
        body["angular_velocity"] = spin.tolist()
    named = names_at_start(problem_of(tables))
    sensed = np.concatenate([np.array(parse(table["reads"]).evaluate(named)).ravel() for table in tables["sensor"]])
    assert sensed == pytest.approx(data.sensordata, abs=1e-12)
    for name in ("mark", "nose", "top"):
        assert np.array(named[f"{name}.position"]()).ravel() == pytest.approx(data.site(name).xpos, abs=1e-12)
    assert np.array(named["mast.position"]()).ravel() == pytest.approx(data.body("mast").xpos, abs=1e-12)


ARM = """<worldbody><body name="a" pos="0.3 -0.2 1" euler="0.4 0.2 0.1">
<joint name="s" axis="0 1 0" pos="0 0 0.2" armature="0.05"/>
<inertial pos="0.1 0.02 0" mass="2" diaginertia="0.02 0.03 0.04" euler="0.1 0.2 0.3"/>
<site name="sa" pos="0.3 0 0.1" euler="0.3 0.2 0.1"/>
<body name="b" pos="0 0.1 0.3" euler="0.5 0 0"><joint name="f" type="slide" axis="0 0.6 0.8"/><site name="sb"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.02 0.015"/>
<body name="c" pos="0.1 0.1 0.3"><joint type="ball" name="g"/><site name="sc" euler="0 0 1"/>
<inertial pos="0 0.05 0.1" mass="1" diaginertia="0.01 0.02 0.015"/>
<body name="d" pos="0 0 0.2"><inertial pos="0 0 0" mass="0.1" diaginertia="0.01 0.01 0.01"/><site name="sd"/></body>
</body></body></body></worldbody><sensor><force site="sa"/><torque site="sa"/><force site="sb"/><torque site="sb"/>
<force site="sc"/><torque site="sc"/>%s</sensor>"""


def test_force_and_torque_sensors_read_what_mujoco_senses() -> None:
    """Between bodies that joints hold, in motion, with a rotor; between welded bodies there is no joint to read."""
    tables, _ = read(ARM % "")
    model = model_of(ARM % "")
    data = mujoco.MjData(model)
    data.qvel[:] = [0.7, -1.2, 0.5, 0.4, -0.8]
    mujoco.mj_forward(model, data)
    for body in tables["body"]:
        velocity, at = np.zeros(6), np.array(body["position"])
        index = model.body(body["name"]).id
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, index, velocity, 0)
        body["velocity"] = (velocity[3:] + np.cross(velocity[:3], at - data.xpos[index])).tolist()
        body["angular_velocity"] = velocity[:3].tolist()
    named = names_at_start(problem_of(tables))
    sensed = np.concatenate([np.array(parse(table["reads"]).evaluate(named)).ravel() for table in tables["sensor"]])
    assert sensed == pytest.approx(data.sensordata, abs=1e-9)
    assert np.abs(data.sensordata[:6]).min() > 0.1
    _, findings = read(ARM % '<force site="sd"/>')
    assert "1 force" in texts(findings, "left out")


def names_at_start(problem: Any) -> dict[str, Any]:
    """What names in formulas are at the start."""
    world = problem.world()
    known = quantities(problem.parametric, problem.initial, input_sizes(world))
    known |= duration_quantity(problem.simulation.duration)
    values = at_guess(problem.parametric, known, ())
    return formula_names(values, StartValues().of(problem.parametric, values), ())


LEGS = """<worldbody><body name="top" pos="0 0 1"><freejoint/><geom size="0.1"/>
<body name="left" pos="-0.3 0 0"><joint name="a" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02"/>
<site name="here" pos="0 0 -0.5"/></body>
<body name="right" pos="0.3 0 0"><joint name="b" axis="0 1 0" ref="0.2"/><geom type="capsule" fromto="0 0 0 0 0 -0.4"
size="0.02"/><site name="there" pos="-0.6 0 -0.5"/></body></body></worldbody>
<equality><connect name="rod" body1="left" body2="right" anchor="0.1 0 -0.5"/>
<weld name="glue" body1="right" body2="left"/>
<connect name="pin" site1="here" site2="there"/><joint name="gear" joint1="b" joint2="a" polycoef="0.1 -2 0.3 0 0"/>
<joint name="lock" joint1="a" polycoef="0 0 0 0 0"/><weld name="off" body1="top" active="false"/>
<weld name="far" body1="left" body2="right" relpose="1 0 0 1 0 0 0"/></equality>"""


def test_loops_and_couplings() -> None:
    tables, findings = read(LEGS)
    joints, couplings = by_name(tables, "joint"), by_name(tables, "coupling")
    assert joints["rod"] == {
        "name": "rod",
        "between": ["left", "right"],
        "ball": {},
        "point": [-0.2, 0, 0.5],
        "collide": True,
    }
    assert joints["pin"]["point"] == [-0.3, 0, 0.5]
    assert joints["glue"]["fixed"] == {}
    assert couplings["gear"]["joints"] == ["b", "a"]
    assert couplings["gear"]["polynomial"] == [0.1, -2, 0.3, 0, 0]
    assert couplings["lock"]["joints"] == ["a"]
    lost = texts(findings, "left out")
    assert "equality off: it is not active" in lost
    assert "equality far: its two sides are apart at the reference pose" in lost
    assert "400 mm" in lost
    assert "softness of 5 equality constraints" in texts(findings, "approximated")


@pytest.mark.thorough
def test_a_coupled_pair_moves_as_the_polynomial_says() -> None:
    """MuJoCo's own coordinates are 0.2 more for b at its reference, where both engines' polynomials begin."""
    xml = LEGS.partition("<equality>")[0] + (
        '<equality><joint name="gear" joint1="b" joint2="a" polycoef="0 -0.5 0.3 0 0"/></equality>'
    )
    tables, _ = read(xml.replace('name="a" axis="0 1 0"', 'name="a" axis="0 1 0" stiffness="3" springref="0.8"'))
    held, findings = read(xml.replace("<freejoint/>", ""))
    assert "coupling" not in held
    assert "equality gear: its joints hang on the world one by one" in texts(findings, "left out")
    motion = symphys.simulate(problem_of(tables, 0.3))
    a, b = motion["a.angle"].ravel(), motion["b.angle"].ravel()
    assert np.abs(a).max() > 0.1
    assert b == pytest.approx(-0.5 * a + 0.3 * a**2, abs=1e-3)


KEYED = """<worldbody><body name="cart" pos="0 0 1"><freejoint/><geom size="0.1"/><body name="leg" pos="0.3 0 0">
<joint name="knee" axis="0 1 0" ref="0.3" range="0.1 1" limited="true"/><geom size="0.05"/></body>
<body name="eye" pos="0 0.4 0"><joint name="socket" type="ball"/><geom size="0.05"/></body></body></worldbody>
<keyframe><key name="up" qpos="1 2 3 0.6 0.8 0 0 0.5 0.8 0 0.6 0"/><key name="wide" qpos="1 2 3 1 0 0 0 2 1 0 0 0"/>
</keyframe>"""


def test_a_keyframe_is_where_a_robot_begins() -> None:
    xml, model = KEYED, model_of(KEYED)
    tables, _ = read(xml, keyframe="up")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    assert by_name(tables, "joint")["knee"]["start"] == pytest.approx(0.2)
    start = problem_of(tables).initial
    for name in ("cart", "leg", "eye"):
        assert start[f"{name}.position"] == pytest.approx(data.body(name).xipos, abs=1e-12)
        assert np.abs(start[f"{name}.orientation"] @ data.body(name).xquat) == pytest.approx(1, abs=1e-12)
    wide, findings = read(xml, keyframe="wide")
    assert by_name(wide, "joint")["knee"]["start"] == pytest.approx(0.7)
    assert "knee at 0.7" in texts(findings, "approximated")
    assert "keyframes up, wide" in texts(read(xml)[1], "left out")
    with pytest.raises(ImportProblem, match=r'robot.xml: keyframe: .*"wide"'):
        read(xml, keyframe="wyde")


def test_a_joint_whose_limits_leave_out_its_reference_begins_at_the_nearest() -> None:
    tables, findings = read(KEYED.replace("0.1 1", "0.9 1"))
    assert by_name(tables, "joint")["knee"]["start"] == pytest.approx(0.6)
    assert "knee at 0.6" in texts(findings, "approximated")
    assert problem_of(tables)
