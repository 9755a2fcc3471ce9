"""Angles of joints count whole turns: what acts along them knows no end of a turn, however far a step goes."""

from __future__ import annotations

from math import pi

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

import symphys
from symphys import Problem, Trajectory, step_function
from symphys.dynamics.observation import reading_function
from symphys.model import AffineMotor, Body, Hinge, Scheme, Servo, Spring, UniversalJoint, initial_state, make_world

RADIUS = np.sqrt(0.025)
"""[m] of a ball of 1 kg with an inertia of 0.01 kg m^2."""
STIFF = 0.04
"""[N m/rad]: with that inertia 2 rad/s."""


def ball(name: str, spin: tuple[float, float, float] = (0, 0, 0), **more: object) -> Body:
    """A ball of 1 kg and 0.01 kg m^2."""
    return Body.ball(name, radius=RADIUS, mass=1.0, angular_velocity=spin, **more)  # type: ignore[arg-type]


def axle(**more: object) -> Hinge:
    """Of the wheel in the world, about y."""
    return Hinge("axle", ("world", "wheel"), axis=(0, 1, 0), point=(0, 0, 0), **more)  # type: ignore[arg-type]


def turned(
    spin: float = 0.0, duration: float = 2.0, dt: float = 0.01, command: float = 0.0, **more: object
) -> Trajectory:
    """A wheel on its axle, without gravity."""
    world = make_world([ball("wheel", (0, spin, 0))], joints=[axle(**more)], gravity=(0, 0, 0))
    variables = {"aim": {"sets": "axle.command", "guess": [command]}} if "motor" in more else {}
    return symphys.simulate(Problem.from_world(world, duration=duration, dt=dt, variables=variables))


@few("amplitude", [1.0, 3.25, 5.0, 31.0, 1000.0], 2)
def test_a_spring_swings_alike_at_all_amplitudes(amplitude: float) -> None:
    """Angle A sin 2t, to second order in dt; a spring is linear, also where a step makes 30 turns."""
    off = []
    for dt in (0.1, 0.05):
        found = turned(2 * amplitude, dt=dt, spring=Spring(stiffness=STIFF))
        off.append(np.abs(found["axle.angle"] / amplitude - np.sin(2 * found.time)).max())
        energy = 0.01 * found["axle.rate"] ** 2 + STIFF * found["axle.angle"] ** 2
        assert np.ptp(energy) < 4.1 * dt**2 * energy[0]
    assert off[0] < 0.014
    assert off[0] / off[1] == pytest.approx(4, abs=0.1)


@pytest.mark.parametrize("rest", [4.0, -9.0, 40.0])
def test_a_spring_pulls_to_its_rest_through_turns(rest: float) -> None:
    found = turned(spring=Spring(stiffness=STIFF, rest=rest))
    np.testing.assert_allclose(found["axle.angle"], rest * (1 - np.cos(2 * found.time)), atol=3e-4 * abs(rest))


@pytest.mark.parametrize("sign", [1, -1])
def test_limits_lie_turns_away(sign: int) -> None:
    found = turned(sign * 8.0, limits=(-10, 10))
    np.testing.assert_allclose(found["axle.angle"], sign * np.minimum(8.0 * found.time, 10), atol=1e-6)
    assert abs(found["axle.rate"][-1]) < 1e-9


@pytest.mark.parametrize("start", [3.5, 7.0, -100.0])
def test_a_joint_starts_turns_away(start: float) -> None:
    found = turned(3.0, start=start)
    np.testing.assert_allclose(found["axle.angle"], start + 3.0 * found.time, atol=1e-9)


@pytest.mark.parametrize("aim", [6 * pi, -5.0])
def test_servos_follow_commands_through_turns(aim: float) -> None:
    found = turned(motor=Servo(gain=10, torque=5, velocity=20), command=aim)
    assert found["axle.angle"][-1] == pytest.approx(aim, abs=1e-4)
    steps = np.diff(found["axle.angle"]) * np.sign(aim)
    assert steps.min() > -1e-9


def test_an_affine_motor_is_a_spring_to_its_command() -> None:
    """As a position actuator of MuJoCo is: kp (command - angle)."""
    motor = AffineMotor(gain=STIFF, kp=STIFF)
    found = turned(motor=motor, command=15.0)
    np.testing.assert_allclose(found["axle.angle"], 15.0 * (1 - np.cos(2 * found.time)), atol=0.01)


@pytest.mark.parametrize("which", ["angle1", "angle2"])
def test_universal_joints_wind_about_both_axes(which: str) -> None:
    spin = (0.0, 62.0, 0.0) if which == "angle1" else (62.0, 0.0, 0.0)
    joint = UniversalJoint(
        "cardan", ("world", "wheel"), axes=((0, 1, 0), (1, 0, 0)), point=(0, 0, 0), spring=Spring(STIFF)
    )
    world = make_world([ball("wheel", spin)], joints=[joint], gravity=(0, 0, 0))
    found = symphys.simulate(Problem.from_world(world, duration=2.0, dt=0.01))
    wound = 31.0 * np.sin(2 * found.time)
    expected = np.stack([wound, 0 * wound] if which == "angle1" else [0 * wound, wound], axis=1)
    np.testing.assert_allclose(found["cardan.angle"], expected, atol=0.01)


def machine(follower: dict[str, object], polynomial: list[float], spin: float = 80.0) -> Trajectory:
    """A wheel on a post, and a load that follows it by a polynomial, over 2 s."""
    still = {"shape": {"sphere": {"radius": float(RADIUS)}}, "mass": 1.0, "collides_with": []}
    return symphys.simulate(
        {
            "simulation": {"duration": 2.0, "dt": 0.01},
            "world": {"gravity": [0, 0, 0]},
            "body": [
                {"name": "post", **still},
                {"name": "wheel", **still, "angular_velocity": [0, spin, 0]},
                {"name": "load", **still},
            ],
            "joint": [
                {"name": "stand", "between": ["world", "post"], "fixed": {}, "point": [0, 0, 0]},
                {"name": "axle", "between": ["post", "wheel"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 0, 0]},
                {"name": "follower", "between": ["post", "load"], "point": [0, 0, 0], **follower},
            ],
            "coupling": [{"name": "gear", "joints": ["follower", "axle"], "polynomial": polynomial}],
        }
    )


@few("ratio", [0.005 / (2 * pi), -0.05], 1)
def test_slides_follow_screws_and_drums_over_turns(ratio: float) -> None:
    """A spindle of 5 mm lead, and a drum of 50 mm radius: one constant rate, no jump by a lead."""
    found = machine({"slider": {"axis": [1, 0, 0]}}, [0.0, ratio])
    angle = found["axle.angle"].ravel()
    np.testing.assert_allclose(np.diff(angle)[1:], 0.01 * found["axle.rate"].ravel()[-1], rtol=1e-9)
    np.testing.assert_allclose(found["follower.position"].ravel(), ratio * angle, atol=1e-9)
    assert angle[-1] > 7 * 2 * pi


@pytest.mark.parametrize("polynomial", [[0.0, 1 / 40], [0.3, -3.0], [0.0, 0.5, 0.01]])
def test_gears_turn_with_each_other_over_turns(polynomial: list[float]) -> None:
    """A worm, a pair of wheels, a gear whose ratio grows with the angle."""
    begins = {"start": polynomial[0]} if polynomial[0] else {}
    found = machine({"hinge": {"axis": [0, 0, 1]}, **begins}, polynomial)
    angle, after = found["axle.angle"].ravel(), found["follower.angle"].ravel()
    np.testing.assert_allclose(after, np.polynomial.Polynomial(polynomial)(angle), atol=2e-3)
    np.testing.assert_allclose(after[3:], np.polynomial.Polynomial(polynomial)(angle[3:]), atol=5e-5)
    energy = found["axle.rate"].ravel() ** 2 + found["follower.rate"].ravel() ** 2
    np.testing.assert_allclose(energy[2:], energy[2], rtol=1e-3)
    assert max(angle[-1], abs(after[-1])) > 7 * 2 * pi


def crank(closing: str) -> Trajectory:
    """A motor turns a crank, with a coupler between it and a rocker; ``closing`` is the joint that closes the loop."""
    pins = {"axle": (0.0, 0.0), "pin": (0.1, 0.0), "knee": (0.3, 0.3), "pivot": (0.35, 0.0)}
    between = [("axle", "pin", "crank"), ("pin", "knee", "coupler"), ("knee", "pivot", "rocker")]
    bodies = []
    for first, second, name in between:
        x, z = ((pins[first][i] + pins[second][i]) / 2 for i in range(2))
        bodies.append({"name": name, "position": [x, 0, z], "mass": 1.0, "inertia": 0.01, "collides_with": []})
        bodies[-1]["shape"] = {"sphere": {"radius": 0.01}}
    sides = {"axle": ["world", "crank"], "pin": ["crank", "coupler"], "knee": ["coupler", "rocker"]}
    sides["pivot"] = ["world", "rocker"]
    joints = []
    for name in sorted(sides, key=lambda name: name == closing):
        place = {"name": name, "between": sides[name], "point": [pins[name][0], 0, pins[name][1]]}
        joints.append(place | {"hinge": {"axis": [0, 1, 0]}})
        if name == "axle":
            joints[-1] |= {"motor": {"torque": {"torque": 10}}, "spring": {"damping": 0.02}}
    tables = {"body": bodies, "joint": joints, "world": {"gravity": [0, 0, 0]}}
    push = {"name": "push", "sets": "axle.command", "guess": 0.2}
    return symphys.simulate({"simulation": {"duration": 3.0, "dt": 0.005}, **tables, "variable": [push]})


@pytest.mark.slow
def test_a_joint_that_closes_a_loop_winds_like_one_of_a_tree() -> None:
    by_tree, closing = crank("pivot"), crank("axle")
    assert by_tree["axle.angle"][-1] > 2 * 2 * pi
    for name in ("axle", "pin", "knee", "pivot"):
        np.testing.assert_allclose(closing[f"{name}.angle"], by_tree[f"{name}.angle"], atol=0.05)


def test_a_soft_joint_winds() -> None:
    found = turned(31.0, frequency=20.0, spring=Spring(stiffness=STIFF))
    np.testing.assert_allclose(found["axle.angle"], 15.5 * np.sin(2 * found.time), atol=0.01)


@pytest.mark.parametrize("spin", [300.0, -1234.5])
def test_several_turns_in_a_step_count(spin: float) -> None:
    found = turned(spin, dt=0.05)
    np.testing.assert_allclose(found["axle.angle"], spin * found.time, rtol=1e-9)


@pytest.mark.thorough
def test_angles_wind_where_impacts_cut_steps() -> None:
    """A wheel that may meet two others, of which one falls onto the other: steps are cut at impacts."""
    below = [ball(name, position=(2, 0, z)) for name, z in (("first", 0.2), ("second", 0.7))]
    bodies, ground = [ball("wheel", (0, 20, 0)), *below], symphys.model.Plane("ground", (0, 0, 1), -1.0)
    world = make_world(bodies, [ground], joints=[axle()])
    found = symphys.simulate(Problem.from_world(world, duration=1.0, dt=0.01))
    np.testing.assert_allclose(found["axle.angle"].ravel(), 20 * found.time, atol=1e-9)


@pytest.mark.parametrize("start", [pi - 0.15, 3 * pi - 0.01, -pi, 40.0])
def test_slopes_go_through_the_cut(start: float) -> None:
    """Of an angle that a spring pulls at, by where it began and how fast: as differences have them."""
    world = make_world([ball("wheel")], joints=[axle(spring=Spring(stiffness=STIFF))], gravity=(0, 0, 0))
    step, read = step_function(world, Scheme(dt=0.05)), reading_function(world)
    begun = ca.MX.sym("begun", 2)
    turn = ca.vertcat(ca.cos(begun[0] / 2), 0, ca.sin(begun[0] / 2), 0)
    spin = ca.vertcat(0, begun[1], 0)
    given = {"wheel.orientation": turn, "wheel.angular_velocity": spin, "axle.unwrapped": begun[0]}
    x = initial_state(world, given)
    for _ in range(3):
        x = step(x, [], [], 0)
    angle = read(x, [])[0]
    swung = ca.Function("swung", [begun], [angle, ca.jacobian(angle, begun)])
    at, h = np.array([start, 1.0]), 1e-4
    value, slope = swung(at)
    assert float(value) == pytest.approx(start + 0.15, abs=0.05 * abs(start))
    ends = [float(swung(at + sign * h * along)[0]) for along in np.eye(2) for sign in (1, -1)]
    differences = [(ends[0] - ends[1]) / (2 * h), (ends[2] - ends[3]) / (2 * h)]
    np.testing.assert_allclose(np.array(slope).ravel(), differences, rtol=1e-7)
