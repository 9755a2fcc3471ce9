"""Rolling, sliding, resting, bouncing: closed forms of rigid bodies; cases V8, V10 and V11."""

from __future__ import annotations

import itertools
from functools import cache

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab, value_and_gradient
from tools.repeats import few

from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world

G = 9.81


def ball_world(law, radius=0.5, gravity=(0, 0, -G)):
    return make_world([Body.ball("ball", radius, 1.0)], [Plane.ground()], law, gravity)


@pytest.mark.slow
def test_v8_49_bouncing_balls_keep_their_energy():
    """SimBenchmark bouncing: 7 x 7 balls, r = .1, m = 10, e = 1, mu = 0, from 5 m, 20 s: E = 24034.5 J."""
    grid = [(i, j) for i in range(7) for j in range(7)]
    balls = [Body.ball(f"b{i}{j}", 0.1, 10.0) for i, j in grid]
    world = make_world(balls, [Plane.ground()], Law(0.0, 1.0))
    world = World(world.bodies, world.statics, tuple(p for p in world.pairs if p.second.body is None))
    states = Lab(world, Scheme(sweeps=4)).states({f"b{i}{j}.position": [i, j, 5.0] for i, j in grid}, 20.0)
    energy = sum(
        10 * G * states[f"{b.name}.position"][:, 2] + 5 * (states[f"{b.name}.velocity"] ** 2).sum(axis=1) for b in balls
    )
    assert energy == pytest.approx(24034.5, rel=1e-9)


@pytest.mark.parametrize("dt", [0.01, 0.001])
def test_v10_sliding_ball_starts_to_roll(dt):
    """Uniform sphere: rolls at v = 5/7 v0 from t = 2 v0 / (7 mu g) on."""
    mu, v0, time = 0.3, 3.0, 2.0
    ball = Lab(ball_world(Law(mu, 0.0)), Scheme(dt=dt))

    def final(z):
        values = {"ball.position": [0, 0, 0.5], "ball.velocity": ca.vertcat(z[0], 0, 0)}
        last = ball.trajectory(values, time)[:, -1]
        return ca.vertcat(*(last[ball.layout[f"ball.{name}"]] for name in ("velocity", "angular_velocity", "position")))

    value, slope = value_and_gradient(final, [v0])
    rolls = 2 * v0 / (7 * mu * G)
    assert value[[0, 4]] == pytest.approx([5 / 7 * v0, 5 / 7 * v0 / 0.5], abs=1e-6)
    assert slope[[0, 4], 0] == pytest.approx([5 / 7, 5 / 7 / 0.5], abs=1e-6)
    assert value[6] == pytest.approx(v0 * rolls - mu * G * rolls**2 / 2 + 5 / 7 * v0 * (time - rolls), abs=5e-6)


def tripod(law, gravity=(0, 0, -G)):
    """A block on three feet."""
    feet = tuple(Sphere(0.1, (0.3 * np.cos(a), 0.3 * np.sin(a), 0.0)) for a in np.arange(3) * 2 * np.pi / 3)
    return make_world([Body("block", 1.0, (0.05, 0.05, 0.08), feet)], [Plane.ground()], law, gravity)


@cache
def incline(mu):
    """The block on a slope: gravity is a parameter."""
    g = [ca.SX.sym(f"g{k}") for k in range(3)]
    return Lab(tripod(Law(mu, 0.0), tuple(g)), Scheme(), parameters=g)


@pytest.mark.slow
def test_v10_sliding_stops():
    """A block stops after v^2 / (2 mu g)."""
    block = Lab(tripod(Law(0.4, 0.0)), Scheme(sweeps=30))
    states = block.states({"block.position": [0, 0, 0.1], "block.velocity": [2, 0, 0]}, 1.5)
    assert states["block.position"][-1, 0] == pytest.approx(2**2 / (2 * 0.4 * G), abs=1e-4)
    assert np.abs(states["block.velocity"][-1]).max() < 1e-9


@few("heading", [0.0, 0.7, 2.0, 4.0], 2)
@few("share", [0.967, 0.998, 1.002, 1.547], 4)
def test_v10_incline_sticks_inside_the_cone(heading, share):
    """Sticks if and only if tan(slope) <= mu, in every direction: friction acts on the disc."""
    mu = 0.6
    slope = np.arctan(share * mu)
    gravity = G * np.array([*(np.sin(slope) * np.array([np.cos(heading), np.sin(heading)])), -np.cos(slope)])
    states = incline(mu).states({"block.position": [0, 0, 0.1]}, 2.0, p=gravity)
    if share < 1:
        assert np.linalg.norm(states["block.velocity"][-1]) < 1e-9
        assert np.linalg.norm(states["block.position"][-1, :2]) < 1e-4
    else:
        speed = 2 * G * (np.sin(slope) - mu * np.cos(slope))
        assert np.linalg.norm(states["block.velocity"][-1]) == pytest.approx(speed, abs=1e-3)


@pytest.mark.parametrize("e", [0.5, 0.8])
def test_v10_bounce_heights(e):
    """Dropped from h, the n-th rebound reaches h e^(2n); velocities at the passages give it exactly."""
    ball = Lab(ball_world(Law(0.0, e), radius=0.25), Scheme())
    states = ball.states({"ball.position": [0, 0, 1.25]}, 1.2)
    z, v = states["ball.position"][:, 2] - 0.25, states["ball.velocity"][:, 2]
    heights = z + v**2 / (2 * G)
    first = np.sqrt(2 / G)
    flights = first + np.concatenate([[0], np.cumsum(2 * first * e ** np.arange(1, 4))])
    time = np.arange(z.size) * 0.01
    for n, (begin, end) in enumerate(itertools.pairwise(flights), start=1):
        inside = (time > begin) & (time < min(end, 1.2))
        assert heights[inside] == pytest.approx(e ** (2 * n), abs=1e-9)


@pytest.mark.parametrize("frequency", [2.0, 10.0])
def test_v10_soft_contact_sags(frequency):
    """Catto's softness: a ball at rest sinks by g / (2 pi f)^2."""
    ball = Lab(ball_world(Law(0.3, 0.0, frequency=frequency)), Scheme())
    states = ball.states({"ball.position": [0, 0, 0.6]}, 6.0)
    assert 0.5 - states["ball.position"][-1, 2] == pytest.approx(G / (2 * np.pi * frequency) ** 2, abs=1e-6)
    assert np.abs(states["ball.velocity"][-1]).max() < 1e-9


def test_v10_backspin_stops_ball():
    """I w0 = m v0 r: slides v0^2 / (2 mu g) and stops with v = w = 0."""
    v0, mu, r = 3.0, 0.3, 0.5
    values = {
        "ball.position": [0, 0, r],
        "ball.velocity": [v0, 0, 0],
        "ball.angular_velocity": [0, -v0 * r / (0.4 * r**2), 0],
    }
    states = Lab(ball_world(Law(mu, 0.0)), Scheme()).states(values, 3.0)
    assert states["ball.position"][-1, 0] == pytest.approx(v0**2 / (2 * mu * G), abs=1e-5)
    assert np.abs(states["ball.velocity"][-1]).max() < 1e-9
    assert np.abs(states["ball.angular_velocity"][-1]).max() < 1e-9


def test_v11_projectile():
    """x = x_0 + v_0 t + a t^2 / 2."""
    ball = Lab(ball_world(Law()), Scheme())
    states = ball.states({"ball.position": [0, 0, 100], "ball.velocity": [1, 2, 3]}, 2.0)
    t = np.arange(201) * 0.01
    assert states["ball.position"] == pytest.approx(np.stack([t, 2 * t, 100 + 3 * t - G * t**2 / 2], axis=1), abs=1e-9)
    assert states["ball.velocity"][:, 2] == pytest.approx(3 - G * t, abs=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_v11_sphere_comes_to_rest(e):
    """A sphere of radius .25 dropped from 1 m rests at .25."""
    states = Lab(ball_world(Law(0.5, e), radius=0.25), Scheme()).states({"ball.position": [0, 0, 1.25]}, 4.0)
    assert states["ball.position"][-1, 2] == pytest.approx(0.25, abs=1e-6)
    assert np.abs(states["ball.velocity"][-1]).max() == 0


def test_torsional_friction_slows_the_spin():
    """Torque torsion * m g about the normal: w = w0 - torsion m g t / I, then rest."""
    ball = Lab(ball_world(Law(0.3, 0.0, torsion=0.02)), Scheme())
    states = ball.states({"ball.position": [0, 0, 0.5], "ball.angular_velocity": [0, 0, 3]}, 2.0)
    t = np.arange(201) * 0.01
    expected = np.maximum(3 - 0.02 * G / (0.4 * 0.25) * t, 0)
    assert states["ball.angular_velocity"][:, 2] == pytest.approx(expected, abs=2e-2)
    assert states["ball.angular_velocity"][:150, 2] == pytest.approx(expected[:150], abs=1e-12)
    assert states["ball.angular_velocity"][-1] == pytest.approx([0, 0, 0], abs=1e-12)


def test_rolling_friction_slows_a_rolling_ball():
    """Torque rolling * m g against the roll: a = rolling g / (7/5 r); stops after v0^2 / (2 a)."""
    ball = Lab(ball_world(Law(0.3, 0.0, rolling=0.02)), Scheme(sweeps=20))
    values = {"ball.position": [0, 0, 0.5], "ball.velocity": [1, 0, 0], "ball.angular_velocity": [0, 2, 0]}
    states = ball.states(values, 4.0)
    a = 0.02 * G / (1.4 * 0.5)
    assert states["ball.velocity"][:300, 0] == pytest.approx(1 - a * np.arange(300) * 0.01, abs=1e-9)
    assert states["ball.position"][-1, 0] == pytest.approx(1 / (2 * a), abs=1e-5)


@few("masses", [(1, 1, 1), (1, 8, 1), (1, 1, 1, 1, 8)], 1)
@few("e", [0.0, 0.5], 1)
def test_stacks_of_spheres_stand(masses, e):
    """Placed with gaps, dropped on each other: at rest at the right heights."""
    balls = [Body.ball(f"s{i}", 0.2, float(m)) for i, m in enumerate(masses)]
    world = make_world(balls, [Plane.ground()], Law(0.5, e))
    near = {f"s{i}-s{i + 1}" for i in range(len(masses))} | {"s0-ground"}
    world = World(world.bodies, world.statics, tuple(p for p in world.pairs if p.name in near))
    values = {f"s{i}.position": [0, 0, 0.2 + 0.4 * i + 0.3 * (1 + 0.3 * i)] for i in range(len(masses))}
    states = Lab(world, Scheme()).states(values, 5.0)
    for i in range(len(masses)):
        assert states[f"s{i}.position"][-1] == pytest.approx([0, 0, 0.2 + 0.4 * i], abs=1e-9)
        assert np.abs(states[f"s{i}.velocity"][-20:]).max() < 1e-9
