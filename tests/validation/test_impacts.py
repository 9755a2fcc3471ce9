"""Values and gradients through impacts, against published answers; cases V1 to V5."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab, value_and_gradient

from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, make_world

ELASTIC = Law(friction=0.0, restitution=1.0)
WEIGHTLESS = (0.0, 0.0, 0.0)


def floor_world(law, gravity=WEIGHTLESS, radius=0.1):
    return make_world([Body("ball", 1.0, 0.4 * 0.1**2, (Sphere(radius),))], [Plane.ground()], law, gravity)


def height(lab, z, v, time, x=0.0, vx=0.0, **more):
    values = {"ball.position": ca.vertcat(x, 0, z), "ball.velocity": ca.vertcat(vx, 0, v)}
    return lab.trajectory(values, time, **more)[lab.layout["ball.position"], -1][2]


def test_v1_bounce_once():
    """Zhong, Han, Brikis 2022, task 1: y(T) = 1.2, dy/dy0 = -1, dy/dvy0 = -1, first force -(T - dt/2) dt / m."""
    ball = Lab(floor_world(ELASTIC), Scheme(dt=1 / 480), inputs=["ball.force"])

    def final(z):
        first = ca.vertcat(0, 0, z[2])
        return height(ball, z[0], z[1], 1.0, x=-1, vx=2, u=ca.horzcat(first, ca.DM.zeros(3, 479)))

    value, slope = value_and_gradient(final, [1.0, -2.0, 0.0])
    assert value[0] == pytest.approx(1.2, abs=1e-9)
    assert slope[0, :2] == pytest.approx([-1, -1], abs=1e-9)
    assert slope[0, 2] == pytest.approx(-2.081163e-3, abs=1e-7)


@pytest.mark.parametrize("dt", [0.01, 0.001])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_v2_dropped_ball(dt, radius):
    """One parabola, v' = -e v, another parabola: z(T) and its slopes in closed form."""
    ball = Lab(floor_world(Law(0.0, 0.8), gravity=(0, 0, -9.81), radius=radius), Scheme(dt=dt))
    value, slope = value_and_gradient(lambda z: height(ball, z[0], z[1], 1.2) - radius, [1.0 + radius, 0.5])
    assert value[0] == pytest.approx(0.110344433, abs=1e-6)
    assert slope[0] == pytest.approx([1.951710, 0.430603], abs=1e-6)


def test_v2_needs_the_time_of_impact():
    """Velocity stepping without it gives a gradient that is wrong by a factor, at any step size."""
    ball = Lab(floor_world(Law(0.0, 0.8), gravity=(0, 0, -9.81)), Scheme(dt=0.001, time_of_impact=False))
    _, slope = value_and_gradient(lambda z: height(ball, z[0], z[1], 1.2), [1.1, 0.5])
    assert abs(slope[0, 0] - 1.951710) > 0.5


def test_v3_two_balls_gradient():
    """Zhong, Han, Brikis 2022, task 3: J(guess) and its slopes in the two positions, per axis."""
    balls = [Body.ball("a", 0.2, 1.0), Body.ball("b", 0.2, 1.0)]
    world = make_world(balls, law=ELASTIC, gravity=WEIGHTLESS)
    pair = Lab(world, Scheme(dt=1 / 480), inputs=["a.force"])
    push = ca.vertcat(3 * ca.DM.ones(2, 480), ca.DM.zeros(1, 480))

    def objective(z):
        values = {"a.position": ca.vertcat(z[0:2], 0), "b.position": ca.vertcat(z[2:4], 0)}
        return ca.sumsqr(pair.trajectory(values, 1.0, u=push)[pair.layout["b.position"], -1])

    value, slope = value_and_gradient(objective, [-2.0, -2.0, -1.0, -1.0])
    assert value[0] + 0.1 * 18 == pytest.approx(2.05915, abs=1e-4)
    assert slope[0] == pytest.approx([-0.39867, -0.39867, -0.32125, -0.32125], abs=1e-3)


@pytest.mark.parametrize("start", [0.5, 0.6111, 0.61115, 0.8])
def test_v4_sawtooth(start):
    """DiffTaichi, rigid_body_toi: y(T) = 1.012 - y0 with slope -1, also between neighbouring steps."""
    ball = Lab(floor_world(ELASTIC), Scheme(dt=0.002))
    value, slope = value_and_gradient(lambda z: height(ball, z[0], -2.0, 0.406, vx=-1), [start])
    assert value[0] == pytest.approx(1.012 - start, abs=1e-9)
    assert slope[0, 0] == pytest.approx(-1, abs=1e-9)


def test_v4_no_sawtooth_when_zoomed():
    """201 starts within 1e-4: the result falls on a line, with and without smoothing."""
    ball = Lab(floor_world(ELASTIC), Scheme(dt=0.002))
    z, smoothing = ca.MX.sym("z"), ca.MX.sym("s")
    final = ca.Function("f", [z, smoothing], [height(ball, z, -2.0, 0.406, vx=-1, smoothing=smoothing)])
    starts = 0.6 + np.linspace(0, 1e-4, 201)
    for smoothing, tolerance in ((0.0, 1e-9), (0.01, 1e-6)):
        values = np.array(final.map(201)(starts, smoothing)).ravel()
        assert np.abs(values + starts - (values + starts)[0]).max() < tolerance


@pytest.mark.parametrize("dt", [0.1, 0.01])
@pytest.mark.parametrize("start", [0.05, 1.0, 1.99, 2.01, 3.0])
def test_v5_toss(dt, start):
    """DiffMJX: a point mass on an elastic floor, q(T) = |q0 - 2|."""
    point = Lab(floor_world(ELASTIC, radius=0.0), Scheme(dt=dt))
    value, slope = value_and_gradient(lambda z: height(point, z[0], -1.0, 2.0), [start])
    assert value[0] == pytest.approx(abs(start - 2), abs=1e-9)
    assert slope[0, 0] == pytest.approx(np.sign(start - 2), abs=1e-9)


def oblique_bounces(mu, e, gravity, v, w, radius, time):
    """A solid sphere above z = 0 from (0, 0, 1): flights and impacts one after the other (event driven)."""
    gravity, v, w = (np.array(a, float) for a in (gravity, v, w))
    p, arm, k = np.array([0, 0, 1.0]), np.array([0, 0, -radius]), 1 + 2.5
    while True:
        fall = (-v[2] - np.sqrt(v[2] ** 2 - 2 * gravity[2] * (p[2] - radius))) / gravity[2]
        flight = min(fall, time)
        p, v, time = p + v * flight + gravity * flight**2 / 2, v + gravity * flight, time - flight
        if fall > flight or time <= 0:
            return p, v, w
        normal = -(1 + e) * v[2]
        friction = -(v + np.cross(w, arm)) * [1, 1, 0] / k
        friction *= min(1, mu * normal / np.linalg.norm(friction))
        v = v + friction + [0, 0, normal]
        w = w + np.cross(arm, friction) / (0.4 * radius**2)


@pytest.mark.parametrize("mu", [0.05, 0.2, 1.0])
def test_spinning_ball_bounces_with_friction(mu):
    """Slipping and sticking impacts of a spinning ball on an incline, to rounding at dt = 0.01."""
    gravity, v, w = (3.0, 0.0, -9.0), (0.5, -0.3, 0.0), (30.0, 60.0, 7.0)
    ball = Lab(floor_world(Law(mu, 0.8), gravity), Scheme())
    last = ball.states({"ball.position": [0, 0, 1], "ball.velocity": v, "ball.angular_velocity": w}, 1.5)
    position, velocity, spin = oblique_bounces(mu, 0.8, gravity, v, w, 0.1, 1.5)
    assert last["ball.position"][-1] == pytest.approx(position, abs=1e-12)
    assert last["ball.velocity"][-1] == pytest.approx(velocity, abs=1e-12)
    assert last["ball.angular_velocity"][-1] == pytest.approx(spin, abs=1e-10)


def test_balls_collide_like_billiards():
    """Elastic, equal masses, oblique: the target leaves along the line of centres, the two at a right angle."""
    balls = [Body.ball("a", 0.1, 1.0), Body.ball("b", 0.1, 1.0)]
    pair = Lab(make_world(balls, law=ELASTIC, gravity=WEIGHTLESS), Scheme())
    offset = 0.1
    states = pair.states({"a.position": [-1, 0, 0], "a.velocity": [3, 0, 0], "b.position": [0, offset, 0]}, 1.0)
    line = np.array([np.sqrt(0.2**2 - offset**2), offset, 0]) / 0.2
    assert states["b.velocity"][-1] == pytest.approx(3 * line[0] * line, abs=1e-12)
    assert states["a.velocity"][-1] == pytest.approx(np.array([3, 0, 0]) - 3 * line[0] * line, abs=1e-12)
    travelled = 1.0 - (1 - np.sqrt(0.2**2 - offset**2)) / 3
    assert states["b.position"][-1] == pytest.approx([0, offset, 0] + 3 * line[0] * line * travelled, abs=1e-12)
