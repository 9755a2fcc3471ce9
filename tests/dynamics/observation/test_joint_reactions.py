"""Reactions of joints: closed forms, Newton's law of what hangs on a joint, trees against loops, derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import few

import symphys
from symphys.dynamics.observation import SensedState, sensor_readings
from symphys.errors import ProblemError
from symphys.maths.rotation import matrix
from symphys.model import (
    Body,
    FixedJoint,
    HelicalJoint,
    Hinge,
    Law,
    Plane,
    Scheme,
    Servo,
    Slider,
    Spring,
    TorqueMotor,
    VelocityMotor,
    World,
    make_world,
)
from symphys.model.joints import KINDS, Joint, JointCoupling, JointFrame
from symphys.model.state_layout import Layout, initial_state, input_sizes
from symphys.transcription import transcribe
from symphys.types import Array

G, L, M = 9.81, 0.8, 2.0
INERTIA = 0.3


def reader(world: World, names: Sequence[str], inputs: Sequence[str] = ()) -> ca.Function:
    """(x, inputs of the step before) -> what sensors read, one after the other."""
    x, given = ca.SX.sym("x", Layout(world).size), {name: ca.SX.sym(name, 3) for name in inputs}
    before = {name: ca.SX.zeros(size) for name, size in input_sizes(world).items()} | given
    found = sensor_readings(SensedState(world, x, before, 0.01), names)
    values = ca.vertcat(*(found[name] for name in names))
    return ca.Function("read", [x, ca.vertcat(ca.SX(0, 1), *given.values())], [values])


def wrench(world: World, joint: str, x: Any, inputs: Mapping[str, Any] | None = None) -> Array:
    """(6,) the force and the torque of a joint in a state."""
    names = [f"{joint}.reaction_force", f"{joint}.reaction_torque"]
    given = [] if not inputs else [value for each in inputs.values() for value in each]
    return np.array(reader(world, names, tuple(inputs or ()))(x, ca.DM(given))).ravel()


def arm(**acting: Any) -> World:
    """A body at L along x from a hinge about y."""
    body = Body("arm", M, INERTIA, start={"position": (L, 0, 0)})
    return make_world([body], joints=[Hinge("pivot", ("world", "arm"), axis=(0, 1, 0), point=(0, 0, 0), **acting)])


def settled(world: World, time: float = 2.0, u: Any = None, inputs: Sequence[str] = ()) -> Any:
    """The last state of a motion from the start."""
    lab = Lab(world, Scheme(dt=0.01), inputs)
    u = None if u is None else ca.repmat(ca.DM(u), 1, round(time / 0.01))
    return lab.trajectory({}, time, u=u)[:, -1]


def test_a_pendulum_carries_its_weight_and_the_centripetal_force() -> None:
    """At any angle: m (g cos + w^2 l) along the rod, m g sin I / (I + m l^2) across it, no torque about the axis."""
    world, rate = arm(), 3.0
    for angle in (0.0, 0.7, -2.0):  # from straight down
        turn = angle - np.pi / 2  # about -y, from along x
        c, s = np.cos(turn), np.sin(turn)
        x = initial_state(
            world,
            {
                "arm.position": [L * c, 0, L * s],
                "arm.orientation": [np.cos(turn / 2), 0, -np.sin(turn / 2), 0],
                "arm.velocity": [-L * rate * s, 0, L * rate * c],
                "arm.angular_velocity": [0, -rate, 0],
            },
        )
        along, across = M * (G * np.cos(angle) + L * rate**2), M * G * np.sin(angle) * INERTIA / (INERTIA + M * L**2)
        assert wrench(world, "pivot", x) == pytest.approx([-along, 0, across, 0, 0, 0], abs=1e-12)


def test_a_cantilever_carries_the_moments_of_all_bars() -> None:
    """Two welded bars: m g and m g l of the outer one, 2 m g and 4 m g l of both."""
    bars = [Body(name, M, INERTIA, start={"position": (x, 0, 0)}) for name, x in (("inner", L), ("outer", 3 * L))]
    joints = [
        FixedJoint("wall", ("world", "inner"), point=(0, 0, 0)),
        FixedJoint("seam", ("inner", "outer"), point=(2 * L, 0, 0)),
    ]
    world = make_world(bars, joints=joints)
    for x in (initial_state(world), settled(world, 0.05)):
        assert wrench(world, "seam", x) == pytest.approx([0, 0, M * G, 0, -M * G * L, 0], abs=1e-10)
        assert wrench(world, "wall", x) == pytest.approx([0, 0, 2 * M * G, 0, -4 * M * G * L, 0], abs=1e-10)


def test_a_weld_pushes_what_it_accelerates() -> None:
    """A motor of 12 N moves two bodies of 2 and 1 kg: the weld gives the second 4 N, off its centre."""
    bodies = [Body("cart", 2.0, INERTIA), Body("load", 1.0, INERTIA, start={"position": (0, 0, 0.5)})]
    rail = Slider("rail", ("world", "cart"), axis=(1, 0, 0), motor=TorqueMotor(50.0))
    world = make_world(bodies, joints=[rail, FixedJoint("weld", ("cart", "load"), point=(0, 0, 0.1))])
    x = settled(world, 0.1, [12.0], ["rail.command"])
    assert wrench(world, "weld", x) == pytest.approx([4, 0, G, 0, 0.4 * 4, 0], abs=1e-10)
    assert wrench(world, "rail", x) == pytest.approx([12, 0, 3 * G, 0, 0.5 * 4, 0], abs=1e-10)


HELD = {
    "motor": ({"motor": TorqueMotor(50.0)}, [-M * G * L]),
    "servo": ({"motor": Servo(20.0, torque=100.0, velocity=5.0)}, [0.0]),
    "velocity": ({"motor": VelocityMotor(torque=100.0, velocity=5.0)}, [0.0]),
    "spring": ({"spring": Spring(500.0, 60.0)}, None),
    "limit": ({"limits": (None, 0.0)}, None),
    "friction": ({"friction": 50.0}, None),
}


@pytest.mark.parametrize("what", HELD)
def test_what_holds_a_coordinate_goes_through_the_joint(what: str) -> None:
    """Motor, spring, limit and dry friction hold an arm: the torque is that of its weight about the axis."""
    acting, command = HELD[what]
    world = arm(**acting)
    x = settled(world, 2.0, command, ["pivot.command"] if command else ())
    found = wrench(world, "pivot", x)
    c, _, s = np.array(x[Layout(world)["arm.position"]]).ravel() / L
    assert abs(s) < 0.05
    assert found == pytest.approx([M * G * s, 0, M * G * c, 0, -M * G * L * c, 0], rel=1e-6, abs=1e-6)


def test_a_coupling_goes_through_both_joints() -> None:
    """A motor holds an arm by a shaft that turns -2 times as far: the pivot carries twice the motor's torque.

    The shaft itself feels nothing about its axis, since coupling and motor cancel there.
    """
    places = {"base": (0, 0, 0), "arm": (L, 0, 0), "shaft": (0, 1, 0)}
    bodies = [Body(name, M, INERTIA, start={"position": place}) for name, place in places.items()]
    joints = [
        FixedJoint("wall", ("world", "base"), point=(0, 0, 0)),
        Hinge("pivot", ("base", "arm"), axis=(0, 1, 0), point=(0, 0, 0)),
        Hinge("bearing", ("base", "shaft"), axis=(0, 1, 0), point=(0, 1, 0), motor=TorqueMotor(50.0)),
    ]
    world = replace(make_world(bodies, joints=joints), couplings=(JointCoupling("gear", 2, 1, (0.0, -2.0)),))
    x = settled(world, 0.1, [M * G * L / 2], ["bearing.command"])
    assert wrench(world, "bearing", x) == pytest.approx([0, 0, M * G, 0, 0, 0], abs=1e-8)
    assert wrench(world, "pivot", x) == pytest.approx([0, 0, M * G, 0, -M * G * L, 0], abs=1e-8)
    assert wrench(world, "wall", x) == pytest.approx([0, 0, 3 * M * G, M * G, -M * G * L, 0], abs=1e-8)


def test_a_rotor_takes_its_share_of_a_torque() -> None:
    """Of 3 N m a wheel of 0.3 kg m^2 behind a rotor of 0.6 gets a third."""
    wheel = Hinge("axle", ("world", "wheel"), axis=(0, 0, 1), point=(0, 0, 0), motor=TorqueMotor(9.0), armature=0.6)
    world = make_world([Body("wheel", 1.0, INERTIA)], joints=[wheel])
    x = settled(world, 0.1, [3.0], ["axle.command"])
    assert wrench(world, "axle", x) == pytest.approx([0, 0, G, 0, 0, 1.0], abs=1e-10)


def test_a_nut_on_a_screw_carries_what_its_thread_gives() -> None:
    """It falls by r an angle: (I + m r^2) w' = -m g r, and the thread gives m (g + r w') and I w'."""
    pitch = 0.5
    lead = pitch / (2 * np.pi)
    screw = HelicalJoint("screw", ("world", "nut"), axis=(0, 0, 1), pitch=pitch, point=(0, 0, 0))
    world = make_world([Body("nut", M, INERTIA)], joints=[screw])
    spin = -M * G * lead / (INERTIA + M * lead**2)
    expected = [0, 0, M * (G + lead * spin), 0, 0, INERTIA * spin]
    for x in (initial_state(world), settled(world, 0.2)):
        assert wrench(world, "screw", x) == pytest.approx(expected, abs=1e-10)


def test_inputs_of_the_step_before_count() -> None:
    """A weld holds against a force and a torque on its body; without their memory they would be missing."""
    bodies = [Body("block", M, INERTIA, start={"position": (L, 0, 0)})]
    world = make_world(bodies, joints=[FixedJoint("wall", ("world", "block"), point=(0, 0, 0))])
    push, turn = [1.0, -2.0, 3.0], [0.5, 0.25, -1.0]
    x = settled(world, 0.05, [*push, *turn], ["block.force", "block.torque"])
    found = wrench(world, "wall", x, {"block.force": push, "block.torque": turn})
    torque = -np.array(turn) - np.cross([L, 0, 0], np.array(push) - [0, 0, M * G])
    assert found == pytest.approx([-1, 2, M * G - 3, *torque], abs=1e-10)


def test_a_foot_on_the_ground_takes_its_part_of_the_load() -> None:
    """Newton's law of an arm that rests on a foot: weight, contact and reaction are in balance, and so are moments."""
    foot = Body.ball("arm", 0.1, M, position=(L, 0, 0.3))
    pivot = Hinge("pivot", ("world", "arm"), axis=(0, 1, 0), point=(0, 0, 0.5), motor=TorqueMotor(50.0))
    world = make_world([foot], [Plane.ground()], Law(0.8), joints=[pivot])
    x = settled(world, 3.0, [2.5], ["pivot.command"])
    contact = np.array(reader(world, ["arm.contact_force"])(x, ca.DM(0, 1))).ravel()
    assert contact[2] > M * G
    at = Layout(world)
    turned = np.array(ca.DM(matrix(x[at["arm.orientation"]])))
    found = wrench(world, "pivot", x)
    force, torque = turned @ found[:3], turned @ found[3:]
    assert force + contact + [0, 0, -M * G] == pytest.approx(np.zeros(3), abs=1e-8)
    arm_, touch = (np.array(x[at["arm.position"]]).ravel() - [0, 0, 0.5]), np.array([0, 0, -0.1])
    moments = torque + np.cross(arm_, [0, 0, -M * G]) + np.cross(arm_ + touch, contact)
    assert moments == pytest.approx(np.zeros(3), abs=1e-7)
    assert torque[1] == pytest.approx(2.5, abs=1e-8)


@pytest.mark.slow
def test_a_tool_that_slides_pulls_its_carriage_by_friction() -> None:
    """At constant speed the joint above a tool carries mu m g, and nothing along its own free direction."""
    carriage, tool = (
        Body("carriage", 1.0, 0.1, start={"position": (0, 0, 1)}),
        Body.ball("tool", 0.1, M, position=(0, 0, 0.1)),
    )
    rail = Slider("rail", ("world", "carriage"), axis=(1, 0, 0), motor=VelocityMotor(torque=1e3, velocity=5.0))
    world = make_world(
        [carriage, tool],
        [Plane.ground()],
        Law(0.4),
        joints=[rail, Slider("quill", ("carriage", "tool"), axis=(0, 0, 1))],
    )
    x = settled(world, 1.0, [0.5], ["rail.command"])
    force = wrench(world, "quill", x)[:3]
    assert force == pytest.approx([0.4 * M * G, 0, 0], abs=1e-7)
    assert wrench(world, "rail", x)[:3] == pytest.approx([0.4 * M * G, 0, G], abs=1e-7)


def chain(kinds: tuple[str, ...], swapped: bool) -> World:
    """Three bodies below each other, held by the world, or by their own second sides where ``swapped``."""
    turn = (0.5, -0.5, 0.5, 0.5)
    joints = [Joint("root", KINDS["ball"], 0, None, (JointFrame((0, 0.1, 0.2), turn), JointFrame((0, 0, 0), turn)))]
    for k, kind in enumerate(kinds, 1):
        frames = JointFrame((0.02, 0.1, 0.2), turn), JointFrame((0, -0.1, -0.2), turn)
        sides, frames = ((k - 1, k), frames[::-1]) if swapped else ((k, k - 1), frames)
        joints.append(Joint(f"j{k}", KINDS[kind], *sides, frames))
    bodies = tuple(Body(f"b{k}", 1.0 + k, (0.01, 0.02, 0.025)) for k in range(len(kinds) + 1))
    return World(bodies, gravity=(3.0, 0, -9.0), joints=tuple(joints))


def tumbling(world: World, dt: float) -> tuple[Lab, Array]:
    """States (steps + 1, nx) of a chain that starts to swing."""
    start = {"b0.position": np.array([0, -0.1, -0.2])}
    for k in range(1, len(world.bodies)):
        start[f"b{k}.position"] = start[f"b{k - 1}.position"] + [-0.02, -0.2, -0.4]
    lab = Lab(world, Scheme(dt=dt))
    return lab, np.array(lab.trajectory(start, 0.3)).T


@few("kinds", [("hinge", "fixed"), ("fixed", "ball"), ("ball", "hinge")], 2)
def test_a_joint_reads_the_same_from_both_sides(kinds: tuple[str, ...]) -> None:
    """With its sides exchanged a joint reads the opposite force and torque, in the axes of the other body."""
    world, other = chain(kinds, False), chain(kinds, True)
    lab, states = tumbling(world, 0.01)
    x = states[-1]
    for k in (1, 2):
        below, above = (np.array(matrix(ca.DM(x[lab.layout[f"b{i}.orientation"]]))) for i in (k, k - 1))
        first, second = wrench(world, f"j{k}", x), wrench(other, f"j{k}", x)
        for part in (slice(0, 3), slice(3, 6)):
            assert above @ second[part] == pytest.approx(-below @ first[part], abs=1e-9)
        assert np.linalg.norm(first[:3]) > 1


@few("kinds", [("hinge", "ball"), ("universal", "slider"), ("fixed", "hinge")], 1)
def test_newtons_law_of_what_hangs_on_a_joint(kinds: tuple[str, ...]) -> None:
    """The rates of the momenta of all bodies beyond it, by central differences, to second order in the step."""
    world = chain(kinds, False)
    errors = []
    for dt in (0.01, 0.005):
        lab, states = tumbling(world, dt)
        k = round(0.2 / dt)
        before, x, after = states[k - 1], states[k], states[k + 1]
        place = {i: x[lab.layout[f"b{i}.position"]] for i in range(3)}
        turned = {i: np.array(matrix(ca.DM(x[lab.layout[f"b{i}.orientation"]]))) for i in range(3)}
        point = place[1] + turned[1] @ world.joints[1].frames[0].point
        force, torque = np.zeros(3), np.zeros(3)
        for i in (1, 2):
            linear, angular = ((momenta(world, lab, s, i) for s in (before, after)) for _ in (0, 1))
            (p0, _), (p1, _) = linear
            (_, l0), (_, l1) = angular
            needed = (p1 - p0) / (2 * dt) - (1.0 + i) * np.array([3.0, 0, -9.0])
            force += needed
            torque += (l1 - l0) / (2 * dt) + np.cross(place[i] - point, needed)
        found = wrench(world, "j1", x)
        errors.append(np.abs([*(turned[1] @ found[:3] - force), *(turned[1] @ found[3:] - torque)]).max())
    assert errors[0] < 0.5 and errors[0] / errors[1] == pytest.approx(4, rel=0.3)


def momenta(world: World, lab: Lab, x: Array, body: int) -> tuple[Array, Array]:
    """Linear momentum, and angular momentum about the centre of mass."""
    r = np.array(matrix(ca.DM(x[lab.layout[f"b{body}.orientation"]])))
    tensor = r @ np.diag(world.bodies[body].inertia) @ r.T
    return (1.0 + body) * x[lab.layout[f"b{body}.velocity"]], tensor @ x[lab.layout[f"b{body}.angular_velocity"]]


def crank(closing: str, **soft: float) -> World:
    """A crank, a coupler and a rocker on the world; ``closing`` is the joint that closes the loop."""
    pins = {"axle": (0.0, 0.0), "pin": (0.1, 0.0), "knee": (0.3, 0.3), "pivot": (0.35, 0.0)}
    between = [("axle", "pin", "crank"), ("pin", "knee", "coupler"), ("knee", "pivot", "rocker")]
    bodies = []
    for first, second, name in between:
        x, z = ((pins[first][i] + pins[second][i]) / 2 for i in range(2))
        bodies.append(Body(name, 1.0, 0.01, start={"position": (x, 0, z)}))
    sides = {"axle": ("world", "crank"), "pin": ("crank", "coupler"), "knee": ("coupler", "rocker")}
    sides["pivot"] = ("world", "rocker")
    joints = []
    for name in sorted(sides, key=lambda name: name == closing):
        acting = {"motor": TorqueMotor(10.0)} if name == "axle" else {}
        more: Any = acting | (soft if name == closing else {})
        joints.append(Hinge(name, sides[name], axis=(0, 1, 0), point=(pins[name][0], 0, pins[name][1]), **more))
    return make_world(bodies, joints=joints)


def turning(closing: str, dt: float, **soft: float) -> Array:
    """(4, 6) the wrenches of all joints of a crank that a motor has turned for 0.2 s."""
    world = crank(closing, **soft)
    lab = Lab(world, Scheme(dt=dt), ["axle.command"])
    x = lab.trajectory({}, 0.2, u=ca.repmat(ca.DM([0.6]), 1, round(0.2 / dt)))[:, -1]
    return np.array([wrench(world, name, x) for name in ("axle", "pin", "knee", "pivot")])


@pytest.mark.slow
def test_joints_of_trees_and_of_loops_agree() -> None:
    """Whichever joint closes the loop, to first order in the step: its force is that of the middle of the last step."""
    apart = []
    for dt in (0.004, 0.002):
        tree, loop = turning("pivot", dt), turning("axle", dt)
        apart.append(np.abs(tree - loop).max())
        assert tree[0, 4] == pytest.approx(0.6, abs=1e-8) and loop[0, 4] == pytest.approx(0.6, abs=1e-4)
    assert apart[1] < 0.05 * np.abs(tree).max()
    assert apart[0] / apart[1] == pytest.approx(2, rel=0.2)


def test_a_soft_joint_reads_the_force_of_its_spring() -> None:
    """A weld of 20 Hz carries m g at rest, whichever side it hangs on."""
    bodies = [Body("bob", M, INERTIA, start={"position": (0, 0, -L)})]
    world = make_world(bodies, joints=[FixedJoint("hook", ("world", "bob"), point=(0, 0, 0), frequency=20.0)])
    assert wrench(world, "hook", settled(world, 2.0)) == pytest.approx([0, 0, M * G, 0, 0, 0], abs=1e-6)


def test_an_impact_is_left_out() -> None:
    """A foot strikes the ground in the last step: as of contacts, the force that lasts is read, no blow."""
    foot = Body.ball("foot", 0.1, M, position=(0, 0, 0.1 + 1e-4), velocity=(0, 0, -2.0))
    load = Body("load", 5.0, INERTIA, start={"position": (0, 0, 1), "velocity": (0, 0, -2.0)})
    world = make_world([foot, load], [Plane.ground()], Law(0.5), joints=[FixedJoint("leg", ("foot", "load"))])
    x = settled(world, 0.01)
    assert abs(float(x[Layout(world)["load.velocity"]][2])) < 0.2
    assert np.abs(wrench(world, "leg", x)[:3]).max() < 2 * 5.0 * G


def test_derivatives_are_those_of_differences_and_finite_at_rest() -> None:
    """By the whole state, on a chain with a loop: in motion against central differences, at rest finite."""
    world = crank("axle")
    names = [f"{joint.name}.reaction_{part}" for joint in world.joints for part in ("force", "torque")]
    read = reader(world, names)
    slope = read.jacobian()
    lab = Lab(world, Scheme(dt=0.01), ["axle.command"])
    x = np.array(lab.trajectory({}, 0.1, u=ca.repmat(ca.DM([0.6]), 1, 10))[:, -1]).ravel()
    none, out = ca.DM(0, 1), np.zeros(24)
    found = np.array(slope(x, none, out)[0])
    for k in range(x.size):
        step = np.zeros(x.size)
        step[k] = 1e-6 * max(1, abs(x[k]))
        differences = (np.array(read(x + step, none)) - np.array(read(x - step, none))).ravel() / (2 * step[k])
        assert found[:, k] == pytest.approx(differences, rel=1e-5, abs=1e-4)
    assert np.isfinite(np.array(slope(initial_state(world), none, out)[0])).all()


PENDULUM: dict[str, Any] = {
    "simulation": {"duration": 0.2, "dt": 0.01},
    "body": [{"name": "arm", "position": [L, 0, 0], "mass": M, "inertia": INERTIA, "collides_with": []}],
    "joint": [{"name": "pivot", "between": ["world", "arm"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]}],
    "variable": [{"name": "push", "sets": "arm.force", "knots": 2, "guess": 1.5}],
    "output": [{"name": "load", "at": "end", "value": "pivot.reaction_force[2]"}],
    "target": [{"name": "light", "value": "pivot.reaction_torque", "tolerance": 0.1}],
}
PENDULUM["body"][0]["shape"] = {"sphere": {"radius": 0.1}}


def test_problems_remember_the_inputs_of_the_step_before() -> None:
    """An output reads what the exact rollout's last state and inputs give, and has the unit of a force."""
    problem = symphys.load(PENDULUM)
    made = transcribe(problem, backend="casadi")
    z = made.shooting.start(0)
    record = made.record(z)
    memory = made.rollout.memory
    assert set(memory.columns) == {"arm.force"}
    x, u = record.arrays.x[-1], record.arrays.u[-1]
    world = problem.world()
    found = wrench(world, "pivot", x[: Layout(world).size], {"arm.force": u})
    assert problem.targets[0].unit == "N m"
    assert made.judge(z).outputs["load"] == pytest.approx(found[2], rel=1e-12)
    assert abs(found[2] - wrench(world, "pivot", x[: Layout(world).size])[2]) > 0.1


@pytest.mark.slow
def test_a_recorded_load_cell_finds_a_mass() -> None:
    """Of a swing that a push drives, recorded as the force in its pivot and as the acceleration of its body."""
    still = {key: value for key, value in PENDULUM.items() if key not in ("variable", "output", "target")}
    push = {"name": "push", "sets": "arm.force", "guess": [0.5, 0, 3]}
    heavy = {**still, "body": [{**PENDULUM["body"][0], "mass": 2.3}], "variable": [push]}
    z = np.array([0.5, 0.0, 3.0])[None]
    names = ["pivot.reaction_force", "arm.accelerometer"]
    heavy["cost"] = [{"name": "some", "value": "arm.mass"}]
    _, found = symphys.compile(heavy).recording(*names).forward(z)
    recording = {
        "name": "swing",
        "table": {"time": [0.01 * k for k in range(21)], "push": [[0.5, 0.0, 3.0]] * 21},
        "inputs": {"arm.force": "push"},
        "measured": [],
    }
    for name, column in zip(names, ("load", "felt"), strict=True):
        rows = np.concatenate([np.full((1, 3), np.nan), found[name][0]])
        recording["table"][column] = rows.tolist()
        recording["measured"].append({"value": name, "columns": column, "noise": 0.01})
    mass = {"name": "mass", "sets": "arm.mass"}
    fit = symphys.identify({**still, "variable": [mass], "recording": [recording]}, bootstrap=0)
    assert fit["mass"].value == pytest.approx(2.3, abs=1e-5)


@pytest.mark.parametrize(
    ("tables", "place"),
    [
        ({"output": [{"name": "load", "value": "pivot.reaction_fource"}]}, r'output "load".value: .*reaction_force'),
        (
            {"simulation": {"duration": 0.2, "dt": 0.01, "warm_start": False}},
            r'target "light".value: .*warm_start = false in \[simulation\]',
        ),
        (
            {
                "simulation": {"duration": 0.2, "dt": 0.01, "warm_start": False},
                "sensor": [{"name": "gauge", "reads": ["pivot.reaction_force"]}],
            },
            r'sensor "gauge".reads: .*warm_start',
        ),
        (
            {"force": [{"name": "f", "on": "arm.force", "value": "pivot.reaction_force"}]},
            r'force "f".value: .*is not known while the force is',
        ),
        (
            {
                "phase": [{"name": "a", "until": 0.1}, {"name": "b", "sets": {"gravity": [0, 0, -1]}}],
                "sensor": [{"name": "gauge", "reads": ["pivot.reaction_force"]}],
            },
            r'sensor "gauge".reads: .*pivot.reaction_force',
        ),
    ],
)
def test_what_cannot_be_read_names_table_and_key(tables: dict[str, Any], place: str) -> None:
    with pytest.raises(ProblemError, match=place):
        symphys.load({**PENDULUM, **tables})
