"""Impacts of bodies that touch something else: on the ground while they hit a wall, two walls within one step."""

from __future__ import annotations

from math import cos, radians, sin

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import few, first

from symphys.model.shapes import Plane
from symphys.model.world import Body, Law, Pair, Scheme, World, make_world

RADIUS = 0.0286


def billiard(cushion: Law) -> World:
    """A ball on cloth, and a cushion at x = 1."""
    planes = [Plane.ground(), Plane("cushion", (-1.0, 0, 0), -1.0)]
    world = make_world([Body.ball("ball", RADIUS, 0.17)], planes)
    ground, wall = world.pairs
    pairs = (Pair("floor", ground.first, ground.second, Law(0.2)), Pair("side", wall.first, wall.second, cushion))
    return World(world.bodies, world.statics, pairs)


def rolling_into(cushion: Law, dt: float, split: bool) -> ca.Function:
    """Start along x -> (x, its slope, velocity) 0.6 s after the hit; rolling at 1 m/s."""
    lab = Lab(billiard(cushion), Scheme(dt=dt, cuts=int(split)))
    z = ca.MX.sym("z")
    start = {
        "ball.position": ca.vertcat(z, 0, RADIUS),
        "ball.velocity": [1.0, 0, 0],
        "ball.angular_velocity": [0, 1 / RADIUS, 0],
    }
    end = lab.trajectory(start, 1.6)[:, -1]
    x = end[lab.layout["ball.position"]][0]
    return ca.Function("end", [z], [x, ca.gradient(x, z), end[lab.layout["ball.velocity"]][0]])


def after_cushion(friction: float, e: float = 0.8) -> float:
    """The speed at which the ball rolls in the end.

    The cushion turns 1 m/s into -e and, by friction up or down at its face, takes friction (1 + e) of velocity's worth
    of spin; then the cloth makes it roll: 5/7 of what velocity is left and 2/7 of what spin is left.
    """
    spin = 1 - 2.5 * friction * (1 + e)
    return -5 / 7 * e + 2 / 7 * spin


@pytest.mark.slow
@few("friction", [0.0, 0.1], 1)
@first("dt", [0.01, 0.0025])
def test_a_rolling_ball_comes_back_from_a_cushion(friction, dt):
    """Its final speed in closed form; the slope of its final place by its start is that speed too, to order dt."""
    end = rolling_into(Law(friction, 0.8), dt, split=True)
    expected = after_cushion(friction)
    starts = np.linspace(0, 2 * dt, 41)
    places, slopes, speeds = (np.array([float(v) for v in column]) for column in zip(*map(end, starts), strict=True))
    assert speeds == pytest.approx(expected, abs=1e-9)
    assert slopes == pytest.approx(expected, abs=1.5 * dt)
    assert np.diff(places) == pytest.approx(expected * (starts[1] - starts[0]), abs=0.3 * dt * dt)


def test_a_rolling_ball_needs_the_split():
    """As if the blow had come at the start of its step: wrong slope, at any step size."""
    for dt in (0.01, 0.0025):
        _, slope, _ = rolling_into(Law(0.0, 0.8), dt, split=False)(0.0003)
        assert abs(float(slope) - after_cushion(0.0)) > 0.3


@few("beside", [-1e-9, -1e-12, 0.0, 1e-12, 1e-9], 2)
def test_a_hit_at_the_end_of_a_step_keeps_its_slope(beside):
    """Round numbers in a file bring it about: half a metre at 1 m/s."""
    _, slope, _ = rolling_into(Law(0.1, 0.8), 0.01, split=True)(0.5 - RADIUS + beside)
    assert float(slope) == pytest.approx(after_cushion(0.1), abs=0.015)


@pytest.mark.parametrize("gap", [-9e-13, -1e-16, 0.0, 9e-13])
@pytest.mark.parametrize("dt", [0.01, 1e-5])
def test_a_hit_on_the_boundary_of_two_steps_is_an_impact(gap, dt):
    """On whichever side of 0 rounding has put the gap: Newton's rebound, and the slope of what it leads to."""
    lab = Lab(billiard(Law(0.0, 0.8)), Scheme(dt=dt))
    z = ca.MX.sym("z")
    start = {"ball.position": ca.vertcat(1 - RADIUS - z, 0, RADIUS), "ball.velocity": [0.5, 0, 0]}
    end = lab.trajectory(start, 2 * dt)[:, -1]
    along = end[lab.layout["ball.position"]][0]
    asked = ca.Function("asked", [z], [end[lab.layout["ball.velocity"]][0], ca.gradient(along, z)])
    velocity, slope = map(float, asked(gap))
    assert velocity == pytest.approx(-0.4, abs=0.2 * 9.81 * 3 * dt)  # the cloth acts too
    assert slope == pytest.approx(0.8, abs=0.05)


def wedge(angle: float, e: float) -> World:
    """Two walls whose normals are ``angle`` apart."""
    half = radians(angle / 2)
    walls = [Plane("left", (sin(half), 0, cos(half)), 0.0), Plane("right", (-sin(half), 0, cos(half)), 0.0)]
    return make_world([Body.ball("ball", 0.1, 1.0)], walls, Law(0.0, e), gravity=(0, 0, 0))


def exact_wedge(world: World, start: tuple[float, float], speed: float, time: float, e: float) -> np.ndarray:
    """Position and velocity (4,), from impact to impact."""
    p, v, now = np.array(start), np.array([0.0, -speed]), 0.0
    normals = [np.array(plane.normal)[[0, 2]] for plane in world.statics]
    while True:
        ahead = [(max((n @ p - 0.1) / -(n @ v), 0.0), n) for n in normals if n @ v < -1e-12]
        wait, n = min(ahead, key=lambda pair: pair[0], default=(np.inf, None))
        if n is None or now + wait > time:
            return np.concatenate([p + v * (time - now), v])
        p, now = p + v * wait, now + wait
        v = v - (1 + e) * (n @ v) * n


@pytest.mark.parametrize("offset", [0.002, 0.005])
@pytest.mark.parametrize("angle", [100, 120])
def test_two_walls_within_one_step(angle, offset):
    """Hits 1.6 to 5 ms apart in steps of 10 ms are taken one after the other."""
    world = wedge(angle, 0.8)
    lab = Lab(world, Scheme(dt=0.01))
    states = lab.states({"ball.position": [offset, 0, 1.0], "ball.velocity": [0, 0, -2.0]}, 0.7)
    got = np.concatenate([states["ball.position"][-1, [0, 2]], states["ball.velocity"][-1, [0, 2]]])
    assert got == pytest.approx(exact_wedge(world, (offset, 1.0), 2.0, 0.7, 0.8), abs=1e-9)
