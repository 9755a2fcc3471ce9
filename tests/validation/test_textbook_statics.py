"""What stands and what slips: grooves, ladders, leaning planks, arches, pencils, chains. Statics in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from blocks import turned_by
from laboratory import Lab
from scipy.optimize import linprog
from textbook import Array, G, final

from symphys.shapes import Box, Fixture, Plane, Sphere
from symphys.world import Body, Law, Scheme, World, make_world


@pytest.mark.parametrize("dt", [0.01, 0.0025])
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


@pytest.mark.parametrize(("mu_floor", "mu_wall"), [(0.4, 0.0), (0.4, 0.3), (0.25, 0.8)])
@pytest.mark.parametrize("over", [0.98, 1.02])
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


@pytest.mark.parametrize("dt", [0.01, 0.0025])
def test_ladder_slides_down_smooth_walls(dt: float) -> None:
    """Energy: theta'^2 = 3 g / L (sin(theta0) - sin(theta)) with L the length; it leaves the wall at 2/3 sin(theta0)."""
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


@pytest.mark.parametrize("dt", [0.01, 0.0025])
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


def arch(count: int, thick: float, dt: float = 0.01) -> tuple[Lab, dict[str, Any], Array, Array]:
    """A half-round arch of equal voussoirs of mean radius 1, its start, its joints' angles (count + 1,), and weights.

    Each side face of a voussoir is that of a thin slab on it; it meets the slab of its neighbour and nothing else.
    """
    mu, part = ca.SX.sym("mu"), np.pi / count
    slab, halves = 0.02, (0.02, 0.2, thick / 2)
    bodies, start, weights = [], dict[str, Any](), []
    for k in range(count):
        faces = []
        for side in (-1, 1):
            # in the body's frame z is outward, x along the arch; the face lies at the edge of the part
            lean = side * part / 2
            outward, along = np.array([np.sin(lean), 0, np.cos(lean)]), np.array([np.cos(lean), 0, -np.sin(lean)])
            centre = outward - side * slab * along - [0, 0, 1]
            faces.append(Box(halves, tuple(centre), tuple(turned_by((0, 1, 0), lean))))
        bodies.append(Body(f"v{k}", 1.0, (0.02, 0.03, 0.03), tuple(faces)))
        angle = -np.pi / 2 + part * (k + 0.5)
        start[f"v{k}.position"] = [np.sin(angle), 0, np.cos(angle)]
        start[f"v{k}.orientation"] = turned_by((0, 1, 0), angle)
        weights.append(G)
    world = make_world(bodies, [Plane.ground()], Law(mu))
    springs = {(0, 0), (count - 1, 1)}
    pairs = tuple(
        p
        for p in world.pairs
        if (
            (p.first.body, p.first.shape) in springs
            if p.second.body is None
            else (p.second.body - p.first.body, p.first.shape, p.second.shape) == (1, 1, 0)
        )
    )
    lab = Lab(World(world.bodies, world.statics, pairs), Scheme(dt=dt, sweeps=40, cuts=0), parameters=[mu])
    return lab, start, -np.pi / 2 + part * np.arange(count + 1), np.array(weights)


def can_stand(count: int, thick: float, mu: float) -> bool:
    """Limit analysis (Heyman 1966; with friction Livesley 1978): whether forces within the cones balance every block.

    At each joint a normal and a tangential force at either edge; a linear programme.
    """
    part = np.pi / count
    joints = -np.pi / 2 + part * np.arange(count + 1)
    balance, load = np.zeros((3 * count, 4 * (count + 1))), np.zeros(3 * count)
    for j, angle in enumerate(joints):
        out, along = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
        for edge, radius in enumerate((1 - thick / 2, 1 + thick / 2)):
            for kind, force in enumerate((along, out)):
                for block, sign in ((j, 1), (j - 1, -1)):
                    if 0 <= block < count:
                        column = 4 * j + 2 * edge + kind
                        point, f = radius * out, sign * force
                        balance[3 * block : 3 * block + 2, column] = f
                        balance[3 * block + 2, column] = point[0] * f[1] - point[1] * f[0]
    for block in range(count):
        angle = joints[block] + part / 2
        load[3 * block + 1], load[3 * block + 2] = G, np.sin(angle) * G
    cone = np.zeros((4 * (count + 1), 4 * (count + 1)))
    for i in range(2 * (count + 1)):
        cone[2 * i, 2 * i : 2 * i + 2] = [-mu, 1]
        cone[2 * i + 1, 2 * i : 2 * i + 2] = [-mu, -1]
    bounds = [(0, None), (None, None)] * (2 * (count + 1))
    n = 4 * (count + 1)
    return bool(linprog(np.zeros(n), cone, np.zeros(n), balance, load, bounds).status == 0)


@pytest.mark.parametrize("thick", [0.05, 0.3])
def test_arch(thick: float) -> None:
    lab, start, _, _ = arch(5, thick)
    for mu in (0.1, 0.2, 0.3, 0.35, 0.4, 0.5, 0.7):
        states = lab.states(start, 1.0, p=[mu])
        fallen = start["v2.position"][2] - states["v2.position"][-1, 2]
        print(
            thick,
            mu,
            can_stand(5, thick, mu),
            fallen,
            max(np.abs(states[f"v{k}.velocity"][-1]).max() for k in range(5)),
        )
