"""Models for MuJoCo: what stands in the file, what is refused, and that MuJoCo reads the same world from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest
from robots import REST, quadruped, state_of
from tools.repeats import few
from worlds.mixed import mixed

from symphys.export import ExportError, mjcf, mjcf_files
from symphys.model.joints import HINGE, SLIDER, Joint, JointFrame, Limits, Servo, Spring, TorqueMotor, VelocityMotor
from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain
from symphys.model.world import Body, Law, Pair, World, make_world
from symphys.problem import load_problem

ARM = Joint("arm", HINGE, 0, None, (JointFrame((0, 0, 0.5)), JointFrame()))
ROD = Body("rod", 2.0, 0.1)


def read(world: World, **values: Any) -> Element:
    start = {key.replace("__", "."): value for key, value in values.items()}
    return fromstring(mjcf(world, start, 0.01))


def numbers(element: Element | None, key: str) -> list[float]:
    assert element is not None
    return [float(x) for x in element.attrib[key].split()]


def hanging(**more: Any) -> Element:
    """A rod below the world's origin."""
    joint = Joint("arm", HINGE, 0, None, ARM.frames, **more)
    return read(World((ROD,), joints=(joint,)), rod__position=[0, 0, -0.5])


def test_options_and_names() -> None:
    model = read(World((ROD,), gravity=(1, 0, -2)))
    option = model.find("option")
    assert option is not None
    assert (numbers(option, "gravity"), option.attrib["timestep"]) == ([1, 0, -2], "0.01")
    assert (option.attrib["integrator"], option.attrib["cone"]) == ("implicitfast", "elliptic")
    assert [body.attrib["name"] for body in model.iter("body")] == ["rod"]


def test_limits_springs_and_motors() -> None:
    joint = hanging(limits=Limits(-0.5, None), spring=Spring(3.0, 0.2, 0.1)).find(".//joint")
    assert numbers(joint, "range") == [-0.5, 1e10]
    assert [numbers(joint, key) for key in ("stiffness", "damping", "springref")] == [[3], [0.2], [0.1]]
    assert numbers(hanging(motor=TorqueMotor(5.0)).find(".//motor"), "ctrlrange") == [-5, 5]
    servo = hanging(motor=Servo(20.0, 6.0, 3.0)).find(".//position")
    kv, kp, bound = (numbers(servo, key) for key in ("kv", "kp", "forcerange"))
    assert 20 <= kv[0] <= 200 and kp == [20 * kv[0]] and bound == [-6, 6]  # it gives way by 1 to 10 % of 3 rad/s
    assert numbers(hanging(motor=Servo(20.0, 6.0, 3.0, 0.5)).find(".//position"), "ctrlrange") == [-0.5, 0.5]
    velocity = hanging(motor=VelocityMotor(6.0, 3.0)).find(".//velocity")
    assert [numbers(velocity, key) for key in ("kv", "ctrlrange", "forcerange")] == [kv, [-3, 3], [-6, 6]]


def test_surfaces_meet_as_their_pairs_say() -> None:
    shapes = (Sphere(0.1, (0, 0, 1)), Capsule(0.1, 0.2), Box((0.1, 0.2, 0.3)))
    statics = [Plane("wall", (0, 1, 0), -2.0), Fixture("post", Capsule(0.1, 0.5, (3, 0, 0)))]
    law = Law(0.3, torsion=0.01, rolling=0.002)
    world = make_world([Body("a", 1.0, 0.1, shapes), Body("b", 1.0, 0.1, shapes[:1])], statics, law)
    both = (Pair("x", world.pairs[0].first, world.pairs[0].second, Law(0.0)), *world.pairs[1:])
    model = read(World(world.bodies, world.statics, both))
    assert [(geom.attrib["name"], geom.attrib["type"]) for geom in model.iter("geom")] == [
        ("wall", "plane"),
        ("post", "capsule"),
        ("a[0]", "sphere"),
        ("a[1]", "capsule"),
        ("a[2]", "box"),
        ("b", "sphere"),
    ]
    assert numbers(model.find(".//geom[@name='wall']"), "pos") == [0, -2, 0]
    assert {geom.attrib["contype"] + geom.attrib["conaffinity"] for geom in model.iter("geom")} == {"10"}
    pairs = {(pair.attrib["geom1"], pair.attrib["geom2"]): pair for pair in model.iter("pair")}
    assert len(pairs) == len({(pair.first, pair.second) for pair in both})
    assert pairs["a[0]", "wall"].attrib["condim"] == "1"
    assert numbers(pairs["a[1]", "wall"], "friction") == [0.3, 0.3, 0.01, 0.002, 0.002]
    assert pairs["a[1]", "wall"].attrib["condim"] == "6"


def test_friction_along_and_across_a_direction_is_that_of_the_tangents_of_mujoco() -> None:
    """These are y and x on the ground; another direction, and one that turns with a body, is refused."""
    found = []
    for direction in ((0, 1, 0), (3, 0, 0), (1, 1, 0)):
        law = Law((0.5, 0.2), friction_direction=direction)
        world = make_world([Body.ball("a", 0.1, 1.0)], [Plane.ground()], law)
        if direction[0] * direction[1]:
            with pytest.raises(ExportError, match=r"a-ground.*tangent"):
                read(world)
        else:
            found.append(numbers(read(world).find(".//pair"), "friction")[:2])
    assert found == [[0.5, 0.2], [0.2, 0.5]]
    own = Law((0.5, 0.2), friction_direction=(0, 1, 0), friction_frame="a")
    with pytest.raises(ExportError, match="tangent"):
        read(make_world([Body.ball("a", 0.1, 1.0)], [Plane.ground()], laws={("a", "ground"): own}))


def test_the_start_is_a_keyframe() -> None:
    """A rod that hangs at 0.3 rad from the first axis of its hinge, which is x, and turns at 2 rad/s."""
    half, down = np.array([np.cos(0.15), np.sin(0.15), 0, 0]), np.array([0, np.sin(0.3), -np.cos(0.3)]) / 2
    world = World((ROD,), joints=(ARM,))
    moving = {"rod__velocity": np.cross([2, 0, 0], down), "rod__angular_velocity": [2, 0, 0]}
    model = read(world, rod__position=down, rod__orientation=half, **moving)
    key = model.find(".//key")
    assert numbers(key, "qpos") == pytest.approx([0.3])
    assert numbers(key, "qvel") == pytest.approx([2.0])
    joint = model.find(".//joint")
    assert joint is not None and "ref" not in joint.attrib
    assert numbers(model.find(".//body"), "pos") == pytest.approx([0, 0, -0.5])


@pytest.mark.parametrize(
    ("world", "words"),
    [
        (make_world([Body.ball("ball", 0.1, 1.0)], [Plane.ground()], Law(0.5, 0.8)), "ball-ground: restitution"),
        (
            make_world([Body.ball("ball", 0.1, 1.0)], [Terrain("hill", lambda x, y: 0.1 * x * x)]),
            "hill: terrain beyond x from -10 to 10 m",
        ),
        (World((ROD,), joints=(Joint("arm", HINGE, 0, None, ARM.frames, frequency=3),)), "arm: a compliant joint"),
        (
            World((ROD,), joints=(Joint("arm", HINGE, 0, None, (JointFrame((0, 0, 1)), JointFrame())),)),
            "arm: a joint that does",
        ),
        (
            World((ROD,), joints=(ARM, Joint("rail", SLIDER, 0, None, (JointFrame(), JointFrame())))),
            "rail: a joint that closes a loop",
        ),
    ],
)
def test_what_mjcf_cannot_say_is_named(world: World, words: str) -> None:
    with pytest.raises(ExportError, match=f"robot: MJCF cannot say this: {words}"):
        mjcf(world, {}, 0.01, "robot")


def test_many_names_are_not_listed() -> None:
    balls = [Body.ball(f"ball{k}", 0.1, 1.0) for k in range(4)]
    with pytest.raises(ExportError, match=r"ball0-ball1 .*restitution"):
        mjcf(make_world(balls, [Plane.ground()], Law(0.5, 0.8)), {}, 0.01)


def test_problems_are_written_by_their_names() -> None:
    problem = load_problem(Path(__file__).parents[2] / "problems" / "cart_pole.toml")
    files = mjcf_files(problem)
    model = fromstring(files["cart_pole.xml"])
    assert [joint.attrib["type"] for joint in model.iter("joint")] == ["slide", "hinge"]
    assert model.attrib["model"] == "cart_pole"


def poses(mujoco: Any, world: World, start: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The model that MuJoCo reads, and every body's state at the start in it."""
    model = mujoco.MjModel.from_xml_string(mjcf(world, start, 0.01))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    found, velocity = {}, np.zeros(6)
    for body in world.bodies:
        index = model.body(body.name).id
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, index, velocity, 0)
        fields = {"position": data.xipos[index], "orientation": data.xquat[index]}
        fields |= {"velocity": velocity[3:], "angular_velocity": velocity[:3]}
        found |= {f"{body.name}.{field}": value.copy() for field, value in fields.items()}
    return model, found


def test_mujoco_reads_a_quadruped() -> None:
    mujoco = pytest.importorskip("mujoco")
    world = quadruped(Servo(20.0, 30.0, 8.0))
    start = state_of(world, {"left hind 3": 0.4}, {"right front 2": 1.0}, REST)
    model, found = poses(mujoco, world, start)
    assert model.body_mass.sum() == pytest.approx(24.4, rel=1e-12)
    assert (model.njnt, model.nv, model.nu, model.npair) == (17, 22, 16, 4)
    for name, value in found.items():
        assert value == pytest.approx(start[name], abs=1e-9), name


@few("name", ["table_robot", "gait_robot", "arm", "hopper", "cart_pendulum"], 2)
def test_mujoco_reads_shipped_robots(tmp_path: Path, name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "robot.toml"
    text = f'[simulation]\nduration = 0.1\ndt = 0.01\n[ground]\n[[include]]\nfile = "robots/{name}.toml"\n'
    path.write_text(text, encoding="utf-8")
    problem = load_problem(path)
    model, found = poses(mujoco, problem.world(), problem.initial)
    joints = problem.world().joints
    assert model.nu == sum(len(joint.kind.coordinates) for joint in joints if joint.motor is not None) > 0
    for body in problem.world().bodies:
        assert found[f"{body.name}.position"] == pytest.approx(problem.initial[f"{body.name}.position"], abs=1e-9)


def test_mujoco_reads_every_kind_of_joint() -> None:
    mujoco = pytest.importorskip("mujoco")
    world, start = mixed()
    model, found = poses(mujoco, world, start)
    assert model.body_mass.sum() == pytest.approx(sum(body.mass for body in world.bodies), rel=1e-12)
    free = 6 + 6 + sum(6 - joint.locked for joint in world.joints)
    assert model.nv == free
    for name, value in found.items():
        sign = np.sign(value @ start[name]) if name.endswith(".orientation") else 1
        assert sign * value == pytest.approx(start[name], abs=1e-9), name
    for body in world.bodies:
        index = model.body(body.name).id
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[index])
        own = turn.reshape(3, 3)
        moments = (own * model.body_inertia[index]) @ own.T
        assert moments == pytest.approx(np.array(body.inertia), abs=1e-12)
