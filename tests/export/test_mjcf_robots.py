"""What robots have beside bodies and hinges, as MuJoCo reads it: frames, rotors, actuators, loops, terrain, sensors."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

from symphys.export import ExportError, mjcf_model, problem_model
from symphys.export.mjcf_surfaces import deviation, window
from symphys.model.heightfield import Heightfield
from symphys.model.joints import BALL, FIXED, HINGE, AffineMotor, Joint, JointFrame
from symphys.model.shapes import Plane, Terrain
from symphys.model.world import Body, Law, World, make_world
from symphys.problem import Problem, problem_of_tables
from symphys.transcription.rollout import symbolic_rollout

LEG = {
    "simulation": {"duration": 0.1, "dt": 0.01},
    "body": [
        {"name": "torso", "mass": 2.0, "inertia": [0.1, 0.2, 0.15], "position": [0, 0, 1]},
        {"name": "leg_x", "mass": 0, "position": [0, 0, 0.9]},
        {"name": "leg_y", "mass": 0, "position": [0, 0, 0.9]},
        {"name": "leg", "mass": 0.5, "inertia": [0.01, 0.02, 0.015], "position": [0, 0.1, 0.6]},
        {"name": "foot", "mass": 0.2, "inertia": 0.001, "position": [0, 0.1, 0.3]},
    ],
    "joint": [
        {
            "name": "x",
            "between": ["torso", "leg_x"],
            "hinge": {"axis": [1, 0, 0]},
            "point": [0, 0, 0.9],
            "armature": 0.02,
            "friction": 0.1,
            "start": 0.3,
            "motor": {"affine": {"gear": 20, "command_range": [-1, 1]}},
        },
        {
            "name": "y",
            "between": ["leg_x", "leg_y"],
            "hinge": {"axis": [0, 1, 0]},
            "point": [0, 0, 0.9],
            "start": -0.4,
            "spring": {"stiffness": 3, "damping": 0.2, "rest": 0.1},
            "motor": {"affine": {"gain": 30, "kp": 20, "kv": 2, "offset": 0.5, "gear": 2, "force_range": [-5, np.inf]}},
        },
        {
            "name": "z",
            "between": ["leg_y", "leg"],
            "slider": {"axis": [0, 0, 1]},
            "point": [0, 0, 0.9],
            "start": 0.05,
            "limits": [-0.1, 0.2],
        },
        {"name": "ankle", "between": ["leg", "foot"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0.1, 0.35]},
    ],
    "coupling": [{"name": "tendon", "joints": ["ankle", "y"], "polynomial": [0.32, 0.5, -0.75]}],
    "site": [{"name": "toe", "body": "foot", "position": [0.1, 0, 0]}],
    "sensor": [
        {"name": "felt", "reads": ["x.angle", "y.rate", "toe.position", "torso.gyro", "foot.velocity", "time"]},
        {"name": "turned", "reads": "torso.accelerometer"},
    ],
}
SAME = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <worldbody>
    <body name="torso" pos="0 0 1"><freejoint/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.15"/>
      <body name="leg" pos="0 0 -0.1">
        <joint name="x" axis="1 0 0" armature="0.02" frictionloss="0.1"/>
        <joint name="y" axis="0 1 0" stiffness="3" damping="0.2" springref="0.1"/>
        <joint name="z" type="slide" axis="0 0 1" range="-0.1 0.2"/>
        <inertial pos="0 0.1 -0.3" mass="0.5" diaginertia="0.01 0.02 0.015"/>
        <body name="foot" pos="0 0.1 -0.55">
          <joint name="ankle" axis="0 1 0"/>
          <inertial pos="0 0 -0.05" mass="0.2" diaginertia="0.001 0.001 0.001"/>
          <site name="toe" pos="0.1 0 -0.05"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="ankle" joint2="y" polycoef="0.32 0.5 -0.75 0 0"/></equality>
  <actuator>
    <motor joint="x" gear="20" ctrlrange="-1 1"/>
    <general joint="y" gear="2" gainprm="30" biastype="affine" biasprm="0.5 -20 -2" forcerange="-5 1e10"/>
  </actuator>
</mujoco>
"""
"""The leg by hand, at coordinates 0."""


@pytest.fixture(scope="module")
def leg() -> Problem:
    return problem_of_tables(LEG, "leg")


def mass_matrix(model: Any, data: Any) -> Any:
    """(nv, nv)."""
    import mujoco

    found = np.zeros((model.nv, model.nv))
    for row, unit in zip(found, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return found


def test_a_chain_is_one_body_with_the_same_dynamics(leg: Problem) -> None:
    """Mass matrix, passive and actuator forces, and the coupling, in states far from the start."""
    mujoco = pytest.importorskip("mujoco")
    model, same = (mujoco.MjModel.from_xml_string(xml) for xml in (problem_model(leg).text, SAME))
    assert (model.nbody, model.njnt, model.neq) == (4, 5, 1)
    assert [model.joint(k).name for k in range(5)] == ["torso", "x", "y", "z", "ankle"]
    data, other, rng = mujoco.MjData(model), mujoco.MjData(same), np.random.default_rng(0)
    for _ in range(5):
        q, v, u = rng.uniform(-1, 1, same.nq), rng.uniform(-1, 1, same.nv), rng.uniform(-2, 2, 2)
        q[3:7] /= np.linalg.norm(q[3:7])
        for each, into in ((model, data), (same, other)):
            into.qpos, into.qvel, into.ctrl = q, v, u
            mujoco.mj_forward(each, into)
        assert mass_matrix(model, data) == pytest.approx(mass_matrix(same, other), abs=1e-12)
        for key in ("qfrc_passive", "qfrc_actuator", "qfrc_bias"):
            assert getattr(data, key) == pytest.approx(getattr(other, key), abs=1e-10), key
        assert data.efc_pos[0] == pytest.approx(other.efc_pos[0], abs=1e-12)
        assert data.site("toe").xpos == pytest.approx(other.site("toe").xpos, abs=1e-12)
    assert model.dof_frictionloss == pytest.approx(same.dof_frictionloss)
    assert model.jnt_range == pytest.approx(same.jnt_range)


def test_the_keyframe_closes_the_coupling_and_sensors_read_the_start(leg: Problem) -> None:
    mujoco = pytest.importorskip("mujoco")
    made = problem_model(leg)
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert data.efc_pos[0] == pytest.approx(0, abs=1e-12)
    foot = leg.initial["foot.position"]
    toe = data.sensor("felt_2").data
    assert np.linalg.norm(toe - foot) == pytest.approx(0.1)
    assert data.sensor("felt_0").data == pytest.approx([0.3])
    assert [model.sensor(k).name for k in range(model.nsensor)] == [*(f"felt_{k}" for k in range(6)), "turned"]
    kinds = {departure.how: departure.what for departure in made.departures}
    assert {departure.kind for departure in made.departures} == {"approximated"}
    assert ("tendon",) in kinds.values() and ("x",) in kinds.values() and ("z",) in kinds.values()


def test_sensors_without_counterpart_are_left_out_and_named() -> None:
    """They do nothing to the motion."""
    problem = problem_of_tables({**LEG, "sensor": [{"name": "wave", "reads": "sin(time)"}]}, "leg")
    made = problem_model(problem)
    assert [each.what for each in made.departures if each.kind == "left out"] == [("wave",)]
    assert "<!-- left out: wave: a sensor" in made.text
    assert fromstring(made.text).find("sensor") is None


@few(
    ("formula", "kind", "place", "turn"),
    [
        ("leg.position + rotate(leg.orientation, [0.1, 0.2, 0.3])", "framepos", [0.1, 0.2, 0.3], [1, 0, 0, 0]),
        (
            "leg.velocity + cross(leg.angular_velocity, rotate(leg.orientation, [0, 0, 1]))",
            "framelinvel",
            [0, 0, 1],
            [1, 0, 0, 0],
        ),
        ("rotate([0.6, 0.8, 0, 0], leg.gyro)", "gyro", [0, 0, 0], [0.6, -0.8, 0, 0]),
        ("leg.accelerometer", "accelerometer", [0, 0, 0], [1, 0, 0, 0]),
        ("x.torque / 20.0", "actuatorfrc", None, None),
    ],
    2,
)
def test_formulas_that_are_sensors_of_mujoco(formula: str, kind: str, place: Any, turn: Any) -> None:
    """A site is made where they read."""
    made = problem_model(problem_of_tables({**LEG, "sensor": [{"name": "felt", "reads": formula}]}, "leg"))
    model = fromstring(made.text)
    element = model.find(f".//sensor/{kind}")
    assert element is not None and element.attrib["name"] == "felt"
    if place is not None:
        site = model.find(f".//body[@name='leg']/site[@name='{element.get('site') or element.get('objname')}']")
        assert site is not None
        assert [float(x) for x in site.attrib["pos"].split()] == place
        assert [float(x) for x in site.attrib["quat"].split()] == turn


def test_reactions_of_joints_are_force_and_torque_sensors() -> None:
    """MuJoCo reads at the start what is read here; for a joint above a frame without mass it has no such sensor."""
    mujoco = pytest.importorskip("mujoco")
    still = {key: value for key, value in LEG.items() if key != "coupling"}
    acting = ("motor", "spring", "friction", "limits")  # which a state at the start does not know yet
    joints = [{k: v for k, v in joint.items() if k not in acting} for joint in LEG["joint"]]
    joints.append({"name": "stand", "between": ["world", "torso"], "fixed": {}})
    names = ("ankle.reaction_force", "rotate([0.6, 0.8, 0, 0], ankle.reaction_torque)", "z.reaction_force")
    problem = problem_of_tables(
        {**still, "joint": joints, "sensor": [{"name": "felt", "reads": [*names, "x.reaction_force"]}]}, "leg"
    )
    made = problem_model(problem)
    assert [each.what for each in made.departures if each.kind == "left out"] == [("felt_3",)]
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    rollout = symbolic_rollout(problem)
    read = rollout.control.sensor(problem.sensors[0])
    x0 = ca.Function("x0", [rollout.z, rollout.smoothing], [rollout.x0])(np.zeros(rollout.z.numel()), 0)
    expected = np.array(read(x0, ca.DM(0, 1), 0.0)).ravel()[:9]
    assert data.sensordata == pytest.approx(expected, abs=1e-9)
    assert np.linalg.norm(expected[:3]) > 0.05  # it nearly falls


def test_what_is_left_out_is_in_the_world_without_it() -> None:
    """Restitution and soft contacts go; the rest of the law stays."""
    world = make_world([Body.ball("ball", 0.1, 1.0)], [Plane.ground()], Law(0.7, 0.8))
    made = mjcf_model(world, {}, 0.01, approximate=True)
    (left,) = (each for each in made.departures if each.kind == "left out")
    assert left.what == ("ball-ground",) and "restitution" in left.how
    pair = fromstring(made.text).find(".//pair")
    assert pair is not None and pair.attrib["friction"].split()[0] == "0.7"


def test_a_joint_that_does_not_fit_is_refused_in_any_case() -> None:
    arm = Joint("arm", HINGE, 0, None, (JointFrame((0, 0, 1)), JointFrame()))
    with pytest.raises(ExportError, match=r"arm: .*joint"):
        mjcf_model(World((Body("rod", 2.0, 0.1),), joints=(arm,)), {}, 0.01, approximate=True)


def square(kind: Any, **more: Any) -> tuple[World, dict[str, Any]]:
    """Four rods in a square, held by hinges; the last joint closes the loop."""
    places = [(0.5, 0, 0), (1, 0, 0.5), (0.5, 0, 1), (0, 0, 0.5)]
    ends = [((0, 0, 0), (1, 0, 0)), ((1, 0, 0), (1, 0, 1)), ((1, 0, 1), (0, 0, 1)), ((0, 0, 1), (0, 0, 0))]
    turn = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
    joints = [Joint("root", HINGE, 0, None, (JointFrame((-0.5, 0, 0), turn), JointFrame((0, 0, 0), turn)))]
    for k in range(3):
        at = np.array(ends[k][1], float)
        frames = tuple(JointFrame(tuple(at - places[i]), turn) for i in (k + 1, k))
        joints.append(Joint(f"corner{k}", HINGE, k + 1, k, frames))  # type: ignore[arg-type]
    closing = (JointFrame((0, 0, -0.5), turn), JointFrame((0, 0, 0), turn))
    joints.append(Joint("last", kind, 3, None, closing, **more))
    world = World(tuple(Body(f"rod{k}", 1.0, 0.1) for k in range(4)), joints=tuple(joints))
    return world, {f"rod{k}.position": place for k, place in enumerate(places)}


@pytest.mark.parametrize(("kind", "rows"), [(BALL, 3), (FIXED, 6), (HINGE, 6)])
def test_loops_are_equality_constraints_that_hold_at_the_start(kind: Any, rows: int) -> None:
    mujoco = pytest.importorskip("mujoco")
    world, start = square(kind)
    made = mjcf_model(world, start, 0.01)
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.nefc == rows and np.abs(data.efc_pos).max() < 1e-12
    data.qpos[1] += 0.1
    mujoco.mj_forward(model, data)
    assert np.abs(data.efc_pos).max() > 0.01
    assert any(each.what == ("last",) and "closes a loop" in each.how for each in made.departures)


def test_a_joint_that_gives_way_sags_as_here() -> None:
    """g / (2 pi f)^2, whatever the mass."""
    mujoco = pytest.importorskip("mujoco")
    joint = Joint("spring", BALL, 0, None, (JointFrame(), JointFrame()), frequency=2.0, damping=1.0)
    made = mjcf_model(World((Body("load", 3.0, 0.1),), joints=(joint,)), {}, 0.002)
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    for _ in range(1500):
        mujoco.mj_step(model, data)
    assert data.body("load").xpos[2] == pytest.approx(-9.81 / (4 * np.pi) ** 2, rel=2e-3)


HILLS = Heightfield(((0, 0.1, 0.3), (0.2, 0.5, 0.1), (0.1, 0, -0.2), (0.3, 0.2, 0)), (0.5, 0.4), (-0.5, 2.0))


@pytest.mark.slow
@pytest.mark.parametrize(("height", "approximate"), [(HILLS, False), (lambda x, y: 0.2 * ca.sin(x) * y, True)])
def test_terrain_is_a_height_field_as_near_as_told(height: Any, approximate: bool) -> None:
    """Heights by rays from above: on the grid exactly, between within what was told, which is attained to a tenth."""
    mujoco = pytest.importorskip("mujoco")
    terrain = Terrain("hills", height)
    world = make_world([Body.ball("ball", 0.1, 1.0, position=(0, 2.2, 9))], [terrain], Law(0.5))
    made = mjcf_model(world, dict(world.start), 0.01, approximate=approximate)
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    grid = window(_start(world), terrain)
    told, worst, rng = deviation(terrain, grid), 0.0, np.random.default_rng(0)
    hit, down = np.zeros(1, np.int32), np.array([0.0, 0.0, -1.0])
    for k in range(300):
        place = rng.uniform(0.01, 0.99, 2) * (np.array(grid.count) - 1)
        place = np.rint(place) if k < 20 else place
        x, y = np.array(grid.origin) + place * np.array(grid.spacing)
        if k < 20:
            x, y = x + 1e-9, y + 1e-9
        far = mujoco.mj_ray(model, data, np.array([x, y, 8.0]), down, None, 1, -1, hit)
        if hit[0] < 0 or model.geom(hit[0]).name != "hills":
            continue
        off = abs(8.0 - far - float(height(x, y)))
        assert off <= (1e-6 if k < 20 else told + 1e-6)
        worst = max(worst, off)
    assert worst > told / 10
    (found,) = (each for each in made.departures if each.what == ("hills",))
    assert f"{1000 * told:.3g} mm" in found.how


def _start(world: World) -> Any:
    from symphys.export.mjcf_bodies import StartState

    return StartState(world, dict(world.start))


def test_plain_motors_stay_readable() -> None:
    """A motor whose force is its command is written as one."""
    frames = (JointFrame((0, 0, 0.5)), JointFrame())
    joint = Joint("arm", HINGE, 0, None, frames, AffineMotor(gear=150.0, command_range=(-1.0, 1.0)))
    world = World((Body("rod", 2.0, 0.1),), joints=(joint,))
    motor = fromstring(mjcf_model(world, {"rod.position": (0, 0, -0.5)}, 0.01).text).find(".//motor")
    assert motor is not None
    assert motor.attrib == {"name": "arm", "joint": "arm", "gear": "150.0", "ctrlrange": "-1.0 1.0"}


def test_shipped_problems_are_written_with_what_they_lose(tmp_path: Path) -> None:
    from symphys.export import export_problem

    (path,) = export_problem("ball_throw", mjcf=tmp_path, approximate=True)
    assert path.read_text(encoding="utf-8").count("<!-- ") >= 1


def test_bodies_lie_at_coordinates_0_unless_that_opens_a_loop() -> None:
    """A square that is sheared: its coordinates are not 0, and only at the start do its ends meet."""
    mujoco = pytest.importorskip("mujoco")
    world, start = square(BALL)
    lean = 0.2
    leaned = {
        "rod0.position": (0.5, 0, 0),
        "rod1.position": (1 + np.sin(lean) / 2, 0, np.cos(lean) / 2),
        "rod2.position": (0.5 + np.sin(lean), 0, np.cos(lean)),
        "rod3.position": (np.sin(lean) / 2, 0, np.cos(lean) / 2),
    }
    turn = (np.cos(lean / 2), 0, np.sin(lean / 2), 0)
    made = mjcf_model(world, leaned | {f"rod{k}.orientation": turn for k in (1, 3)}, 0.01)
    model = mujoco.MjModel.from_xml_string(made.text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert np.abs(data.efc_pos).max() < 1e-12
    assert np.abs(data.qpos).max() == pytest.approx(lean)
    straight = mujoco.MjModel.from_xml_string(mjcf_model(world, start, 0.01).text)
    for each in (model, straight):
        other = mujoco.MjData(each)
        other.qpos = 0
        mujoco.mj_forward(each, other)
        assert other.body("rod2").xpos == pytest.approx([0.5, 0, 1], abs=1e-9)
