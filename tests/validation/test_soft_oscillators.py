"""Soft joints and soft contacts are the damped oscillator of their frequency and ratio, at steps that are not fine.

The law: e'' = a - w^2 e - 2 z w e' with w = 2 pi f. One mass on one soft joint, and a ball on soft ground, move by its
exact solution at any step; what couples several is right to second order in the step.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from tools.laboratory import Lab
from tools.repeats import few

from symphys.dynamics.contact.oscillator import response, spring_law
from symphys.model.joints import BALL, FIXED, SLIDER, Joint, JointFrame
from symphys.model.shapes import Box, Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

HZ, G, RADIUS = 5.0, 9.81, 0.1
OMEGA = 2 * np.pi * HZ
FRAMES = JointFrame(), JointFrame()


def oscillator(ratio: float, dt: float, steps: int) -> Array:
    """(steps + 1, 2): deviation and velocity of the free oscillator that starts at 0 with 1 m/s."""
    rates = np.array([[0, 1], [-(OMEGA**2), -2 * ratio * OMEGA]])
    return np.array([expm(rates * dt * k) @ [0, 1] for k in range(steps + 1)])


@few("ratio", [0, 0.05, 0.3, 1, 2], 3)
@few("angle", [0.05, 0.3, 1.0], 1)
def test_a_mass_on_a_soft_joint_is_the_exact_oscillator(angle: float, ratio: float) -> None:
    dt, steps = angle / OMEGA, 20
    joint = Joint("j", BALL, 0, None, FRAMES, frequency=HZ, damping=ratio)
    lab = Lab(World((Body("b", 2.0, 0.02),), gravity=(0, 0, 0), joints=(joint,)), Scheme(dt=dt))
    states, exact = lab.states({"b.velocity": [1, 0, 0]}, steps * dt), oscillator(ratio, dt, steps)
    assert states["b.position"][:, 0] == pytest.approx(exact[:, 0], abs=1e-12)
    assert states["b.velocity"][:, 0] == pytest.approx(exact[:, 1], abs=1e-10)


@pytest.mark.parametrize(("angle", "ratio"), [(1.0, 0.3)])
def test_two_bodies_on_a_soft_joint_are_one_oscillator(angle: float, ratio: float) -> None:
    """Of 1 and 5 kg and of unequal moments: their distance and their turn against each other."""
    dt, steps = angle / OMEGA, 20
    joint = Joint("j", FIXED, 0, 1, FRAMES, frequency=HZ, damping=ratio)
    bodies = Body("a", 1.0, 0.02), Body("b", 5.0, 0.3)
    lab = Lab(World(bodies, gravity=(0, 0, 0), joints=(joint,)), Scheme(dt=dt))
    states = lab.states({"a.velocity": [0.8, 0, 0], "b.velocity": [-0.2, 0, 0]}, steps * dt)
    apart = states["a.position"] - states["b.position"]
    assert apart[:, 0] == pytest.approx(oscillator(ratio, dt, steps)[:, 0], abs=1e-12)
    assert states["a.velocity"] + 5 * states["b.velocity"] == pytest.approx(
        np.tile([-0.2, 0, 0], (steps + 1, 1)), abs=1e-12
    )


def eccentric(dt: float) -> Array:
    """(7,): pose of a bar after 0.24 s that a soft joint holds at its end: a turn and a shift that are coupled."""
    joint = Joint("j", FIXED, 0, None, (JointFrame((0.3, 0, 0)), JointFrame()), frequency=2.0, damping=0.1)
    lab = Lab(World((Body("b", 2.0, (0.02, 0.04, 0.05)),), joints=(joint,)), Scheme(dt=dt))
    start = {"b.position": [-0.3, 0, 0], "b.velocity": [0.2, 0, 0], "b.angular_velocity": [0, 0.3, 0.5]}
    states = lab.states(start, 0.24)
    return np.append(states["b.position"][-1], states["b.orientation"][-1])


@pytest.mark.slow
def test_a_bar_on_a_soft_joint_at_its_end_is_of_second_order() -> None:
    fine = eccentric(0.0005)
    errors = [np.linalg.norm(eccentric(dt) - fine) for dt in (0.02, 0.01, 0.005)]
    assert errors[0] < 2e-3
    assert 3.5 < errors[0] / errors[1] < 4.8
    assert 3.5 < errors[1] / errors[2] < 4.8


def rebound(ratio: float, height: float, time: float) -> Array:
    """(2,): place and velocity of a ball that falls onto soft ground, integrated from event to event."""

    def parts(t: float, y: Array) -> float:
        return float(y[0] + 2 * ratio / OMEGA * y[1])

    def meets(t: float, y: Array) -> float:
        return float(max(y[0], parts(t, y)))

    parts.terminal, parts.direction, meets.terminal, meets.direction = True, 1, True, -1  # type: ignore[attr-defined]
    now, y, touching = 0.0, np.array([height, 0.0]), False
    while now < time:
        push = (lambda y: -(OMEGA**2) * y[0] - 2 * ratio * OMEGA * y[1]) if touching else (lambda y: 0.0)
        found = solve_ivp(
            lambda t, y, push=push: [y[1], push(y) - G],
            (now, time),
            y,
            events=parts if touching else meets,
            rtol=1e-11,
            atol=1e-13,
        )
        now, y, touching = found.t[-1], found.y[:, -1], not touching
    return y


@few("ratio", [0, 0.05, 0.3, 1, 2], 3)
@few("dt", [0.0025, 0.01, 0.03], 2)
def test_a_ball_rebounds_from_soft_ground_as_integrated(dt: float, ratio: float) -> None:
    """At 0.08, 0.3 and 0.94 rad a step; touch and parting lie within steps."""
    law = Law(0.5, 0.0, frequency=HZ, damping=ratio)
    world = make_world([Body("b", 2.0, 0.02, (Sphere(RADIUS),))], [Plane.ground()], law, gravity=(0, 0, -G))
    states = Lab(world, Scheme(dt=dt)).states({"b.position": [0, 0, RADIUS + 0.0937]}, 0.42)
    ended = states["b.position"][-1, 2] - RADIUS, states["b.velocity"][-1, 2]
    assert ended == pytest.approx(rebound(ratio, 0.0937, 0.42), abs=1e-6 if dt > 0.02 else 1e-9)


def test_balls_of_unequal_mass_bounce_off_each_other_softly() -> None:
    """Without damping they exchange their momentum as elastic balls do, and are late by half a period."""
    law = Law(0.0, 0.0, frequency=HZ, damping=0.0)
    bodies = Body("a", 1.0, 0.004, (Sphere(RADIUS),)), Body("b", 3.0, 0.012, (Sphere(RADIUS),))
    world = make_world(bodies, [], law, gravity=(0, 0, 0))
    states = Lab(world, Scheme(dt=0.01)).states({"b.position": [0.2637, 0, 0], "a.velocity": [1, 0, 0]}, 0.4)
    assert states["a.velocity"][-1, 0] == pytest.approx(-0.5, abs=1e-10)
    assert states["b.velocity"][-1, 0] == pytest.approx(0.5, abs=1e-10)
    assert states["a.position"][-1, 0] == pytest.approx(0.0637 - 0.5 * (0.4 - 0.0637 - 0.1) + 0.25 * 0.1, abs=1e-9)


@pytest.mark.slow
@few("hz", [10.0, 50.0, 200.0], 1)
def test_a_box_on_soft_ground_gains_no_energy(hz: float) -> None:
    """Up to 12 rad a step, four corners at once; undamped, its energy in flight is at most what it was, within 1 %."""
    side, mass = 0.2, 2.0
    box = Body("b", mass, mass * side**2 / 6, (Box((side / 2,) * 3),))
    law = Law(0.0, 0.0, frequency=hz, damping=0.0)
    world = make_world([box], [Plane.ground()], law, gravity=(0, 0, -G))
    states = Lab(world, Scheme(dt=0.01)).states({"b.position": [0, 0, 0.16]}, 1.0)
    energy = mass * G * states["b.position"][:, 2] + mass / 2 * (states["b.velocity"] ** 2).sum(1)
    assert energy.max() < 1.01 * energy[0]


@few("ratio", [0, 0.3], 1)
def test_a_foot_on_a_rail_rebounds_as_a_free_ball(ratio: float) -> None:
    """Of a tree of joints, whose motion is predicted under the forces of the last step."""
    half = 0.5**0.5
    law, upright = Law(0.5, 0.0, frequency=HZ, damping=ratio), JointFrame(orientation=(half, 0, -half, 0))
    free = make_world([Body("b", 2.0, 0.02, (Sphere(RADIUS),))], [Plane.ground()], law)
    rail = Joint("rail", SLIDER, 0, None, (upright, upright))
    world = World(free.bodies, free.statics, free.pairs, gravity=(0, 0, -G), joints=(rail,))
    states = Lab(world, Scheme(dt=0.01)).states({"b.position": [0, 0, RADIUS + 0.0937]}, 0.42)
    ended = states["b.position"][-1, 2] - RADIUS, states["b.velocity"][-1, 2]
    assert ended == pytest.approx(rebound(ratio, 0.0937, 0.42), abs=1e-8)


@pytest.mark.parametrize("count", range(1, 7))
def test_equal_springs_on_one_body_do_not_grow(count: int) -> None:
    """Eigenvalues of a step of up to six that share a mass, from w dt .05 to 6, have a size of at most 1."""
    omega, ratio = ca.SX.sym("omega"), ca.SX.sym("ratio")
    law = spring_law(response(omega, ratio, ca.SX(1)), response(omega, -ratio, ca.SX(1)))
    numbers = ca.Function("law", [omega, ratio], [law.stiff, law.b, law.c])
    for angle in np.arange(0.05, 6, 0.05):
        for share in (0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1, 2):
            stiff, b, c = (count * float(each) for each in numbers(angle, share))
            velocity = np.array([1 - c, -stiff]) / (1 + b)
            step = np.array([velocity, velocity + np.array([0, 1])])
            assert np.abs(np.linalg.eigvals(step)).max() < 1 + 1e-7, (angle, share)
