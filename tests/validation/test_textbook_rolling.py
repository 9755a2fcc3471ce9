"""Balls that roll and slide: inclines, billiards, grooves, turntables, planks. Textbook closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, differences, final
from tools.laboratory import Lab
from tools.repeats import few, first

from symphys.model.shapes import Box, Fixture, Plane, Terrain
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

R = 0.05


def incline(slope: Any, radius: float = R, hollow: bool = False, mu: float = 0.3, dt: float = 0.01) -> Lab:
    """A ball on z = 0 where gravity leans by ``slope``, a number or a symbol, to +x."""
    gravity = (G * ca.sin(slope), 0, -G * ca.cos(slope))
    world = make_world([Body.ball("b", radius, 1.0, hollow)], [Plane.ground()], Law(mu), gravity)
    return Lab(world, Scheme(dt=dt), parameters=[slope])


@first("dt", [0.01, 0.0025])
@pytest.mark.parametrize(("hollow", "share"), [(False, 5 / 7), (True, 3 / 5)])
def test_ball_rolls_down_an_incline(hollow: bool, share: float, dt: float) -> None:
    """Landau, Lifshitz: a = g sin(alpha) / (1 + I / m r^2), so 5/7 g sin(alpha) solid and 3/5 hollow; by alpha too."""
    alpha, time = 0.3, 1.0
    lab = incline(ca.SX.sym("alpha"), hollow=hollow, dt=dt)
    value, slope = final(
        lab, lambda z: {"b.position": [0, 0, R]}, time, ["b.velocity", "b.position"], [alpha], lambda z: z
    )
    a, da = share * G * np.sin(alpha), share * G * np.cos(alpha)
    assert value[[0, 3]] == pytest.approx([a * time, a * time**2 / 2], abs=1e-9)
    assert slope[[0, 3], 0] == pytest.approx([da * time, da * time**2 / 2], abs=1e-9)


@pytest.mark.parametrize("over", [0.98, 1.02, 1.5])
@pytest.mark.parametrize(("hollow", "most"), [(False, 7 / 2), (True, 5 / 2)])
def test_ball_rolls_as_long_as_friction_lasts(hollow: bool, most: float, over: float) -> None:
    """It rolls iff tan(alpha) <= (1 + m r^2 / I) mu; beyond, v' = g (sin - mu cos), w' = mu g cos m r / I."""
    mu, time, k = 0.2, 0.8, 2 / 3 if hollow else 2 / 5
    alpha = float(np.arctan(over * most * mu))
    lab = incline(ca.SX.sym("alpha"), hollow=hollow, mu=mu)
    states = lab.states({"b.position": [0, 0, R]}, time, p=[alpha])
    v, w = states["b.velocity"][-1, 0], states["b.angular_velocity"][-1, 1]
    if over < 1:
        assert v == pytest.approx(G * np.sin(alpha) / (1 + k) * time, abs=1e-9)
        assert R * w == pytest.approx(v, abs=1e-9)
    else:
        assert v == pytest.approx(G * (np.sin(alpha) - mu * np.cos(alpha)) * time, abs=1e-9)
        assert R * w == pytest.approx(mu * G * np.cos(alpha) / k * time, abs=1e-9)


def billiard_path(z: Array, mu: float, time: float) -> Array:
    """x, y and velocity of a ball with velocity z[:2] and spin z[2:4] in the plane (Coriolis 1835).

    The slip u = v + w x (-r n) keeps its direction, so the path is a parabola until t1 = 2 |u| / (7 mu g); from then on
    v = v0 - 2/7 u.
    """
    v, w = np.asarray(z[:2], float), np.asarray(z[2:4], float)
    u = v + R * np.array([-w[1], w[0]])
    speed = np.linalg.norm(u)
    t1 = 2 * speed / (7 * mu * G)
    end = v - 2 / 7 * u
    return np.array([*(v * t1 - mu * G * u / speed * t1**2 / 2 + end * (time - t1)), *end])


@pytest.mark.parametrize(("dt", "near", "slopes"), [(0.01, 2e-4, 2e-2), (0.0025, 2e-5, 5e-3)])
@pytest.mark.parametrize(
    "shot", [(2.0, 0.0, 30.0, 0.0), (2.0, 0.5, -20.0, -60.0), (1.0, 0.0, 0.0, 40.0), (1.5, 0, 25, -80)]
)
def test_billiard_ball_with_any_spin(shot: tuple[float, ...], dt: float, near: float, slopes: float) -> None:
    """Coriolis: draw, follow and masse shots run along a parabola and then straight; by velocity and spin too."""
    mu, time = 0.2, 1.2
    world = make_world([Body.ball("b", R, 0.17)], [Plane.ground()], Law(mu))

    def start(z: Any) -> dict[str, Any]:
        return {
            "b.position": [0, 0, R],
            "b.velocity": ca.vertcat(z[:2], 0),
            "b.angular_velocity": ca.vertcat(z[2:4], 7.0),
        }

    value, slope = final(Lab(world, Scheme(dt=dt)), start, time, ["b.position", "b.velocity"], shot)
    exact = billiard_path(np.array(shot), mu, time)
    by = differences(lambda z: billiard_path(z, mu, time), shot)
    assert value[[0, 1]] == pytest.approx(exact[:2], abs=mu * G * dt**2 / 8)
    assert value[[3, 4]] == pytest.approx(exact[2:], abs=1e-9)
    assert slope[[0, 1]] == pytest.approx(by[:2], abs=0.2 * dt)
    assert slope[[3, 4]] == pytest.approx(by[2:], abs=1e-6)


@pytest.mark.parametrize("height", [0.0, 0.7, 1.0, -0.5])
def test_struck_at_two_fifths_a_ball_rolls_at_once(height: float) -> None:
    """A level blow J at h above the centre gives v = J/m and w = J h / I: it rolls at once iff h = 2/5 r (7/5 r rule).

    In the end v = 5/7 (1 + h/r) J/m whatever friction; h here in units of 2/5 r, and the slope is by h.
    """
    blow, mu, dt, time = 2.0, 0.2, 0.01, 1.0
    lab = Lab(make_world([Body.ball("b", R, 1.0)], [Plane.ground()], Law(mu)), Scheme(dt=dt))

    def start(z: Any) -> dict[str, Any]:
        spin = blow * z[0] * 0.4 * R / (0.4 * R * R)
        return {
            "b.position": [0, 0, R],
            "b.velocity": [blow, 0, 0],
            "b.angular_velocity": ca.vertcat(0, spin, 0),
        }

    value, slope = final(lab, start, time, ["b.velocity"], [height])
    assert value[0] == pytest.approx(5 / 7 * (1 + 0.4 * height) * blow, abs=1e-9)
    assert slope[0, 0] == pytest.approx(2 / 7 * blow, abs=1e-9)
    first = final(lab, start, 2 * dt, ["b.velocity"], [height])[0][0]
    lost = np.sign(1 - height) * mu * G * 2 * dt
    assert first == pytest.approx(blow - lost, abs=1e-9)


FIRST = pytest.mark.xfail(
    strict=True,
    reason="a hit within the first step: the cloth does not carry yet, so friction over mu g t is taken at the hit; "
    "cue 0.17157 for 0.17213 m/s, object 1.42843 for 1.42787, gap 1 mm, dt 0.01; error up to mu g dt, first order",
)


@few("gap", [0.05, pytest.param(0.001, marks=FIRST)], 1)
@few("spin", [0.3, 0.0, -1.0], 2)
def test_follow_and_draw(spin: float, gap: float) -> None:
    """A head-on elastic hit leaves the cue ball its spin only: v = 2/7 r w in the end, the other's 5/7 v0.

    ``spin``: r w / v0 at the start, positive to follow, negative to draw; the cloth changes it a little until then.
    """
    v0, mu = 2.0, 0.2
    balls = [Body.ball("cue", R, 0.17), Body.ball("object", R, 0.17)]
    world = make_world(balls, [Plane.ground()])
    pairs = tuple(replace(p, law=Law(0.0, 1.0) if p.second.body == 1 else Law(mu)) for p in world.pairs)
    lab = Lab(replace(world, pairs=pairs), Scheme())

    def start(z: Any) -> dict[str, Any]:
        values = {"cue.position": [0, 0, R], "cue.velocity": ca.vertcat(z[0], 0, 0)}
        values |= {"object.position": [2 * R + gap, 0, R], "cue.angular_velocity": ca.vertcat(0, z[1], 0)}
        return values

    names = ["cue.velocity", "object.velocity"]
    value, slope = final(lab, start, 1.5, names, [v0, spin * v0 / R])

    def exact(z: Array) -> list[float]:
        """Until the hit after t1 friction acts: v' = -mu g, w' = 5/2 mu g / r."""
        t1 = (z[0] - np.sqrt(z[0] ** 2 - 2 * mu * G * gap)) / (mu * G)
        v, w = z[0] - mu * G * t1, z[1] + 2.5 * mu * G * t1 / R
        return [2 / 7 * R * w, 5 / 7 * v]

    at = [v0, spin * v0 / R]
    assert value[[0, 3]] == pytest.approx(exact(at), abs=1e-7)
    assert slope[[0, 3]] == pytest.approx(differences(exact, at), abs=1e-6)


def groove(slope: Any, lean: float, mu: float, dt: float = 0.01) -> Lab:
    """A ball between two walls whose normals lean by ``lean`` from the vertical; gravity leans along the groove."""
    walls = [Plane(n, (0, s * np.sin(lean), np.cos(lean)), 0.0) for n, s in (("left", 1.0), ("right", -1.0))]
    world = make_world([Body.ball("b", R, 1.0)], walls, Law(mu), (G * ca.sin(slope), 0, -G * ca.cos(slope)))
    return Lab(world, Scheme(dt=dt), parameters=[slope])


@few("lean", [0.3, 0.9], 1)
def test_ball_rolls_down_a_groove(lean: float) -> None:
    """The contacts are r cos(lean) below the centre: a = g sin(alpha) / (1 + 2 / (5 cos^2 lean))."""
    alpha, time = 0.2, 0.5
    lab = groove(ca.SX.sym("alpha"), lean, 0.6)
    start = {"b.position": [0, 0, R / np.cos(lean)]}
    value, slope = final(lab, lambda z: start, time, ["b.velocity", "b.position"], [alpha], lambda z: z)
    share = G / (1 + 0.4 / np.cos(lean) ** 2) * time
    assert value[[0, 3]] == pytest.approx(share * np.sin(alpha) * np.array([1, time / 2]), abs=1e-6)
    assert slope[[0, 3], 0] == pytest.approx(share * np.cos(alpha) * np.array([1, time / 2]), abs=1e-5)


@pytest.mark.slow
@first("dt", [0.01, 0.005])
def test_ball_rolls_in_a_bowl(dt: float) -> None:
    """Small swings in z = (x^2 + y^2) / 2, where the radius is 1: T = 2 pi sqrt(7 (1 - r) / 5 g) if it rolls."""
    at, radius = 0.01, 0.1
    bowl = Terrain("bowl", lambda x, y: (x * x + y * y) / 2)
    lab = Lab(make_world([Body.ball("b", radius, 1.0)], [bowl], Law(0.5)), Scheme(dt=dt))
    start = np.array([at, 0, at * at / 2]) + radius * np.array([-at, 0, 1]) / np.sqrt(1 + at * at)
    x = lab.states({"b.position": start}, 6.0)["b.position"][:, 0]
    down = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
    crossings = dt * (down + x[down] / (x[down] - x[down + 1]))
    assert np.diff(crossings) == pytest.approx(2 * np.pi * np.sqrt(7 * (1 - radius) / (5 * G)), rel=1e-4)
    assert np.abs(x[-round(2.3 / dt) :]).max() == pytest.approx(x[0], rel=1e-2)


@first("dt", [0.01, 0.0025])
@few("share", [0.97, 1.03], 1)
def test_ball_climbs_a_step_if_it_is_fast_enough(share: float, dt: float) -> None:
    """Plastic and rough, angular momentum about the edge is kept: it climbs h iff v > r sqrt(70 g h) / (7 r - 5 h)."""
    h, radius = 0.02, 0.1
    world = make_world(
        [Body.ball("b", radius, 1.0)],
        [Plane.ground(), Fixture("step", Box((1.0, 1.0, 0.5), (1.0, 0, h - 0.5)))],
        Law(2.0),
    )
    v = share * radius * np.sqrt(70 * G * h) / (7 * radius - 5 * h)
    start = {"b.position": [-0.2, 0, radius], "b.velocity": [v, 0, 0], "b.angular_velocity": [0, v / radius, 0]}
    states = Lab(world, Scheme(dt=dt)).states(start, 1.5)
    x, speed = states["b.position"][-1, 0], states["b.velocity"][-1, 0]
    if share < 1:
        assert x < -0.1 and speed < 0
    else:
        # v r-wards becomes v (7 r - 5 h) / 7 r at the edge, of which 10/7 g h is lost to the height
        assert speed == pytest.approx(
            np.sqrt((v * (7 * radius - 5 * h) / (7 * radius)) ** 2 - 10 / 7 * G * h), abs=0.1 * dt
        )
