"""Conservation laws and convergence: free flight, collisions between bodies, compounds of spheres; cases V7 and V12."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab

from symphys.maths import rotation
from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world

WEIGHTLESS = (0.0, 0.0, 0.0)
INERTIA = (0.02, 0.03, 0.045)
DUMBBELL = (Sphere(0.2, (0.3, 0.0, 0.0)), Sphere(0.15, (-0.4, 0.0, 0.0)))


def matrices(q):
    """(N, 3, 3) rotation matrices of unit quaternions, by the textbook formula."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def spin_momentum(states, name, moments):
    """(N, 3): angular momentum about the body's own centre."""
    r, w = matrices(states[f"{name}.orientation"]), states[f"{name}.angular_velocity"]
    return np.einsum("nij,nj->ni", r, moments * np.einsum("nji,nj->ni", r, w))


def energy(states, name, mass, moments, g=0.0):
    spin = 0.5 * (spin_momentum(states, name, moments) * states[f"{name}.angular_velocity"]).sum(axis=1)
    moving = 0.5 * mass * (states[f"{name}.velocity"] ** 2).sum(axis=1)
    return spin + moving + mass * g * states[f"{name}.position"][:, 2]


def test_v7_free_body_keeps_momentum_and_energy():
    """Dojo: free block, w = (10, 10, 10), v = (1, 2, 3), h = .01, 5 s. Energy error is of order 3."""
    world = World((Body("block", 1.0, INERTIA),), gravity=WEIGHTLESS)
    drift = []
    for dt in (0.01, 0.005):
        start = {"block.velocity": [1, 2, 3], "block.angular_velocity": [10, 10, 10]}
        states = Lab(world, Scheme(dt=dt)).states(start, 5.0)
        turning = spin_momentum(states, "block", INERTIA)
        assert turning == pytest.approx(np.tile(turning[0], (len(turning), 1)), abs=1e-9)
        assert states["block.velocity"][-1] == pytest.approx([1, 2, 3], abs=1e-12)
        total = energy(states, "block", 1.0, np.array(INERTIA))
        drift.append(np.abs(total / total[0] - 1).max())
    assert drift[0] < 5e-3
    assert drift[1] < drift[0] / 4


def test_collisions_keep_linear_and_angular_momentum():
    """Two spinning dumbbells collide with friction: P and the total L about the origin do not change."""
    moments = np.array([0.03, 0.2, 0.2])
    bodies = [Body(name, mass, tuple(mass * moments), DUMBBELL) for name, mass in (("a", 1.0), ("b", 2.5))]
    lab = Lab(make_world(bodies, law=Law(0.6, 0.7), gravity=WEIGHTLESS), Scheme(dt=0.002, sweeps=20))
    states = lab.states(
        {
            "a.position": [-1.2, 0.1, 0.0],
            "a.velocity": [2, 0, 0.1],
            "a.angular_velocity": [1, 2, 3],
            "b.position": [0.2, 0, 0.1],
            "b.angular_velocity": [0, -1, 4],
        },
        1.0,
    )
    masses = {"a": 1.0, "b": 2.5}
    linear = sum(m * states[f"{n}.velocity"] for n, m in masses.items())
    angular = sum(
        m * np.cross(states[f"{n}.position"], states[f"{n}.velocity"]) + spin_momentum(states, n, m * moments)
        for n, m in masses.items()
    )
    assert np.abs(states["a.velocity"][-1] - states["a.velocity"][0]).max() > 0.1
    assert linear == pytest.approx(np.tile(linear[0], (len(linear), 1)), abs=1e-12)
    # arms are taken where the free paths touch: exact but for the quadratic path of a turning point
    assert angular == pytest.approx(np.tile(angular[0], (len(angular), 1)), abs=2e-4)


@pytest.mark.slow
def test_ball_hits_floating_body_with_the_right_total():
    """SimBenchmark: a 10 kg ball at 5 m/s, total momentum 50 N s before, during and after."""
    bodies = [Body.ball("ball", 0.2, 10.0), Body("float", 4.0, (0.3, 0.2, 0.1), DUMBBELL)]
    lab = Lab(make_world(bodies, law=Law(0.5, 0.8), gravity=WEIGHTLESS), Scheme())
    states = lab.states({"ball.position": [-2, 0, 0.1], "ball.velocity": [5, 0, 0]}, 1.0)
    total = 10 * states["ball.velocity"] + 4 * states["float.velocity"]
    assert total == pytest.approx(np.tile([50, 0, 0], (len(total), 1)), abs=1e-9)
    assert np.abs(states["float.velocity"][-1]).max() > 1


@pytest.mark.slow
def test_frictionless_elastic_impact_of_a_turning_body_keeps_energy():
    """One corner of a dumbbell at a time, e = 1, mu = 0."""
    moments = np.array([0.03, 0.2, 0.2])
    lab = Lab(make_world([Body("d", 1.0, tuple(moments), DUMBBELL)], [Plane.ground()], Law(0.0, 1.0)), Scheme(dt=0.002))
    states = lab.states({"d.position": [0, 0, 1.5], "d.angular_velocity": [0.3, 1.0, 0.5]}, 3.0)
    total = energy(states, "d", 1.0, moments, g=9.81)
    assert total == pytest.approx(np.full(len(total), total[0]), rel=2e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("mu", [0.3, 0.0])
def test_v12_corner_impact_converges_at_second_order(mu):
    """A turning compound hits the ground: halving the step divides the error by about four."""
    world = make_world([Body("d", 1.0, (0.03, 0.2, 0.15), DUMBBELL)], [Plane.ground()], Law(mu, 0.8))
    start = {"d.position": [0, 0, 1.0], "d.velocity": [0.5, 0, 0], "d.angular_velocity": [0.5, 2.0, 1.0]}
    ends = {}
    for dt in (0.01, 0.005, 0.0025, 0.01 / 64):
        ends[dt] = Lab(world, Scheme(dt=dt, sweeps=30)).states(start, 0.6)["d.position"][-1]
    errors = [np.abs(ends[dt] - ends[0.01 / 64]).max() for dt in (0.01, 0.005, 0.0025)]
    assert errors[0] < 5e-4
    assert errors[2] < errors[0] / 8


@pytest.mark.slow
def test_compound_comes_to_rest_and_stays():
    """Four spheres in a square, dropped turned: at rest on all four, not moving, not drifting."""
    feet = tuple(Sphere(0.1, (x, y, 0.0)) for x in (-0.4, 0.4) for y in (-0.4, 0.4))
    world = make_world([Body("k", 1.0, (0.06, 0.06, 0.1), feet)], [Plane.ground()], Law(0.5, 0.3))
    tilt = np.array([np.cos(0.1), np.sin(0.1), 0, 0])
    states = Lab(world, Scheme()).states({"k.position": [0, 0, 0.6], "k.orientation": tilt}, 12.0)
    assert states["k.position"][-1, 2] == pytest.approx(0.1, abs=1e-9)
    assert np.abs(states["k.velocity"][-200:]).max() < 1e-9
    moved = states["k.position"][-1] - states["k.position"][-201]
    assert np.abs(moved).max() < 1e-9


@pytest.mark.slow
def test_warm_start_carries_a_stack():
    """At four sweeps a stack of five stands with it and sags without it."""
    balls = [Body.ball(f"s{i}", 0.2, 1.0) for i in range(5)]
    world = make_world(balls, [Plane.ground()], Law(0.5, 0.0))
    near = {f"s{i}-s{i + 1}" for i in range(5)} | {"s0-ground"}
    world = World(world.bodies, world.statics, tuple(p for p in world.pairs if p.name in near))
    start = {f"s{i}.position": [0, 0, 0.2 + 0.4 * i] for i in range(5)}
    sag = {}
    for warm in (True, False):
        scheme = Scheme(sweeps=4, position_sweeps=1, push_out=0.2, warm_start=warm)
        sag[warm] = 1.8 - Lab(world, scheme).states(start, 3.0)["s4.position"][-1, 2]
    assert sag[True] < 1e-4
    assert sag[False] > 10 * sag[True]


@pytest.mark.parametrize("angle", [1e-9, 0.5, 3.0, 3.2, 7.0, 25.0, 2000.0])
def test_a_rotation_of_any_angle_is_one(angle):
    """Also of several turns in a step."""
    axis = np.array([1, -2, 0.5]) / np.sqrt(5.25)
    q = np.array(rotation.exponential(ca.DM(angle * axis))).ravel()
    exact = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    assert min(np.abs(q - exact).max(), np.abs(q + exact).max()) < 1e-11


def test_a_ball_may_spin_faster_than_a_turn_a_step():
    """1000 rad/s at 10 ms: it hops off as one with its spin does, and orientations stay unit quaternions."""
    lab = Lab(make_world([Body.ball("b", 0.1, 1.0)], [Plane.ground()], Law(0.1, 0.5)), Scheme())
    states = lab.states({"b.position": [0, 0, 0.3], "b.angular_velocity": [0, 1000.0, 30.0]}, 1.0)
    assert np.linalg.norm(states["b.orientation"], axis=1) == pytest.approx(1, abs=1e-10)
    fall = np.sqrt(2 * 9.81 * 0.2)
    assert states["b.velocity"][30, 0] == pytest.approx(0.1 * 1.5 * fall, rel=1e-9)
