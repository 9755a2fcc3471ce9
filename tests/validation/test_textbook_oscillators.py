"""Oscillators: dry friction, rotating hoops, and what is struck on a pivot."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, differences, final
from scipy.integrate import solve_ivp
from tools.laboratory import Lab
from tools.repeats import few, first
from worlds.linkage import ABOUT_Y, ABOUT_Z

from symphys.model.joints import BALL, FIXED, HINGE, SLIDER, Joint, JointFrame, Spring, VelocityMotor
from symphys.model.joints.kind import Kind
from symphys.model.shapes import Capsule, Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
@pytest.mark.parametrize("at", [0.3, 0.47])
def test_spring_and_dry_friction(at: float, dt: float) -> None:
    """Coulomb: every half swing pi sqrt(m / c) is 2 mu N / c shorter than the last; it stops where c |x| <= mu N.

    N is the weight of the puck and of the carriage, which is free to sink with it.
    """
    mass, light, stiffness, mu, time = 1.0, 0.1, 30.0, 0.2, 3.0
    bodies = (Body("carriage", light, 1e-3), Body("p", mass, 0.1, (Sphere(0.05),)))
    world = make_world(bodies, [Plane.ground()], Law(mu))
    upright = JointFrame((0, 0, 0), ABOUT_Z)
    joints = (
        Joint("lift", SLIDER, 0, None, (upright, JointFrame((0, 0, 0.05), ABOUT_Z))),
        Joint("rail", SLIDER, 1, 0, (JointFrame(), JointFrame()), spring=Spring(stiffness)),
    )
    lab = Lab(World(world.bodies, world.statics, world.pairs, joints=joints), Scheme(dt=dt))
    start = {"p.position": [at, 0, 0.05], "carriage.position": [0, 0, 0.05]}
    x = lab.states(start, time)["p.position"][:, 0]
    w, shift = np.sqrt(stiffness / mass), mu * (mass + light) * G / stiffness
    exact = []
    half = np.pi / w
    for t in np.arange(len(x)) * dt:
        k = int(t / half)
        left = [at - 2 * shift * i for i in range(k + 1)]
        stops = next((i for i, a in enumerate(left) if a <= shift), None)
        if stops is not None:
            exact.append((-1.0) ** stops * left[stops])
        else:
            exact.append((-1.0) ** k * ((left[k] - shift) * np.cos(w * (t - k * half)) + shift))
    # a stop falls on the boundary of a step, so at first order
    assert np.abs(x - exact).max() < 0.3 * dt
    assert x[-1] == pytest.approx(exact[-1], abs=0.1 * dt)


def governor(moment: float, dt: float) -> Lab:
    """A bob of 1 kg on a hinge whose arm of 0.4 m is turned about the vertical by a motor."""
    bodies = (Body("shaft", 1.0, 0.1), Body("bob", 1.0, moment))
    upright = JointFrame((0, 0, 0), ABOUT_Z)
    joints = (
        Joint("motor", HINGE, 0, None, (upright, upright), VelocityMotor(1e6, 100.0)),
        Joint("pin", HINGE, 1, 0, (JointFrame((0, 0, 0.4), ABOUT_Y), JointFrame((0, 0, 0), ABOUT_Y))),
    )
    return Lab(World(bodies, joints=joints), Scheme(dt=dt), ["motor.command"])


@few("spin", [4.0, 7.0], 1)
@few("moment", [1e-3, 1e-7], 1)
def test_bob_on_a_turning_shaft(moment: float, spin: float) -> None:
    """(m l^2 + I) theta'' = m l^2 (W^2 cos(theta) - g / l) sin(theta): up iff W^2 > g / l (Watt's governor)."""
    length, tilt, time = 0.4, 0.02, 2.0
    place = -length * np.array([np.sin(tilt), 0, np.cos(tilt)])
    start: dict[str, Any] = {"bob.position": place, "bob.orientation": [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]}
    start |= {"bob.velocity": np.cross([0, 0, spin], place), "bob.angular_velocity": [0, 0, spin]}
    start |= {"shaft.angular_velocity": [0, 0, spin]}
    share = length**2 / (length**2 + moment)

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], share * (spin**2 * np.cos(y[0]) - G / length) * np.sin(y[0])]

    errors = []
    for dt in (0.01, 0.005):
        states = governor(moment, dt).states(start, time, u=np.full((1, round(time / dt)), spin))
        p = states["bob.position"]
        angle = np.arctan2(np.hypot(p[:, 0], p[:, 1]), -p[:, 2])
        times = np.arange(len(angle)) * dt
        exact = np.abs(solve_ivp(rate, (0, time), [tilt, 0.0], rtol=1e-10, atol=1e-12, t_eval=times).y[0])
        errors.append(np.abs(angle - exact).max())
    assert (exact.max() > 0.5) == (spin**2 > G / length)
    assert errors[0] < 0.01
    assert errors[1] < errors[0] / 3.5


@pytest.mark.parametrize("pivot", [HINGE, BALL])
def test_pendulum_made_of_two(pivot: Kind) -> None:
    """A rod and a bob fixed to its end swing as one: T = 2 pi sqrt(I / (m g d)), small angles (Huygens)."""
    length, tilt, dt, time = 0.5, 0.01, 0.01, 6.0
    bodies = (Body("rod", 1.0, (1 / 48, 1 / 48, 1e-3)), Body("bob", 2.0, 0.01))
    half = JointFrame((0, 0, length / 2), ABOUT_Y), JointFrame((0, 0, -length / 2), ABOUT_Y)
    joints = (
        Joint("pivot", pivot, 0, None, (half[0], JointFrame((0, 0, 0), ABOUT_Y))),
        Joint("weld", FIXED, 1, 0, (JointFrame((0, 0, 0), ABOUT_Y), half[1])),
    )
    lab = Lab(World(bodies, joints=joints), Scheme(dt=dt))
    down, q = -np.array([np.sin(tilt), 0, np.cos(tilt)]), [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]
    start = {"rod.position": down * length / 2, "bob.position": down * length}
    x = lab.states(start | {"rod.orientation": q, "bob.orientation": q}, time)["bob.position"][:, 0]
    inertia, moment = length**2 / 3 + 2 * length**2 + 0.01, length / 2 + 2 * length
    exact = x[0] * np.cos(np.sqrt(moment * G / inertia) * np.arange(len(x)) * dt)
    assert np.abs(x - exact).max() < 0.01 * abs(x[0])


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
@pytest.mark.parametrize("e", [0.6, 1.0])
def test_ball_strikes_a_rod_on_a_pivot(e: float, dt: float) -> None:
    """J = m v (1 + e) / (1 + m s^2 / I) at s from the pivot: the rod leaves at w = J s / I; by s and v too."""
    mass, length, r, time = 0.5, 1.0, 0.02, 0.12
    rod = Body("rod", 1.0, (1 / 12, 1 / 12, 1e-3), (Capsule(0.01, length / 2),))
    world = make_world([rod, Body.ball("ball", r, mass)], [], Law(0.0, e), (0, 0, 0))
    pivot = Joint("pivot", HINGE, 0, None, (JointFrame((0, 0, length / 2), ABOUT_Y), JointFrame((0, 0, 0), ABOUT_Y)))
    lab = Lab(World(world.bodies, pairs=world.pairs, gravity=(0, 0, 0), joints=(pivot,)), Scheme(dt=dt))

    def start(z: Any) -> dict[str, Any]:
        return {
            "rod.position": [0, 0, -length / 2],
            "ball.position": ca.vertcat(-0.2, 0, -z[0]),
            "ball.velocity": ca.vertcat(z[1], 0, 0),
        }

    def exact(z: Array) -> Array:
        blow = mass * z[1] * (1 + e) / (1 + mass * z[0] ** 2 * 3)
        return np.array([-blow * z[0] * 3, z[1] - blow / mass])

    at = [0.7, 2.0]
    value, slope = final(lab, start, time, ["rod.angular_velocity", "ball.velocity"], at)
    mine = [1, 3]
    # hinges close to third order, which leaves 1e-9 of the rate
    assert value[mine] == pytest.approx(exact(np.array(at)), abs=1e-7)
    assert slope[mine] == pytest.approx(differences(exact, at), abs=1e-6)


@pytest.mark.slow
@few("speed", [1.0, 2.0, 4.0], 1)
def test_rod_rolls_straight_on(speed: float) -> None:
    """A rod of 30 cm and 4 cm across keeps its speed, up to 2 rad in a step, also when nudged along itself."""
    r, half = 0.02, 0.15
    across = 0.1 * (r**2 / 4 + half**2 / 3)
    rod = Body("rod", 0.1, (across, across, 0.1 * r**2 / 2), (Capsule(r, half),))
    lab = Lab(make_world([rod], [Plane.ground()], Law(0.5)), Scheme())
    start = {"rod.position": [0, 0, r], "rod.orientation": [np.sqrt(0.5), np.sqrt(0.5), 0, 0]}
    states = lab.states(start | {"rod.velocity": [speed, 0.01, 0], "rod.angular_velocity": [0, speed / r, 0]}, 1.0)
    assert states["rod.position"][-1] == pytest.approx([speed, 0, r], abs=2e-5)
    assert states["rod.velocity"][-1] == pytest.approx([speed, 0, 0], abs=1e-5)
