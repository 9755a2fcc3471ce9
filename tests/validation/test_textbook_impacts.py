"""Impacts with closed forms: balls on balls, rods on floors, superballs, rods on pivots that meet a stop."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, differences, final
from tools.laboratory import Lab
from tools.repeats import few, first
from worlds.blocks import turned_by

from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

R = 0.05


def balls_apart(masses: tuple[Any, Any], e: float, dt: float, cuts: int | None = None) -> Lab:
    """A light ball above a heavy one above the ground, along one line."""
    balls = [Body.ball("low", R, masses[0]), Body.ball("high", R, masses[1])]
    world = make_world(balls, [Plane.ground()], Law(0.0, e))
    near = tuple(p for p in world.pairs if (p.first.body, p.second.body) != (1, None))
    return Lab(World(world.bodies, world.statics, near), Scheme(dt=dt, cuts=cuts))


def two_falling(z: Array, masses: tuple[float, float], e: float, time: float) -> Array:
    """Heights of both above their lowest and velocities, from height, gap: event after event."""
    p, v, now = np.array([z[0], z[0] + z[1]]), np.zeros(2), 0.0
    m = np.array(masses)
    for _ in range(50):
        ground = (v[0] + np.sqrt(v[0] ** 2 + 2 * G * p[0])) / G
        meet = (p[1] - p[0]) / (v[0] - v[1]) if v[0] > v[1] + 1e-12 else np.inf
        wait = min(ground, meet)
        if now + wait > time:
            wait = time - now
            return np.array([*(p + v * wait - G * wait**2 / 2), *(v - G * wait)])
        p, v, now = p + v * wait - G * wait**2 / 2, v - G * wait, now + wait
        if ground < meet:
            p[0], v[0] = 0.0, -e * v[0]
        else:
            v = (m @ v + e * m[::-1] * (v[::-1] - v)) / m.sum()
    raise AssertionError("too many impacts")


@first("dt", [0.01, 0.001])
@few("gap", [0.1, 0.01, 0.001, 1e-5], 1)
@few(("masses", "e"), [((5.0, 1.0), 1.0), ((1000.0, 1.0), 1.0), ((8.0, 1.0), 0.8)], 1)
def test_ball_on_ball(masses: tuple[float, float], e: float, gap: float, dt: float) -> None:
    """Harter 1971: dropped together they hit one after the other; a light one leaves almost three times as fast."""
    height, time = 1.0, 0.6
    lab = balls_apart(masses, e, dt)

    def start(z: Any) -> dict[str, Any]:
        return {"low.position": ca.vertcat(0, 0, R + z[0]), "high.position": ca.vertcat(0, 0, 3 * R + z[0] + z[1])}

    value, slope = final(
        lab, start, time, ["low.position", "high.position", "low.velocity", "high.velocity"], [height, gap]
    )

    def exact(z: Array) -> Array:
        return two_falling(z, masses, e, time) + np.array([R, 3 * R, 0, 0])

    mine = [2, 5, 8, 11]
    by = differences(exact, [height, gap], 1e-7)
    assert value[mine] == pytest.approx(exact(np.array([height, gap])), abs=1e-11)
    assert slope[mine] == pytest.approx(by, abs=1e-6)


@pytest.mark.parametrize("gap", [0.01, 0.001])
def test_three_to_one_takes_a_cut_more(gap: float) -> None:
    """Masses of 3 to 1: the low ball stops, the high one leaves twice as fast; the low one then falls at once.

    Three impacts in a step of 10 ms, for which one cut is not enough (0.04 m/s off, as documented) and two are.
    """
    start = {"low.position": [0, 0, R + 1.0], "high.position": [0, 0, 3 * R + 1.0 + gap]}
    exact = two_falling(np.array([1.0, gap]), (3.0, 1.0), 1.0, 0.6)[2:]
    states = balls_apart((3.0, 1.0), 1.0, 0.01, cuts=2).states(start, 0.6)
    assert [states[f"{name}.velocity"][-1, 2] for name in ("low", "high")] == pytest.approx(exact, abs=1e-11)


def stick(e: float, mu: float, dt: float, sweeps: int = 10) -> Lab:
    """A thin rod of length 1 along its x, its ends points."""
    ends = (Sphere(0.0, (0.5, 0, 0)), Sphere(0.0, (-0.5, 0, 0)))
    rod = Body("rod", 1.0, (1e-3, 1 / 12, 1 / 12), ends)
    return Lab(make_world([rod], [Plane.ground()], Law(mu, e)), Scheme(dt=dt, sweeps=sweeps))


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
@few(("mu", "e", "sweeps"), [(0.0, 1.0, 10), (0.0, 0.5, 10), (1.0, 0.5, 60), (1.0, 0.5, 10)], 1)
def test_rod_drops_on_its_end(mu: float, e: float, sweeps: int, dt: float) -> None:
    """J = m v (1 + e) / (1 + 3 cos^2) on a smooth floor (Routh); on a rough one the end also stops along it."""
    angle, height, time = 0.6, 0.3, 0.3
    lab = stick(e, mu, dt, sweeps)

    def start(z: Any) -> dict[str, Any]:
        """The right end low, by an angle below the horizon."""
        return {
            "rod.position": ca.vertcat(0, 0, 0.5 * ca.sin(z[0]) + z[1]),
            "rod.orientation": ca.vertcat(ca.cos(z[0] / 2), 0, ca.sin(z[0] / 2), 0),
        }

    def exact(z: Array) -> Array:
        """Inverse mass of the end, x and z: 1/m + r x r / I with r = (cos, -sin) / 2; turning about y."""
        v = np.sqrt(2 * G * z[1])
        r = 0.5 * np.array([np.cos(z[0]), -np.sin(z[0])])
        across = np.array([r[1], -r[0]])
        w = np.eye(2) + 12 * np.outer(across, across)
        blow = np.linalg.solve(w, [0, (1 + e) * v]) if mu else np.array([0, (1 + e) * v / w[1, 1]])
        after = time - v / G
        return np.array([blow[0], blow[1] - v - G * after, 12 * across @ blow])

    at = [angle, height]
    value, slope = final(lab, start, time, ["rod.velocity", "rod.angular_velocity"], at)
    mine = [0, 2, 4]
    assert value[mine] == pytest.approx(exact(np.array(at)), abs=1e-7)
    assert slope[mine] == pytest.approx(differences(exact, at), abs=1e-5)


def clattering(angle: float, height: float, e: float, time: float) -> tuple[Array, int]:
    """Height, angle and rates of a smooth rod between its impacts, which are found by bisection; and their number."""
    y, now, count = np.array([height + 0.5 * np.sin(angle), angle, 0.0, 0.0]), 0.0, 0

    def at(t: float) -> Array:
        return np.array([y[0] + y[2] * t - G * t * t / 2, y[1] + y[3] * t, y[2] - G * t, y[3]])

    def gaps(s: Array) -> Array:
        """Of the right and the left end; angle counts down on the right."""
        return np.array([s[0] - 0.5 * np.sin(s[1]), s[0] + 0.5 * np.sin(s[1])])

    while True:
        times = np.linspace(0, time - now, 3001)[1:]
        below = np.flatnonzero((np.array([gaps(at(t)) for t in times]) < -1e-15).any(axis=1))
        if not below.size:
            return at(time - now), count
        low, high = times[below[0]] - times[0], times[below[0]]
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (low, middle) if (gaps(at(middle)) < 0).any() else (middle, high)
        side = int(np.argmin(gaps(at(high))))
        y, now, count = at(low), now + low, count + 1
        assert count < 30
        lever = (-0.5 if side == 0 else 0.5) * np.cos(y[1])
        blow = -(1 + e) * (y[2] + lever * y[3]) / (1 + 12 * lever**2)
        y = y + np.array([0, 0, blow, 12 * lever * blow])


@pytest.mark.slow
@few("angle", [0.05, 0.2, 0.5], 1)
@few("e", [0.5, 0.9], 1)
def test_rod_clatters(e: float, angle: float) -> None:
    """Goyal, Papadopoulos, Sullivan 1998: a smooth rod dropped nearly flat strikes with one end after the other."""
    time = 0.3 if e < 0.6 else 0.5
    start = {"rod.position": [0, 0, 0.2 + 0.5 * np.sin(angle)], "rod.orientation": turned_by((0, 1, 0), angle)}
    exact, _ = clattering(angle, 0.2, e, time)
    errors = []
    for dt in (0.01, 0.001):
        states = stick(e, 0.0, dt).states(start, time)
        q = states["rod.orientation"][-1]
        got = [states["rod.position"][-1, 2], 2 * np.arctan2(q[2], q[0])]
        got += [states["rod.velocity"][-1, 2], states["rod.angular_velocity"][-1, 1]]
        errors.append(np.abs(got - exact).max())
    assert errors[0] < 5e-4
    assert errors[1] < max(errors[0] / 30, 1e-9)
