"""What was read of a model moves as MuJoCo moves it: frames, inertias, joints, springs, motors, in free motion."""

from __future__ import annotations

import numpy as np
import pytest
from data.imported import Tables, apart, by_name, model_of, mujoco_motion, problem_of, read, texts

import symphys

pytest.importorskip("mujoco")
COST = [{"name": "height", "value": "hull.position[2]"}]

CHAIN = """<option gravity="1 2 -9.81"/><worldbody><body name="base" pos="0.1 0.2 1" euler="0.3 0.2 -0.4">
<inertial pos="0.02 -0.01 0.03" mass="3" diaginertia="0.05 0.06 0.03" euler="0.5 0.1 0.2"/>
<joint name="x" type="slide" axis="1 0 0.2" ref="0.3" armature="0.3" stiffness="4" springref="0.5"/>
<joint name="turn" axis="0 1 0" pos="0.05 0 0.1" ref="0.4" damping="0.2" stiffness="2" springref="0.1"/>
<body name="fixed" pos="0 0.2 0.1" euler="0 0.7 0"><inertial pos="0.1 0 0" mass="0.7" diaginertia="0.01 0.02 0.015"/>
<body name="leg" pos="0.1 0.05 -0.3" euler="0.2 0 0.9"><inertial pos="0 0.03 0" mass="1" diaginertia="0.02 0.03 0.015"/>
<joint name="hip" axis="1 0 0" pos="-0.02 0 0.2" armature="0.05" damping="0.2" stiffness="3"/>
<joint name="roll" axis="0 0.2 1" pos="-0.02 0.1 0.2"/><joint name="yaw" axis="0 1 0" pos="-0.03 0.01 0.2"/>
<body name="toe" pos="0 0 -0.3"><inertial pos="0 0 0" mass="0.2" diaginertia="0.001 0.002 0.0025"/>
</body></body></body></body></worldbody>"""
FLYER = """<worldbody><body name="trunk" pos="0 0 2" euler="0.3 0 0.1"><freejoint/>
<inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>
<body name="arm" pos="0.3 0 0" euler="0 0.4 0"><joint name="shoulder" type="ball" pos="-0.1 0 0.05" armature="0.02"/>
<inertial pos="0.05 0.1 0" mass="1" diaginertia="0.01 0.02 0.015"/></body>
<body name="wheel" pos="-0.3 0 0"><joint name="axle" axis="1 0.5 0" stiffness="6" springref="1.2"/>
<inertial pos="0 0.05 0.1" mass="0.5" diaginertia="0.005 0.004 0.003"/></body></body></worldbody>"""


def errors(xml: str, tables: Tables, duration: float, bodies: dict[str, str]) -> list[float]:
    """How far from MuJoCo's motion at two time steps [m]."""
    model = model_of(xml)
    data = mujoco_motion(model, duration)
    steps = (0.01, 0.005)
    return [apart(model, data, symphys.simulate(problem_of(tables, duration, dt)), bodies) for dt in steps]


@pytest.mark.slow
def test_a_chain_of_welded_bodies_and_several_joints() -> None:
    tables, findings = read(CHAIN)
    assert [body["mass"] for body in tables["body"]] == [0, 3.7, 0, 0, pytest.approx(1.2, abs=1e-15)]
    assert "body base: with what no joint lets move against it: fixed" in texts(findings, "taken")
    model = model_of(CHAIN)
    data = mujoco_motion(model, 0.3)
    motions = [symphys.simulate(problem_of(tables, 0.3, dt)) for dt in (0.01, 0.005)]
    wanted = data.subtree_com[model.body("base").id]
    off = []
    for motion in motions:
        whole = 3.7 * motion["base.position"][-1] + 1.2 * motion["leg.position"][-1]
        off.append(float(np.linalg.norm(whole / 4.9 - wanted)))
        off.append(float(abs(motion["turn.angle"].ravel()[-1] + 0.4 - data.joint("turn").qpos[0])))
        off.append(float(abs(motion["yaw.angle"].ravel()[-1] - data.joint("yaw").qpos[0])))
    assert max(off[3:]) < 2e-4
    assert off[:3] == pytest.approx([4 * each for each in off[3:]], rel=0.1)


@pytest.mark.slow
def test_a_floating_body_with_a_ball_joint() -> None:
    tables, _ = read(FLYER)
    coarse, fine = errors(FLYER, tables, 0.3, {name: name for name in ("trunk", "arm", "wheel")})
    assert fine < 5e-4
    assert coarse == pytest.approx(4 * fine, rel=0.1)


MOTORS = """<worldbody><body name="a"><joint name="one" axis="0 1 0" ref="0.2"/>
<inertial pos="0 0 -0.3" mass="1" diaginertia="0.03 0.03 0.01"/>
<body name="b" pos="0 0 -0.5"><joint name="two" axis="0 1 0" actuatorfrcrange="-0.2 0.35"/>
<inertial pos="0 0 -0.2" mass="0.5" diaginertia="0.01 0.01 0.01"/>
<body name="c" pos="0 0 -0.4"><joint name="three" axis="1 0 0" armature="0.1"/>
<inertial pos="0 0.1 -0.2" mass="0.2" diaginertia="0.004 0.004 0.004"/></body></body></body></worldbody>
<tendon><fixed name="string"><joint joint="three" coef="-0.5"/></fixed></tendon>
<actuator><position name="servo" joint="one" kp="7" kv="0.3" gear="1.5" ctrlrange="-1 0.4"/>
<general name="push" jointinparent="two" gear="2" gainprm="3" forcerange="-0.5 2"/>
<motor name="pull" tendon="string" gear="0.8" ctrlrange="-9 9"/></actuator>"""


@pytest.mark.slow
def test_motors_act_as_mujoco_has_them() -> None:
    """Command 0.6: beyond the range of the servo and the force of the push."""
    tables, _ = read(MOTORS)
    joints = by_name(tables, "joint")
    assert joints["one"]["motor"]["affine"]["offset"] == pytest.approx(-7 * 1.5 * 0.2)
    assert joints["two"]["motor"]["affine"]["force_range"] == [-0.1, 0.175]
    assert joints["three"]["motor"]["affine"]["gear"] == -0.4
    variable = {"name": "push", "sets": [f"{name}.command" for name in joints], "guess": 0.6}
    model = model_of(MOTORS)
    data = mujoco_motion(model, 0.3, ctrl=0.6)
    off = []
    for dt in (0.01, 0.005):
        motion = symphys.simulate(problem_of(tables, 0.3, dt, variable=[variable]))
        off.append(apart(model, data, motion))
    assert off[1] < 3e-5
    assert off[0] == pytest.approx(4 * off[1], rel=0.15)


SPREAD = """<worldbody><body><joint name="j" axis="0 1 0"/><inertial pos="0 0 -0.2" mass="1" diaginertia="1 1 1"/>
</body>
</worldbody><actuator><position name="p" joint="j" kp="5" gear="2"/><velocity name="v" joint="j" kv="3"/>
<general name="late" joint="j" dyntype="filter" dynprm="0.04" forcerange="-1 1"/>
<general name="sum" joint="j" dyntype="integrator" actlimited="true" actrange="-1 1"/>
<muscle name="flesh" joint="j" lengthrange="0.5 1"/></actuator>"""


def test_one_motor_of_several_actuators() -> None:
    """The velocity actuator at command 0 is a damper: 3 N m s/rad, seen through the gear of 2."""
    tables, findings = read(SPREAD)
    motor = tables["joint"][0]["motor"]["affine"]
    assert motor == {"gain": 5.0, "kp": 5.0, "kv": 0.75, "gear": 2.0}
    lost, near = texts(findings, "left out"), texts(findings, "approximated")
    assert "actuator v, sum: j has one motor, which is actuator p; this acts as with command 0" in near
    assert "actuator late: j has one motor" in lost
    assert "actuator flesh: muscles" in lost
    assert "activation of actuator late: the command acts at once 0.04 s" in near
    assert "activation of actuator sum: the command is what the actuator would integrate it to" in near


WINCH = """<option gravity="0 0 0"/><worldbody><body><joint name="drum" axis="0 1 0" ref="1" range="-20 30"
limited="true" stiffness="2" springref="15"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.5 0.5 0.5"/></body></worldbody>
<actuator><position name="p" joint="drum" kp="2"/></actuator><keyframe><key name="wound" qpos="9"/></keyframe>"""


@pytest.mark.slow
def test_angles_of_many_turns_are_as_mujoco_has_them() -> None:
    """A range, a spring's reference, a start and a command turns away from 0."""
    tables, findings = read(WINCH, keyframe="wound")
    joint = tables["joint"][0]
    assert joint["limits"] == [-21, 29]
    assert joint["spring"]["rest"] == 14
    assert joint["start"] == 8
    assert "drum" not in texts(findings, "left out")
    variable = {"name": "aim", "sets": "drum.command", "guess": 20.0}
    motion = symphys.simulate(problem_of(tables, 1.0, 0.01, variable=[variable]))
    data = mujoco_motion(model_of(WINCH), 1.0, ctrl=20.0, qpos=np.array([9.0]))
    assert data.qpos[0] > 20
    assert motion["drum.angle"][-1] == pytest.approx(data.qpos[0] - 1, abs=2e-3)


def test_switches_of_the_model() -> None:
    xml = """<option><flag gravity="disable" spring="disable" damper="disable" limit="disable" frictionloss="disable"
    actuation="disable" contact="disable"/></option><worldbody><geom type="plane" size="1 1 1"/>
    <body name="b" pos="0 0 1"><joint name="j" stiffness="1" damping="2" limited="true" range="-1 1" frictionloss="3"/>
    <geom size="0.1"/></body></worldbody><actuator><motor joint="j"/></actuator>"""
    tables, findings = read(xml)
    joint = tables["joint"][0]
    assert joint.keys() == {"name", "between", "hinge", "point"}
    assert tables["world"]["gravity"] == [0, 0, 0]
    assert tables["body"][0]["collides_with"] == []
    assert "switch actuators off" in texts(findings, "left out")
    assert not problem_of(tables).world().pairs


GIMBAL = """<worldbody><body name="arm" pos="0 0 1"><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.03 0.025"/>
<joint name="yaw" axis="0 0 1"/><joint name="pitch" axis="0 1 0"/><joint name="roll" axis="1 0 0"/>
</body></worldbody>"""


def test_joints_of_one_body_that_can_lock_get_an_armature() -> None:
    """A tenth of the body's largest moment on the first, and it is said; not where limits keep axes apart."""
    tables, findings = read(GIMBAL)
    assert [joint.get("armature") for joint in tables["joint"]] == [pytest.approx(0.003), None, None]
    assert "armature of" in texts(findings, "approximated")
    problem_of(tables, 0.1, 0.01)
    held, _ = read(GIMBAL.replace('"0 1 0"', '"0 1 0" limited="true" range="-1.2 1.2"'))
    assert not any("armature" in joint for joint in held["joint"])


def test_actuators_at_sites_act_as_mujoco_has_them() -> None:
    """Two at one site, one called as its site is, with gains and bounds of forces; others are named."""
    xml = """<worldbody><body name="hull" pos="0 0 2"><freejoint/>
    <inertial pos="0.01 0 0.02" mass="1.3" diaginertia="0.03 0.04 0.06"/>
    <site name="left" pos="0 0.2 0.05" euler="0.2 0.1 0"/><site name="mount" pos="0 -0.2 0.05"/></body>
    <site name="pole" pos="1 0 0"/></worldbody><actuator><motor name="left" site="left" gear="0 0 2 0 0 -0.04"/>
    <motor name="thrust" site="mount" gear="0 0 1 0 0 0.02" ctrlrange="0 2"/>
    <general name="turn" site="mount" gear="0 0 0 0 0.1 0" gainprm="2" forcerange="-5 3"/>
    <motor name="away" site="mount" refsite="pole" gear="1 0 0 0 0 0"/>
    <general name="damped" site="mount" gear="1 0 0 0 0 0" biastype="affine" biasprm="0 0 -1"/>
    <motor name="idle" site="mount" gear="0 0 0 0 0 0"/></actuator>"""
    tables, findings = read(xml)
    sites = by_name(tables, "site")
    assert [name for name, table in sites.items() if "motor" in table] == ["left", "thrust", "turn"]
    assert sites["turn"]["motor"] == {"torque": [0, 0.2, 0], "command_range": [-2.5, 1.5]}
    left = texts(findings, "left out")
    assert "away: it acts along the axes of another site" in left
    assert "damped, idle: what it gives is not in proportion to its command" in left
    still, said = read(f'<option><flag actuation="disable"/></option>{xml}')
    assert not any("motor" in table for table in still["site"])
    assert "left, thrust, turn, away, damped, idle: the model's options switch actuators off" in texts(said, "left out")
    model = model_of(xml)
    model.actuator_biasprm[:] = 0  # what is left out
    data, commands = mujoco_motion(model, 0.3, [3.0, 3.0, 3.0, 0.0, 0.0, 0.0]), ("left", "thrust", "turn")
    drive = [{"name": f"u_{name}", "sets": f"{name}.command", "guess": 3.0} for name in commands]
    off = [
        apart(model, data, symphys.simulate(problem_of(tables, 0.3, dt, variable=drive, cost=COST)))
        for dt in (0.01, 0.005)
    ]
    assert off[1] < 3e-5
    assert off[0] == pytest.approx(4 * off[1], rel=0.1)
