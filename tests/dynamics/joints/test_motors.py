"""What acts along the coordinates of joints, against closed forms; and that derivatives are those of differences."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab, central_difference, value_and_gradient
from tools.repeats import few
from worlds.linkage import ABOUT_Y, ABOUT_Z, chain, hanging, momenta, separations

from symphys.model.joints import (
    FIXED,
    HINGE,
    SLIDER,
    UNIVERSAL,
    AffineMotor,
    Joint,
    JointFrame,
    Limits,
    Servo,
    Spring,
    TorqueMotor,
    VelocityMotor,
)
from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

INERTIA = 1.0 * 0.5**2 / 3
"""Of a rod of 1 kg and 0.5 m about its end [kg m^2]."""


def rod(gravity: float = 0.0, dt: float = 0.01, **more: Any) -> Lab:
    """A rod on a hinge about y; its angle is that of its orientation."""
    world = World(chain(1).bodies, gravity=(0, 0, -gravity), joints=chain(1, **more).joints)
    return Lab(world, Scheme(dt=dt), ["j0.command"] if "motor" in more else [])


def swung(
    lab: Lab, time: float, command: float | None = None, angle: float = 0.0, rate: float = 0.0
) -> tuple[Array, Array]:
    """(angles, rates) from an angle and a rate."""
    start = hanging(1, [angle])
    start |= {"b0.angular_velocity": [0, rate, 0], "b0.velocity": np.cross([0, rate, 0], start["b0.position"])}
    u = None if command is None else np.full((1, round(time / lab.scheme.dt)), command)
    states = lab.states(start, time, u=u)
    q = states["b0.orientation"]
    return 2 * np.arctan2(q[:, 2], q[:, 0]), states["b0.angular_velocity"][:, 1]


def test_torque_motor_accelerates() -> None:
    """M t^2 / 2 I, with M held at its largest."""
    for command, torque in ((0.05, 0.05), (7.0, 0.1)):
        angles, rates = swung(rod(motor=TorqueMotor(0.1)), 1.0, command)
        assert rates[-1] == pytest.approx(torque / INERTIA, rel=1e-3)
        assert angles[-1] == pytest.approx(torque / INERTIA / 2, rel=1e-3)


def test_servo_goes_to_its_target() -> None:
    """As fast as its torque lets it, then at its largest velocity, then gently."""
    angles, rates = swung(rod(motor=Servo(20.0, 5.0, 2.0)), 2.0, 1.5)
    assert rates[2] == pytest.approx(5.0 / INERTIA * 0.02, rel=1e-2)
    assert rates[50] == pytest.approx(2.0, abs=1e-4)
    assert angles[-1] == pytest.approx(1.5, abs=1e-5)
    assert angles.max() < 1.5 + 1e-5


def test_servo_keeps_its_range() -> None:
    """Commands beyond it count as its end; those within are followed."""
    free, held = (swung(rod(motor=Servo(20.0, 5.0, 2.0, reach)), 2.0, 1.5)[0] for reach in (None, 0.5))
    assert held[-1] == pytest.approx(0.5, abs=1e-5) and free[-1] == pytest.approx(1.5, abs=1e-5)
    within, plain = (swung(rod(motor=Servo(20.0, 5.0, 2.0, reach)), 1.0, -0.4)[0] for reach in (0.5, None))
    assert np.array_equal(within, plain)


def test_servo_holds_against_gravity() -> None:
    """Horizontal: m g l / 2 = 2.45 N m; with less torque than that it sinks."""
    strong, weak = (
        swung(rod(9.81, motor=Servo(20.0, torque, 5.0)), 3.0, np.pi / 2, np.pi / 2)[0] for torque in (3.0, 2.0)
    )
    assert strong == pytest.approx(np.full(301, np.pi / 2), abs=1e-4)
    assert weak.min() < 1.0


def test_velocity_motor_turns_at_its_command() -> None:
    """To second order in the angle of a step, as the middle of an arc is off its chord."""
    for command, rate in ((1.0, 1.0), (-9.0, -3.0)):
        errors = []
        for dt in (0.01, 0.005):
            _, rates = swung(rod(dt=dt, motor=VelocityMotor(3.0, 3.0)), 1.0, command)
            errors.append(abs(rates[-1] - rate) / abs(rate))
            assert errors[-1] < 0.1 * (rate * dt) ** 2
        assert errors[0] == pytest.approx(4 * errors[1], rel=0.01)


@pytest.mark.parametrize("dt", [0.01, 0.005])
def test_spring_swings_in_its_time_and_keeps_its_energy(dt: float) -> None:
    angles, rates = swung(rod(dt=dt, spring=Spring(5.0, rest=0.2)), 5.0, angle=0.5)
    period = 2 * np.pi * np.sqrt(INERTIA / 5.0)
    away = angles - 0.2
    down = np.flatnonzero((away[:-1] > 0) & (away[1:] <= 0))
    crossings = dt * (down + away[down] / (away[down] - away[down + 1]))
    assert np.diff(crossings).mean() == pytest.approx(period, rel=30 * dt**2)
    kept = INERTIA * rates**2 / 2 + 5.0 * away**2 / 2
    assert np.abs(kept - kept[0]).max() < 300 * dt**2 * kept[0]
    assert abs(kept[-200:].max() - kept[:200].max()) < 0.01 * kept[0]


def test_a_damper_takes_what_it_should() -> None:
    """Rate exp(-c t / I)."""
    _, rates = swung(rod(spring=Spring(0.0, 0.1)), 1.0, rate=2.0)
    assert rates[-1] == pytest.approx(2 * np.exp(-0.1 / INERTIA), rel=1e-3)


def test_a_damper_under_a_load_is_of_second_order() -> None:
    """A cart falls along a rail: v = g m/c (1 - exp(-c t/m))."""
    cart, exact = Body("cart", 2.0, 0.1), 9.81 / 3 * (1 - np.exp(-3 * 0.5))
    frames = JointFrame((0, 0, 0), ABOUT_Z), JointFrame((0, 0, 0), ABOUT_Z)
    rail = Joint("rail", SLIDER, 0, None, frames, spring=Spring(damping=6.0))
    errors = []
    for dt in (0.02, 0.01):
        states = Lab(World((cart,), joints=(rail,)), Scheme(dt=dt)).states({}, 0.5)
        errors.append(abs(states["cart.velocity"][-1, 2] + exact))
    assert errors[1] < 5e-4
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.05)


@few("dt", [0.02, 0.005], 1)
@few("stiffness", [2000.0, 50000.0], 1)
def test_what_is_held_comes_to_rest_where_its_force_is_the_load(dt: float, stiffness: float) -> None:
    """k (target - q) = m g of a position motor, m g and a torque motor's force of a spring; at any time step."""
    load, damping = 2.0 * 9.81, 2 * np.sqrt(stiffness * 2.0)
    motors = AffineMotor(gain=stiffness / 2, kp=stiffness / 4, kv=damping / 4, gear=2.0), TorqueMotor(100.0)
    for motor, spring, command, rest in (
        (motors[0], None, 0.3, 2 * 0.3 / 2 - load / stiffness),
        (motors[1], Spring(stiffness, damping, rest=0.1), 5.0, 0.1 + (5.0 - load) / stiffness),
    ):
        frames = JointFrame((0, 0, 0), ABOUT_Z), JointFrame((0, 0, 0), ABOUT_Z)
        rail = Joint("rail", SLIDER, 0, None, frames, motor=motor, spring=spring)
        world = World((Body("block", 2.0, 0.1),), gravity=(0, 0, -9.81), joints=(rail,))
        lab = Lab(world, Scheme(dt=dt), ["rail.command"])
        steps = round(4.0 / dt)
        states = lab.states({"block.position": [0, 0, 0]}, 4.0, u=np.full((1, steps), command))
        assert states["block.position"][-1, 2] == pytest.approx(rest, abs=1e-9)


def test_a_spring_of_any_stiffness_is_stable() -> None:
    angles, _ = swung(rod(spring=Spring(1e7)), 5.0, angle=0.01)
    assert np.abs(angles).max() < 0.02


@pytest.mark.parametrize("limits", [Limits(lower=-0.5), Limits(upper=0.5), Limits(-0.5, 0.5)])
def test_a_rod_stays_within_its_limits(limits: Limits) -> None:
    """It swings into them and stops, up to what ten sweeps leave of its 3 rad/s."""
    for sign in (1, -1):
        angles, rates = swung(rod(0.0, limits=limits), 0.8, rate=3.0 * sign)
        bound = limits.upper if sign > 0 else limits.lower
        if bound is None:
            assert sign * angles[-1] > 0.5
        else:
            assert sign * angles.max() <= 0.5 + 1e-3 if sign > 0 else angles.min() >= -0.5 - 1e-3
            assert angles[-1] == pytest.approx(bound, abs=0.01)
            assert abs(rates[-1]) < 0.02


def test_what_is_beyond_its_limit_is_taken_back_without_velocity() -> None:
    """In one step, which with velocity would be 1 rad/s; what is left of it comes of the turn of the load."""
    angles, rates = swung(rod(9.81, limits=Limits(lower=0.3)), 0.05, angle=0.29)
    assert angles[1:] == pytest.approx(np.full(5, 0.3), abs=1e-6)
    assert np.abs(rates).max() < 2e-3
    assert abs(rates[-1]) < 1e-9


def test_a_rod_leans_on_its_limit() -> None:
    angles, rates = swung(rod(9.81, limits=Limits(lower=0.3)), 3.0, angle=0.8)
    assert angles[-1] == pytest.approx(0.3, abs=1e-6)
    assert abs(rates[-1]) < 1e-9


def test_slider_and_its_servo() -> None:
    """A cart of 2 kg on a rail along x: F t^2 / 2 m, then it holds its place."""
    cart = Body("cart", 2.0, 0.1)
    rail = Joint("rail", SLIDER, 0, None, (JointFrame(),) * 2, motor=Servo(5.0, 4.0, 1.0), limits=Limits(-1, 1))
    lab = Lab(World((cart,), joints=(rail,)), Scheme(), ["rail.command"])
    states = lab.states({}, 4.0, u=np.full((1, 400), 0.7))
    assert states["cart.velocity"][10, 0] == pytest.approx(0.2, rel=1e-6)
    assert states["cart.position"][-1] == pytest.approx([0.7, 0, 0], abs=1e-6)
    assert states["cart.position"][:, 2] == pytest.approx(0, abs=1e-9)
    far = lab.states({}, 4.0, u=np.full((1, 400), 3.0))["cart.position"][:, 0]
    assert far.max() <= 1 + 1e-6


def test_universal_joint_has_two_servos() -> None:
    joint = Joint("j", UNIVERSAL, 0, None, (JointFrame((0, 0, 0.25)), JointFrame()), motor=Servo(10.0, 5.0, 3.0))
    lab = Lab(World(chain(1).bodies, joints=(joint,)), Scheme(), ["j.command"])
    last = lab.step.mapaccum(200)
    x = ca.DM(lab.trajectory(hanging(1, [0.0]), 2.0, u=np.tile([[0.4], [-0.3]], 200))[:, -1])
    assert last is not None
    q = np.array(x[lab.layout["b0.orientation"]]).ravel()
    from scipy.spatial.transform import Rotation

    swing, twist = Rotation.from_quat(q, scalar_first=True).as_euler("YXZ")[:2]
    assert (swing, twist) == (pytest.approx(0.4, abs=1e-5), pytest.approx(-0.3, abs=1e-5))


def test_a_soft_joint_sags() -> None:
    """g / (2 pi f)^2, 62 mm at 2 Hz (Catto)."""
    body = Body("b", 1.0, 0.1)
    joint = Joint("j", FIXED, 0, None, (JointFrame(),) * 2, frequency=2.0, damping=1.0)
    z = Lab(World((body,), joints=(joint,)), Scheme()).states({}, 4.0)["b.position"][-1, 2]
    assert z == pytest.approx(-9.81 / (4 * np.pi) ** 2, rel=1e-6)


def test_derivatives_are_those_of_differences() -> None:
    """By masses, lengths, gains, limits and springs, through a foot that lands and pushes off."""
    m, length, gain, k = ca.SX.sym("m"), ca.SX.sym("l"), ca.SX.sym("g"), ca.SX.sym("k")
    hip = Body("hip", 2.0, (0.02, 0.03, 0.04))
    shin = Body("shin", m, (0.01, 0.012, 0.003), (Sphere(0.05, (0, 0, -length)),))
    frames = JointFrame((0, 0, 0.2), ABOUT_Y), JointFrame((0.05, 0, -0.1), ABOUT_Y)
    knee = Joint("knee", HINGE, 1, 0, frames, Servo(gain, 20.0, 8.0), Limits(-1.0, 0.9), Spring(k, 0.1))
    flat = make_world([hip, shin], [Plane.ground()], Law(0.5, 0.2))
    pairs = tuple(pair for pair in flat.pairs if pair.second.body is None)
    world = World(flat.bodies, flat.statics, pairs, joints=(knee,))
    lab = Lab(world, Scheme(cuts=0), ["knee.command"], [m, length, gain, k])

    def end(z: Any) -> Any:
        start = {
            "hip.position": ca.vertcat(0.02, 0.01, z[4] + 0.1 + 0.25),
            "shin.position": ca.vertcat(0.07, 0.01, z[4] + 0.05),
        }
        u = ca.repmat(z[5], 1, 40)
        x = lab.trajectory(start, 0.4, u=u, p=z[:4])[:, -1]
        return ca.vertcat(x[lab.layout["hip.position"]], x[lab.layout["shin.velocity"]])

    at = [0.8, 0.2, 15.0, 3.0, 0.35, 0.5]
    value, slope = value_and_gradient(end, at)
    differences = central_difference(end, at, 1e-7)
    assert np.isfinite(value).all()
    assert slope == pytest.approx(differences, rel=1e-5, abs=1e-6 * np.abs(slope).max())
    assert np.abs(slope).max(axis=0).min() > 1e-6


def test_joints_fit_while_a_leg_lands() -> None:
    world = chain(3)
    states = Lab(world, Scheme(sweeps=20)).states(hanging(3, [0.5, 1.0, 1.5]), 2.0)
    assert separations(world, states).max() < 1e-3


def test_a_soft_joint_of_two_free_bodies_keeps_its_limit() -> None:
    """No tree holds them: what is beyond the limit is taken back, and no momentum is made."""
    bodies = (Body("a", 1.0, (0.02, 0.03, 0.04)), Body("b", 2.0, (0.05, 0.04, 0.06)))
    frames = JointFrame((0, 0, -0.2), ABOUT_Y), JointFrame((0, 0, 0.2), ABOUT_Y)
    joint = Joint("j", HINGE, 0, 1, frames, limits=Limits(upper=0.3), frequency=5.0, damping=1.0)
    lab = Lab(World(bodies, gravity=(0, 0, 0), joints=(joint,)), Scheme())
    q = [np.cos(0.2), 0, np.sin(0.2), 0]
    start = {"a.position": [0.2 * np.sin(0.4), 0, 0.2 + 0.2 * np.cos(0.4)], "a.orientation": q}
    states = lab.states(start, 0.5)
    turns = [2 * np.arctan2(states[f"{name}.orientation"][:, 2], states[f"{name}.orientation"][:, 0]) for name in "ab"]
    assert (turns[0] - turns[1])[0] == pytest.approx(0.4)
    assert (turns[0] - turns[1])[1] == pytest.approx(0.3, abs=1e-6)
    assert (turns[0] - turns[1])[1:].max() < 0.3 + 1e-6
    linear, angular = momenta(lab.world, states)
    assert np.abs(linear).max() < 1e-12
    assert np.abs(angular).max() < 1e-12
