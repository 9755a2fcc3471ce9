"""Tops and gyroscopes on joints, against Euler's equations about their fixed point."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, about_a_point, differences, final, turn
from tools.laboratory import Lab
from tools.repeats import few
from worlds.blocks import turned_by

from symphys.model.joints import BALL, HINGE, Joint, JointFrame
from symphys.model.world import Body, Scheme, World
from symphys.types import Array

MASS, ARM = 0.5, 0.08
MOMENTS = (8e-4, 8e-4, 5e-4)
"""Of a top about its centre of mass, its axis last [kg m^2]."""
ABOUT_TIP = (8e-4 + MASS * ARM**2,) * 2 + (5e-4,)


def top(dt: float) -> Lab:
    """Its tip is held at the origin; its axis is its z."""
    tip = Joint("tip", BALL, 0, None, (JointFrame((0, 0, -ARM)), JointFrame()))
    return Lab(World((Body("top", MASS, MOMENTS),), joints=(tip,)), Scheme(dt=dt))


def leaning(tilt: float, w: Any) -> dict[str, Any]:
    """Turned about x by ``tilt``, turning at w (3,), world frame, about the tip."""
    q = turned_by((1, 0, 0), tilt)
    place = turn(q) @ [0, 0, ARM]
    return {
        "top.position": place,
        "top.orientation": q,
        "top.velocity": ca.cross(ca.vertcat(w), place),
        "top.angular_velocity": w,
    }


def exact_top(tilt: float, w: Array, time: float) -> tuple[Array, Array]:
    return about_a_point(ABOUT_TIP, [0, 0, ARM], MASS * G, turned_by((1, 0, 0), tilt), w, time)


@pytest.mark.slow
@few("spin", [20.0, 40.0, 100.0], 1)
def test_lagranges_top(spin: float) -> None:
    """Precession and nutation of a heavy symmetric top with its tip fixed, by its spin too: second order in dt."""
    tilt, time = 0.6, 0.5
    axis = turn(turned_by((1, 0, 0), tilt)) @ [0, 0, 1]

    def exact(z: Array) -> Array:
        return turn(exact_top(tilt, z[0] * axis, time)[0]) @ [0, 0, ARM]

    by = differences(exact, [spin], 1e-4)
    errors = []
    for dt in (0.01, 0.005, 0.0025):
        value, slope = final(top(dt), lambda z: leaning(tilt, z[0] * ca.DM(axis)), time, ["top.position"], [spin])
        errors.append([np.abs(value - exact(np.array([spin]))).max(), np.abs(slope - by).max()])
    # a turn of 1 rad in a step leaves a twentieth of the arm
    assert errors[0][0] < 0.07 * ARM * (spin * 0.01) ** 2
    assert errors[1][0] < errors[0][0] / 3 and errors[2][0] < errors[1][0] / 3
    assert errors[2][1] < 0.02 * np.abs(by).max()
    assert errors[2][1] < errors[0][1] / 13


@few("share", [0.8, 0.95, 1.05, 1.5], 1)
def test_sleeping_top(share: float) -> None:
    """Upright it stands iff C^2 s^2 > 4 A m g l; its axis obeys A u'' - i C s u' - m g l u = 0 for small tilts."""
    mass, arm, a, c = 0.5, 0.05, 2.5e-3 + 0.5 * 0.05**2, 5e-3
    weight = mass * G * arm
    spin = share * np.sqrt(4 * a * weight) / c
    tilt, time = 1e-5, 1.0
    roots = np.roots([a, -1j * c * spin, -weight])
    # turning about the vertical, the axis u = sin(tilt) towards -y turns at the spin
    amounts = np.linalg.solve([[1, 1], roots], [-1j * tilt, spin * tilt])
    tip = Joint("tip", BALL, 0, None, (JointFrame((0, 0, -arm)), JointFrame()))
    world = World((Body("top", mass, (2.5e-3, 2.5e-3, c)),), joints=(tip,))
    errors = []
    for dt in (0.01, 0.005):
        place = turn(turned_by((1, 0, 0), tilt)) @ [0, 0, arm]
        start = leaning(tilt, [0, 0, spin]) | {"top.position": place, "top.velocity": np.cross([0, 0, spin], place)}
        states = Lab(world, Scheme(dt=dt)).states(start, time)
        exact = np.exp(np.outer(np.arange(round(time / dt) + 1) * dt, roots)) @ amounts
        u = (states["top.position"][:, 0] + 1j * states["top.position"][:, 1]) / arm
        errors.append(np.abs(u - exact).max() / np.abs(exact).max())
    assert (np.abs(u).max() < 5 * tilt) == (share > 1)
    assert errors[0] < 0.03
    assert errors[1] < errors[0] / 3.5


def gyroscope(dt: float) -> Lab:
    """An arm that turns freely about the origin, and a wheel on an axle along it."""
    bodies = (Body("arm", 0.1, (1e-4, 1e-4, 1e-5)), Body("wheel", 1.0, (1e-3, 1e-3, 2e-3)))
    axle = tuple(turned_by((0, 1, 0), -np.pi / 2))
    joints = (
        Joint("pivot", BALL, 0, None, (JointFrame((0, 0, -0.1)), JointFrame())),
        Joint("axle", HINGE, 1, 0, (JointFrame((0, 0, 0), axle), JointFrame((0, 0, 0.1), axle))),
    )
    return Lab(World(bodies, joints=joints), Scheme(dt=dt))


@pytest.mark.slow
@few("spin", [50.0, 100.0, 150.0, 300.0], 1)
def test_wheel_on_an_arm(spin: float) -> None:
    """A gyroscope held by the end of its arm, level at first: a top whose arm does not turn with the wheel.

    About the pivot: A of the arm and of the wheel with m l^2 each, C the wheel's alone, since the axle gives no torque.
    """
    time, tilt = 0.5, np.pi / 2
    axis = turn(turned_by((1, 0, 0), tilt)) @ [0, 0, 1]
    across = 1.1e-3 + 0.1 * 0.1**2 + 1.0 * 0.2**2
    weight, length = 1.1 * G, (0.1 * 0.1 + 0.2) / 1.1
    q, _ = about_a_point((across, across, 2e-3), [0, 0, length], weight, turned_by((1, 0, 0), tilt), spin * axis, time)
    errors = []
    for dt in (0.01, 0.0025):
        start = {
            "arm.position": 0.1 * axis,
            "arm.orientation": turned_by((1, 0, 0), tilt),
            "wheel.position": 0.2 * axis,
            "wheel.orientation": turned_by((1, 0, 0), tilt),
            "wheel.angular_velocity": spin * axis,
        }
        wheel = gyroscope(dt).states(start, time)["wheel.position"][-1]
        errors.append(np.abs(wheel - turn(q) @ [0, 0, 0.2]).max())
    assert errors[0] < 5e-4
    # 3 rad in a step are too far for an order: 0.44 mm, 0.09 mm at a quarter of it
    assert errors[1] < (1e-4 if spin * 0.01 > 2 else errors[0] / 8)


def test_spherical_pendulum_precesses() -> None:
    """Airy: small ellipses with half axes a, b turn by 3/8 a b / l^2 of their phase: 3/8 w a b / l^2 [rad/s]."""
    length, a, b, dt, time = 1.0, 0.2, 0.1, 0.01, 10.0
    string = Joint("string", BALL, 0, None, (JointFrame((0, 0, length)), JointFrame()))
    lab = Lab(World((Body("bob", 1.0, 1e-9),), joints=(string,)), Scheme(dt=dt))
    w0 = np.sqrt(G / length)
    q = turned_by((0, 1, 0), -np.arcsin(a))
    place = turn(q) @ [0, 0, -length]
    w = np.cross(place, [0, b * w0, 0]) / length**2
    states = lab.states(
        {"bob.position": place, "bob.orientation": q, "bob.velocity": [0, b * w0, 0], "bob.angular_velocity": w}, time
    )
    places = states["bob.position"][:, :2] - states["bob.position"][:, :2].mean(axis=0)
    last = places[-round(2 * np.pi / w0 / dt) :]
    along = np.linalg.svd(last)[2][0]
    turned = np.arctan2(along[1], along[0]) % np.pi
    # the last round's middle is half a period before the end; next terms are of order a^2
    assert turned == pytest.approx(3 / 8 * w0 * a * b / length**2 * (time - np.pi / w0), rel=0.02)
