"""Impacts of boxes, capsules and terrain: convergence, closed forms, and that different shapes of one place agree."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tools.laboratory import Lab, value_and_gradient
from tools.repeats import few, first
from worlds.blocks import block, rod, turned_by
from worlds.meetings import matrix

from symphys.model.heightfield import Heightfield
from symphys.model.shapes import Box, Fixture, Plane, Static, Terrain
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

G = 9.81
CORNER = {
    "b.position": [0, 0, 0.6],
    "b.velocity": [0.5, 0, 0],
    "b.orientation": turned_by((5, 6, 2), 0.806),
    "b.angular_velocity": [0.5, 2.0, 1.0],
}


def falling_box(dt: float, mu: float, time_of_impact: bool = True) -> tuple[Array, Array]:
    """Position and orientation after one impact of a corner."""
    world = make_world([block("b", (0.2, 0.15, 0.1))], [Plane.ground()], Law(mu, 0.8))
    states = Lab(world, Scheme(dt=dt, sweeps=20, time_of_impact=time_of_impact)).states(CORNER, 0.4)
    return states["b.position"][-1], states["b.orientation"][-1]


@pytest.mark.thorough
@pytest.mark.parametrize("mu", [0.3, 0.0])
def test_v12_corner_impact_converges_at_second_order(mu: float) -> None:
    """A turning box: position and orientation against a fine step; without the time of impact it is worse by far."""
    fine = falling_box(0.01 / 32, mu)
    errors = np.array(
        [[np.abs(a - b).max() for a, b in zip(falling_box(dt, mu), fine, strict=True)] for dt in (0.01, 0.0025)]
    )
    assert errors[0, 0] < 1e-5
    assert errors[0, 1] < 1e-4
    assert (errors[1] < np.maximum(errors[0] / 8, 2e-7)).all()
    assert np.abs(falling_box(0.01, mu, time_of_impact=False)[0] - fine[0]).max() > 100 * errors[0, 0]


@pytest.mark.thorough
def test_v12_block_topples_about_its_edge() -> None:
    """Angle after half a second, against the pendulum that it is: two corners on the ground, friction holds them."""
    halves, tilt = (0.2, 0.3, 0.5), 0.5
    world = make_world([block("b", halves)], [Plane.ground()], Law(0.8, 0.0))
    edge = np.array([np.cos(tilt) * 0.2 - np.sin(tilt) * 0.5, 0, -np.sin(tilt) * 0.2 - np.cos(tilt) * 0.5])
    start = {"b.position": -edge, "b.orientation": turned_by((0, 1, 0), tilt)}
    square = 0.2**2 + 0.5**2
    inertia = 4 / 3 * square

    def fall(_: float, y: Array) -> list[float]:
        return [y[1], G * np.sqrt(square) * np.sin(y[0] - np.arctan(0.2 / 0.5)) / inertia]

    exact = solve_ivp(fall, (0, 0.5), [tilt, 0], rtol=1e-12, atol=1e-12).y[0, -1]
    errors = []
    for dt in (0.01, 0.005, 0.0025):
        q = Lab(world, Scheme(dt=dt, sweeps=30)).states(start, 0.5)["b.orientation"][-1]
        errors.append(abs(2 * np.arctan2(q[2], q[0]) - exact))
    assert errors[0] < 1e-6
    assert errors[2] < errors[0] / 4


BALL = Body.ball("b", 0.1, 1.0)


@cache
def bounced(static: Static) -> tuple[Array, Array]:
    """Final state of a spinning ball that bounces along, and its gradient by place and velocity."""
    lab = Lab(make_world([BALL], [static], Law(0.3, 0.8)), Scheme())

    def final(z: Any) -> Any:
        start = {"b.position": ca.vertcat(z[0], 0.02, z[1]), "b.velocity": ca.vertcat(z[2], 0.3, 0)}
        last = lab.trajectory(start | {"b.angular_velocity": [3.0, 4.0, 5.0]}, 1.2)[:, -1]
        return ca.vertcat(*(last[lab.layout[f"b.{name}"]] for name in ("position", "velocity", "angular_velocity")))

    return value_and_gradient(final, [0.03, 0.6, 0.7])


SLOPE = (0.3, -0.2)
NORMAL = np.array([-SLOPE[0], -SLOPE[1], 1]) / np.sqrt(1 + SLOPE[0] ** 2 + SLOPE[1] ** 2)
HEIGHTS = tuple(tuple(SLOPE[0] * x + SLOPE[1] * y for x in (-1.0, 0.0, 1.0, 2.0, 3.0)) for y in (-2.0, 0.0, 2.0))
SAME: dict[str, tuple[Static, Static]] = {
    "box": (Plane.ground(), Fixture("slab", Box((3.0, 3.0, 0.5), (0, 0, -0.5)))),
    "terrain": (Plane("slope", tuple(NORMAL)), Terrain("slope", lambda x, y: SLOPE[0] * x + SLOPE[1] * y)),
    "heightfield": (Plane("slope", tuple(NORMAL)), Terrain("slope", Heightfield(HEIGHTS, (1.0, 2.0), (-1.0, -2.0)))),
}


@few("name", SAME, 1)
def test_a_ball_bounces_alike_on_a_plane_and_on_what_is_one(name: str) -> None:
    """A static box's face, terrain with a constant slope, a grid of a plane's heights: value and gradient."""
    (plane, plane_slope), (other, other_slope) = (bounced(static) for static in SAME[name])
    assert other == pytest.approx(plane, abs=1e-9)
    assert other_slope == pytest.approx(plane_slope, abs=1e-9)
    assert np.abs(plane_slope).max() > 1


@pytest.mark.slow
@first("body", [rod("b", 0.1, 0.2), block("b", (0.2, 0.15, 0.1))])
def test_boxes_and_rods_tumble_alike_on_terrain(body: Body) -> None:
    places = []
    for static in SAME["terrain"]:
        lab = Lab(make_world([body], [static], Law(0.3, 0.5)), Scheme(sweeps=5))
        places.append(lab.states({"b.position": [0, 0, 0.6], "b.angular_velocity": [1, 2, 0.5]}, 0.6)["b.position"])
    assert places[1] == pytest.approx(places[0], abs=1e-9)


@first("dt", [0.01, 0.005])
def test_bead_in_a_valley_oscillates(dt: float) -> None:
    """Frictionless in z = x^2 / 2, where R = 1: its centre moves on a circle of R - r, T = 2 pi sqrt((R - r) / g)."""
    lab = Lab(make_world([BALL], [Terrain("valley", lambda x, y: x * x / 2)], Law(0.0, 0.0)), Scheme(dt=dt))
    at = 0.01
    start = np.array([at, 0, at * at / 2]) + 0.1 * np.array([-at, 0, 1]) / np.sqrt(1 + at * at)
    x = lab.states({"b.position": start}, 6.0)["b.position"][:, 0]
    down = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
    crossings = dt * (down + x[down] / (x[down] - x[down + 1]))
    assert np.diff(crossings) == pytest.approx(2 * np.pi * np.sqrt(0.9 / G), rel=2e-4)


def test_a_ball_rolls_over_the_edge_of_a_box() -> None:
    """Plane, then edge, then air: the same to 1 mm at any step; while it turns about the edge it does not slip."""
    ends = []
    for dt in (0.01, 0.0025):
        world = make_world([BALL], [Fixture("table", Box((1.0, 1.0, 0.5), (-1.0, 0, -0.5)))], Law(0.8, 0.0))
        start = {"b.position": [-0.2, 0, 0.1], "b.velocity": [0.5, 0, 0], "b.angular_velocity": [0, 5.0, 0]}
        states = Lab(world, Scheme(dt=dt)).states(start, 0.8)
        ends.append(states["b.position"][-1])
        energy = (states["b.velocity"] ** 2).sum(1) / 2 + 0.002 * (states["b.angular_velocity"] ** 2).sum(1)
        assert energy + G * states["b.position"][:, 2] == pytest.approx(0.125 + 0.05 + G * 0.1, abs=5e-3)
        assert states["b.velocity"][-1, 0] > 0.55
    assert ends[0] == pytest.approx(ends[1], abs=1e-3)


ASIDE = float(np.sqrt(1 - 0.15**2))
STRUCK = {
    "box": (
        Body("o", 2.0, (0.05, 0.04, 0.03), (Box((0.3, 0.2, 0.1)),)),
        ((0.15, 0.11, 1.0), (0, 0, -3), (0.15, 0.11, 0.1), (0, 0, 1)),
    ),
    "rod": (
        Body("o", 2.0, (0.01, 0.05, 0.05), rod("o", 0.1, 0.3).shapes),
        ((0.2, 1.0, 0.03), (0, -3, 0), (0.2, 0.1 * ASIDE, 0.015), (0, ASIDE, 0.15)),
    ),
}
"""A body; where a ball comes from, how fast, where it hits and the normal there."""


@pytest.mark.slow
@pytest.mark.parametrize("name", STRUCK)
def test_a_ball_hits_a_free_body_off_its_centre(name: str) -> None:
    """Elastic, frictionless: J = -2 n.v / (1/m + 1/M + (r x n) I^-1 (r x n)); momenta and energy follow."""
    other, (place, velocity, r, n) = STRUCK[name]
    lab = Lab(make_world([BALL, other], [], Law(0.0, 1.0), (0, 0, 0)), Scheme())
    states = lab.states({"b.position": place, "b.velocity": velocity}, 0.4)
    turn, moments = np.cross(r, n), np.array(other.inertia)
    impulse = -2 * np.dot(n, velocity) / (1 + 1 / 2 + turn @ (turn / moments))
    after = int(np.argmax(np.abs(states["o.velocity"]).max(axis=1) > 0))
    v_ball, v, w, q = (states[k][after] for k in ("b.velocity", "o.velocity", "o.angular_velocity", "o.orientation"))
    turning = matrix(q) @ (moments * (matrix(q).T @ w))
    assert v_ball == pytest.approx(velocity + impulse * np.array(n), abs=1e-9)
    assert v == pytest.approx(-impulse / 2 * np.array(n), abs=1e-9)
    assert turning == pytest.approx(-impulse * turn, abs=1e-9)
    assert (v_ball @ v_ball + 2 * v @ v + w @ turning) / 2 == pytest.approx(4.5, abs=1e-4)
