"""A screw: closed forms of its fall and of its drive, both schemes of joints, limits, motors, springs, derivatives."""

from __future__ import annotations

from math import pi
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tools.laboratory import Lab
from tools.repeats import few

from symphys import Problem, SymphysError, simulate
from symphys.model import Body, HelicalJoint, make_world
from symphys.model.joints import (
    FIXED,
    HINGE,
    SLIDER,
    Joint,
    JointFrame,
    Limits,
    Motor,
    Spring,
    TorqueMotor,
    helical,
    tree_joints,
)
from symphys.model.joints.motor import Servo, VelocityMotor
from symphys.model.world import Scheme, World
from symphys.problem import problem_of_tables
from symphys.types import Array

G, MASS, INERTIA = 9.81, 2.0, 0.004
UP = (float(np.sqrt(0.5)), 0.0, -float(np.sqrt(0.5)), 0.0)
"""The x axis of a frame points up."""
TAU = 0.2


def nut(pitch: Any, **more: Any) -> World:
    """A nut on an upright screw of the world, its centre of mass on the axis."""
    frames = JointFrame((0, 0, 0), UP), JointFrame((0, 0, 0), UP)
    body = Body("nut", MASS, (0.003, 0.003, INERTIA))
    return World((body,), joints=(Joint("screw", helical(pitch), 0, None, frames, **more),))


def fallen(world: World, time: float = 0.5, dt: float = 0.01, **more: Any) -> dict[str, Array]:
    return Lab(world, Scheme(dt=dt), **more).states({}, time)


@pytest.mark.parametrize("pitch", [0.05, -0.3, 2.0])
def test_a_nut_falls_along_its_thread(pitch: float) -> None:
    """Without friction it accelerates by a = g / (1 + I (2 pi / pitch)^2 / m), and energy is kept."""
    states = fallen(nut(pitch))
    time = 0.01 * np.arange(51)
    a = -G / (1 + INERTIA * (2 * pi / pitch) ** 2 / MASS)
    height, spin = states["nut.position"][:, 2], states["nut.angular_velocity"][:, 2]
    assert height == pytest.approx(a / 2 * time**2, abs=1e-12)
    assert states["nut.velocity"][:, 2] == pytest.approx(a * time, abs=1e-12)
    assert states["screw.unwrapped"][:, 0] == pytest.approx(a / 2 * time**2 * 2 * pi / pitch, abs=1e-9)
    energy = MASS * G * height + MASS / 2 * states["nut.velocity"][:, 2] ** 2 + INERTIA / 2 * spin**2
    assert energy == pytest.approx(0, abs=1e-11)


def test_armature_turns_with_the_angle() -> None:
    """It adds to the inertia about the axis."""
    pitch, rotor = 0.1, 0.002
    states = fallen(nut(pitch, armature=rotor))
    a = -G / (1 + (INERTIA + rotor) * (2 * pi / pitch) ** 2 / MASS)
    assert states["nut.velocity"][-1, 2] == pytest.approx(a * 0.5, rel=1e-9)


def test_a_spring_winds_the_thread() -> None:
    """A torsion spring k: the angle swings with sqrt(k / (I + m h^2)) about where k q = -m g h."""
    pitch, k = 0.4, 0.6
    h = pitch / (2 * pi)
    rate, middle = np.sqrt(k / (INERTIA + MASS * h**2)), -MASS * G * h / k
    states = fallen(nut(pitch, spring=Spring(k)), 1.0, 0.0005)
    expected = middle * (1 - np.cos(rate * 0.0005 * np.arange(2001)))
    assert states["screw.unwrapped"][:, 0] == pytest.approx(expected, abs=1e-4 * abs(middle))


def test_a_limit_stops_the_nut() -> None:
    """At its angle, and so at its height."""
    pitch = 0.3
    states = fallen(nut(pitch, limits=Limits(-4.0, None)), 2.0)
    assert states["screw.unwrapped"].min() == pytest.approx(-4.0, abs=1e-6)
    assert states["nut.position"][-1, 2] == pytest.approx(-4.0 * pitch / (2 * pi), abs=1e-6)
    assert states["nut.velocity"][-1] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("motor", "command", "angle"),
    [(Servo(20, 3, 8), 1.5, 1.5), (VelocityMotor(3, 8), 2.0, None)],
    ids=["servo", "velocity"],
)
def test_motors_follow_the_angle(motor: Motor, command: float, angle: float | None) -> None:
    world = nut(-0.2, motor=motor)
    lab = Lab(world, Scheme(dt=0.01), ("screw.command",))
    states = lab.states({}, 1.0, u=command * np.ones((1, 100)))
    if angle is None:
        assert states["nut.angular_velocity"][-1, 2] == pytest.approx(command, rel=1e-9)
        assert states["nut.velocity"][-1, 2] == pytest.approx(-0.2 / (2 * pi) * command, rel=1e-9)
    else:
        assert states["screw.unwrapped"][-1, 0] == pytest.approx(angle, abs=1e-6)


def drive(scheme: str, pitch: float, swings: bool = False, **thread: Any) -> dict[str, Any]:
    """A motor turns a spindle, whose thread lifts a nut on the carriage of a rail.

    ``scheme``: the thread closes a loop, which sweeps hold ("loop"); the weld of nut and carriage does, so that the
    thread is a joint of the tree ("tree"); or the same ratio as a coupling. ``swings``: on a frame that swings.
    """
    mount = {"name": "mount", "between": ["world", "base"], "fixed": {}, "point": [0.3, 0, 0]}
    if swings:
        mount = {"name": "mount", "between": ["world", "base"], "hinge": {"axis": [0, 1, 0]}, "point": [0.3, 0, 0.1]}
    turn = {"name": "turn", "between": ["base", "spindle"], "hinge": {"axis": [0, 0, 1]}, "point": [0, 0, 0]}
    rail = {"name": "rail", "between": ["base", "carriage"], "slider": {"axis": [0, 0, 1]}}
    weld = {"name": "weld", "between": ["carriage", "nut"], "fixed": {}}
    screw = {"axis": [0, 0, 1], "pitch": pitch}
    last = {"name": "thread", "between": ["spindle", "nut"], "helical": screw, "point": [0, 0, 0.5], **thread}
    turn["motor"] = {"torque": {"torque": 5.0}}
    joints = {
        "loop": [mount, rail, turn, weld, last],
        "tree": [mount, turn, rail, last, weld],
        "coupling": [mount, rail, turn, weld],
    }
    coupled = [{"name": "c", "joints": ["rail", "turn"], "polynomial": [0, -pitch / (2 * pi)]}]
    bodies = (("base", 0.1, 3.0), ("spindle", 0.0, 1.0), ("carriage", 0.5, MASS - 1.5), ("nut", 0.5, 1.5))
    return {
        "simulation": {"duration": 0.5, "dt": 0.005, "sweeps": 30},
        "body": [
            {"name": name, "mass": mass, "inertia": [0.003, 0.004, 0.005], "position": [0, 0, z], "collides_with": []}
            for name, z, mass in bodies
        ],
        "joint": joints[scheme],
        **({"coupling": coupled} if scheme == "coupling" else {}),
        "variable": [{"name": "push", "sets": "turn.command", "guess": [TAU]}],
    }


def test_the_schemes_hold_the_thread_that_they_are_made_for() -> None:
    """What is no joint of a tree is locked by rows of its own."""
    for scheme, held in (("loop", "thread"), ("tree", "weld")):
        joints = problem_of_tables(drive(scheme, 0.1)).world().joints
        assert [joint.name for k, joint in enumerate(joints) if k not in tree_joints(joints)] == [held]


@few("scheme", ["loop", "tree"], 1)
@pytest.mark.parametrize("pitch", [0.1, -0.02])
def test_a_driven_nut_lifts_by_its_pitch(scheme: str, pitch: float) -> None:
    """(I + m h^2) q'' = tau + m g h with h = pitch / 2 pi, the nut held from turning; z = -h q."""
    motion, h = simulate(problem_of_tables(drive(scheme, pitch))), pitch / (2 * pi)
    q = motion["turn.angle"].ravel()
    assert q == pytest.approx((TAU + MASS * G * h) / (0.005 + MASS * h**2) / 2 * motion.time**2, abs=1e-10)
    assert motion["rail.position"].ravel() == pytest.approx(-h * q, abs=1e-12)
    assert motion["thread.angle"].ravel() == pytest.approx(-q, abs=1e-9)


@pytest.mark.parametrize("scheme", ["loop", "tree"])
def test_a_torque_holds_a_load_by_the_pitch(scheme: str) -> None:
    """F = 2 pi tau / pitch at balance."""
    tables = drive(scheme, -0.02)
    tables["variable"][0]["guess"] = [MASS * G * 0.02 / (2 * pi)]
    motion = simulate(problem_of_tables(tables))
    assert np.abs(motion["turn.angle"]).max() < 1e-10


@pytest.mark.slow
def test_both_schemes_agree_on_a_frame_that_swings() -> None:
    """To second order in the step, with the ratio as a coupling as well."""
    ends = {}
    for dt in (0.01, 0.005):
        for scheme in ("loop", "tree", "coupling"):
            tables = drive(scheme, 0.1, swings=True)
            tables["simulation"]["dt"] = dt
            motion = simulate(problem_of_tables(tables))
            ends[scheme, dt] = np.concatenate([motion.position[-1].ravel(), [motion["turn.angle"][-1]]])
    for one in ("tree", "coupling"):
        coarse, fine = (np.abs(ends["loop", dt] - ends[one, dt]).max() for dt in (0.01, 0.005))
        assert fine < 3e-4
        assert fine < 0.4 * coarse


def test_a_soft_thread_counts_its_turns() -> None:
    """It gives way by more than half a pitch and stays on its own turn: the nut sags by m g / k of its spring."""
    tables = drive("loop", 0.01, frequency=2.0, damping=1.0)
    tables["variable"] = [{"name": "push", "sets": "turn.command", "guess": [0.0]}]
    tables["joint"][2] = {**tables["joint"][2], "motor": {"velocity": {"torque": 50, "velocity": 20}}}
    tables["variable"][0]["guess"] = [4 * pi]
    tables["simulation"] = {"duration": 2.0, "dt": 0.005, "sweeps": 30}
    motion = simulate(problem_of_tables(tables))
    off = motion["rail.position"].ravel() + 0.01 / (2 * pi) * motion["turn.angle"].ravel()
    settled = off[-100:]
    assert motion["turn.angle"][-1] == pytest.approx(8 * pi, rel=0.01)
    assert np.ptp(settled) < 1e-4
    assert abs(settled[-1]) > 0.01
    assert np.abs(np.diff(off)).max() < 0.002


def chain(dt: float) -> tuple[Lab, dict[str, Any]]:
    """A floating body, a nut on it and another on that, by frames that are no body's axes."""
    turn = tuple(Rotation.from_euler("xyz", [0.4, -0.7, 0.9]).as_quat(scalar_first=True))
    frames = JointFrame((0.02, -0.1, 0.2), turn), JointFrame((0, 0.1, -0.2), turn)
    joints = Joint("a", helical(0.3), 1, 0, frames), Joint("b", helical(-0.1), 1, 2, frames[::-1])
    bodies = tuple(Body(f"b{k}", 1.0 + k, (0.01, 0.02, 0.025)) for k in range(3))
    start: dict[str, Any] = {"b1.position": [-0.02, 0.2, -0.4], "b2.position": [-0.04, 0.4, -0.8]}
    spin = np.array([1.0, -2.0, 1.5])
    for k in range(3):
        start[f"b{k}.angular_velocity"] = spin
        start[f"b{k}.velocity"] = np.cross(spin, start.get(f"b{k}.position", np.zeros(3)))
    return Lab(World(bodies, gravity=(0, 0, 0), joints=joints), Scheme(dt=dt)), start


def test_momentum_is_kept_and_energy_to_second_order() -> None:
    ranges = []
    for dt in (0.01, 0.005):
        lab, start = chain(dt)
        states = lab.states(start, 1.0)
        momentum, energy = np.zeros((round(1 / dt) + 1, 6)), np.zeros(round(1 / dt) + 1)
        for k, body in enumerate(lab.world.bodies):
            q = Rotation.from_quat(np.roll(states[f"b{k}.orientation"], -1, axis=1))
            v, w, r = (states[f"b{k}.{field}"] for field in ("velocity", "angular_velocity", "position"))
            local = q.inv().apply(w)
            spun = q.apply(local * [0.01, 0.02, 0.025])
            momentum += np.hstack([body.mass * v, body.mass * np.cross(r, v) + spun])
            energy += body.mass * (v**2).sum(axis=1) / 2 + (local**2 @ [0.01, 0.02, 0.025]) / 2
        assert np.abs(momentum - momentum[0]).max() < 1e-11
        ranges.append(np.ptp(energy))
    assert ranges[1] < 1e-3
    assert ranges[1] < 0.3 * ranges[0]


def test_slopes_are_those_of_differences() -> None:
    """Of where a driven nut comes to, by torque and pitch."""
    pitch, torque = ca.SX.sym("pitch"), ca.MX.sym("torque")
    frames = JointFrame((0.1, 0, 0), UP), JointFrame((0, 0, 0), UP)
    body = Body("nut", MASS, (0.003, 0.003, INERTIA))
    joint = Joint("screw", helical(pitch), 0, None, frames, TorqueMotor(5.0), spring=Spring(0.3, 0.01))
    lab = Lab(World((body,), joints=(joint,)), Scheme(dt=0.01), ("screw.command",), [pitch])
    p = ca.MX.sym("p")
    x = lab.trajectory({"nut.position": [-0.1, 0, 0]}, 0.3, u=ca.repmat(torque, 1, 30), p=p)[:, -1]
    where = x[lab.layout["nut.position"]][2] + ca.sumsqr(x[lab.layout["nut.velocity"]])
    z = ca.vertcat(torque, p)
    f = ca.Function("f", [z], [where, ca.jacobian(where, z)], ["z"], ["f", "J"])
    at, h = np.array([0.3, 0.2]), 1e-6
    slope = np.array(f(at)[1]).ravel()
    for k in range(2):
        step = h * np.eye(2)[k]
        assert float(f(at + step)[0] - f(at - step)[0]) / (2 * h) == pytest.approx(slope[k], rel=1e-6)
    assert np.isfinite(np.array(f([0.3, 0.0])[1])).all()


def test_a_described_screw_is_what_a_file_says() -> None:
    """From Python to a problem file and back; a start carries the nut along the thread."""
    nut_body = Body.cylinder("nut", radius=0.02, length=0.02, mass=0.2, position=(0.1, 0, 0))
    screw = HelicalJoint(
        "screw", ("world", "nut"), axis=(0, 0, 2), pitch=-0.005, point=(0, 0, 0), start=7.0, limits=(-20, 20)
    )
    world = make_world([nut_body], joints=[screw])
    assert world.bodies[0].start["position"] == pytest.approx([0.1 * np.cos(7), 0.1 * np.sin(7), -7 * 0.005 / (2 * pi)])
    problem = Problem.from_world(world, duration=0.1)
    (joint,) = problem.parametric.joints
    assert joint.kind == helical(-0.005)
    assert joint.start == pytest.approx((7.0,))
    assert simulate(problem)["screw.angle"][0] == pytest.approx(7.0)


@pytest.mark.parametrize("pitch", [0, float("nan"), float("inf")])
def test_a_thread_has_a_pitch(pitch: float) -> None:
    screw = HelicalJoint("screw", ("world", "nut"), axis=(0, 0, 1), pitch=pitch, point=(0, 0, 0))
    with pytest.raises(SymphysError, match='joint "screw": pitch must be'):
        make_world([Body.ball("nut", 0.1, 1.0)], joints=[screw])


def test_kinds_are_equal_by_their_pitch() -> None:
    assert helical(0.1) == helical(0.1) != helical(0.2)
    assert {helical(0.1).free, HINGE.free, SLIDER.free} == {1}
    assert FIXED.free == 0
