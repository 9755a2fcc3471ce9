"""What stands and what slips: grooves, ladders, leaning planks, arches, pencils, chains. Statics in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, final
from tools.laboratory import Lab
from tools.repeats import few, first
from worlds.blocks import turned_by

from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, make_world


@first("dt", [0.01, 0.0025])
@pytest.mark.parametrize(("left", "right"), [(0.5, 0.5), (0.3, 0.9), (1.2, 0.2)])
def test_ball_in_a_groove(left: float, right: float, dt: float) -> None:
    """Lami: smooth walls whose normals lean by a and b: N_a = m g sin(b) / sin(a + b); by a too."""
    a, r, mass = ca.SX.sym("a"), 0.1, 2.0
    walls = [
        Plane("left", (ca.sin(a), 0, ca.cos(a)), 0.0),
        Plane("right", (-np.sin(right), 0, np.cos(right)), 0.0),
    ]
    lab = Lab(make_world([Body.ball("b", r, mass)], walls, Law(0.0)), Scheme(dt=dt), parameters=[a])

    def start(z: Any) -> dict[str, Any]:
        """At r from both: n . p = r."""
        n = ca.vertcat(ca.horzcat(ca.sin(z[0]), ca.cos(z[0])), ca.DM([[-np.sin(right), np.cos(right)]]))
        p = ca.solve(n, ca.DM([r, r]))
        return {"b.position": ca.vertcat(p[0], 0, p[1])}

    names = ["b-left.force", "b-right.force"]
    value, slope = final(lab, start, 0.3, names, [left], lambda z: z)
    weight, s, c = mass * G, np.sin(left + right), np.cos(left + right)
    loads = weight * np.array([np.sin(right), np.sin(left)]) / s
    # of the force's component along x and z, and its change with a
    dn = weight * np.array([-np.sin(right) * c, np.cos(left) * s - np.sin(left) * c]) / s**2
    n = np.array([[np.sin(left), np.cos(left)], [-np.sin(right), np.cos(right)]])
    expected = loads[:, None] * n
    turned = dn[:, None] * n + loads[:, None] * [[np.cos(left), -np.sin(left)], [0, 0]]
    assert value.reshape(2, 3)[:, [0, 2]] == pytest.approx(expected, abs=1e-9)
    assert slope.reshape(2, 3)[:, [0, 2]] == pytest.approx(turned, abs=1e-9)


def ladder(mu_floor: float, mu_wall: float) -> Lab:
    """A uniform ladder of length 2 along its x, its ends points: floor z = 0, wall x = 0 on its left."""
    ends = tuple(Sphere(0.0, (s, 0, 0)) for s in (-1.0, 1.0))
    body = Body("ladder", 10.0, (0.1, 10 / 3, 10 / 3), ends)
    world = make_world([body], [Plane.ground(), Plane("wall", (1.0, 0, 0), 0.0)])
    laws = {(1, 0): Law(mu_floor), (0, 1): Law(mu_wall)}
    pairs = tuple(
        replace(p, law=laws[p.first.shape, p.second.shape])
        for p in world.pairs
        if (p.first.shape, p.second.shape) in laws
    )
    return Lab(replace(world, pairs=pairs), Scheme(sweeps=30))


@pytest.mark.slow
@few(("mu_floor", "mu_wall"), [(0.4, 0.0), (0.4, 0.3), (0.25, 0.8)], 1)
@few("over", [0.98, 1.02], 1)
def test_ladder_against_a_wall(mu_floor: float, mu_wall: float, over: float) -> None:
    """Both ends on the point of slipping: it stands iff tan(theta) >= (1 - mu_f mu_w) / (2 mu_f), from the floor."""
    theta = float(np.arctan(over * (1 - mu_floor * mu_wall) / (2 * mu_floor)))
    start = {
        "ladder.position": [np.cos(theta), 0, np.sin(theta)],
        "ladder.orientation": turned_by((0, 1, 0), theta),
    }
    states = ladder(mu_floor, mu_wall).states(start, 1.0)
    away = states["ladder.position"][-1, 0] - np.cos(theta)
    if over > 1:
        assert abs(away) < 1e-6
        assert np.abs(states["ladder.velocity"]).max() < 1e-6
    else:
        assert away > 0.02


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
def test_ladder_slides_down_smooth_walls(dt: float) -> None:
    """Energy: theta'^2 = 3 g / L (sin(theta0) - sin(theta)) for a length L; it leaves the wall at 2/3 sin(theta0)."""
    theta = 1.2
    lab = ladder(0.0, 0.0)
    lab = Lab(lab.world, Scheme(dt=dt))
    start = {"ladder.position": [np.cos(theta), 0, np.sin(theta)], "ladder.orientation": turned_by((0, 1, 0), theta)}
    states = lab.states(start, 1.2)
    q, w = states["ladder.orientation"], states["ladder.angular_velocity"][:, 1]
    now = 2 * np.arctan2(q[:, 2], q[:, 0])
    wall = np.abs(states["ladder[0]-wall.force"]).max(axis=1)
    left = int(np.flatnonzero(wall[2:] < 1e-9)[0]) + 2
    square = 1.5 * G * (np.sin(theta) - np.sin(now[:left]))
    assert w[:left] ** 2 == pytest.approx(square, abs=2 * dt**2)
    # to the step in which it leaves, w dt cos(theta) long
    assert np.sin(now[left]) == pytest.approx(2 / 3 * np.sin(theta), abs=1.8 * dt)


def pencil(dt: float, mu: float) -> Lab:
    """A thin rod of length 1 on its point."""
    body = Body("pencil", 1.0, (1 / 12, 1 / 12, 1e-3), (Sphere(0.0, (0, 0, -0.5)),))
    return Lab(make_world([body], [Plane.ground()], Law(mu)), Scheme(dt=dt))


@first("dt", [0.01, 0.0025])
def test_pencil_falls_about_its_point(dt: float) -> None:
    """Cross 2006: N / m g = (1 - 3 cos)^2 / 4 and F / m g = 3/4 sin (3 cos - 2) from upright, until the point slips."""
    tilt = 0.05
    start = {
        "pencil.position": [0.5 * np.sin(tilt), 0, 0.5 * np.cos(tilt)],
        "pencil.orientation": turned_by((0, 1, 0), tilt),
    }
    states = pencil(dt, 5.0).states(start, 0.9)
    q, w = states["pencil.orientation"], states["pencil.angular_velocity"][:, 1]
    angle = 2 * np.arctan2(q[:, 2], q[:, 0])
    cos = np.cos(angle)
    # from rest at the tilt: w^2 = 3 g (cos(tilt) - cos) / l
    square = 3 * G * (np.cos(tilt) - cos)
    alpha = 1.5 * G * np.sin(angle)
    normal = G - 0.5 * (alpha * np.sin(angle) + square * cos)
    level = 0.5 * (alpha * cos - square * np.sin(angle))
    force = states["pencil-ground.force"]
    last = np.flatnonzero(normal < 1.0)
    last = last[0] if last.size else len(normal)
    assert w[:last] ** 2 == pytest.approx(square[:last], abs=10 * dt**2)
    # forces are those of the middle of the last step
    assert force[2:last, 2] == pytest.approx(normal[2:last], abs=15 * dt)
    assert force[2:last, 0] == pytest.approx(level[2:last], abs=15 * dt)
