"""Wheels, tops and balls on rough ground: rimless wheels, tippe tops, coins, superballs."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, differences, final, spinning, turn
from scipy.integrate import solve_ivp
from tools.laboratory import Lab
from tools.repeats import few, first, thorough
from worlds.blocks import turned_by
from worlds.linkage import energy

from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array


@few("e", [1.0, 0.8], 1)
def test_superball_under_a_table(e: float) -> None:
    """Garwin 1969, with Coulomb's law in place of his: floor, then the table's underside, then floor; by v and w too.

    Each hit that sticks: v' = (5 v + 2 s r w) / 7 and s r w' = v', s = 1 below and -1 above; it does if 2/7 |slip| is
    less than mu (1 + e) v_n. Otherwise v' = v - mu (1 + e) v_n sign(slip).
    """
    r, room, mu, time = 0.03, 0.5, 0.4, 0.32
    ceiling = Plane("table", (0.0, 0, -1.0), -room)
    lab = Lab(make_world([Body.ball("b", r, 0.1)], [Plane.ground(), ceiling], Law(mu, e), (0, 0, 0)), Scheme())

    def start(z: Any) -> dict[str, Any]:
        return {
            "b.position": [0, 0, 0.2],
            "b.velocity": ca.vertcat(z[0], 0, -4.0),
            "b.angular_velocity": ca.vertcat(0, z[1], 0),
        }

    def exact(z: Array) -> Array:
        x, height, v, up, w, now = 0.0, 0.2, z[0], -4.0, z[1], 0.0
        while True:
            wait = ((height - r) if up < 0 else (room - r - height)) / abs(up)
            if now + wait > time:
                return np.array([x + v * (time - now), v, up, w])
            x, height, now, side = x + v * wait, (r if up < 0 else room - r), now + wait, (1 if up < 0 else -1)
            slip = v - side * r * w
            blow = -np.sign(slip) * min(2 / 7 * abs(slip), mu * (1 + e) * abs(up))
            v, w, up = v + blow, w - side * 2.5 * blow / r, -e * up

    for at in ([3.0, 0.0], [1.0, 150.0], [6.0, -200.0]):
        value, slope = final(lab, start, time, ["b.position", "b.velocity", "b.angular_velocity"], at)
        mine = [0, 3, 5, 7]
        assert value[mine] == pytest.approx(exact(np.array(at)), abs=1e-7)
        assert slope[mine] == pytest.approx(differences(exact, at), abs=1e-6)


SPOKES, SPOKE = 8, 0.4
SECTOR = np.pi / SPOKES
"""Half the angle between two spokes."""
RATE_ERROR = 20.0
"""[rad/s^3] what the rate may be off, over the step squared.

Displacements of first order in the rotation lift the feet by 0.2 |w|^2 dt^2 [m]: 1e-6 m here at 2.5 ms."""


def rimless(slope: float, dt: float, moment: float) -> Lab:
    """Eight spokes that end in points; a wheel on z = 0 with gravity leaning to +x by ``slope``."""
    angles = np.arange(SPOKES) * 2 * SECTOR
    feet = tuple(Sphere(0.0, (SPOKE * np.sin(a), 0.0, -SPOKE * np.cos(a))) for a in angles)
    body = Body("w", 1.0, (moment, moment, moment), feet)
    gravity = (G * np.sin(slope), 0, -G * np.cos(slope))
    return Lab(make_world([body], [Plane.ground()], Law(2.0, 0.0), gravity), Scheme(dt=dt, sweeps=20))


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
@pytest.mark.parametrize("moment", [0.02, 0.08])
def test_rimless_wheel(moment: float, dt: float) -> None:
    """McGeer, Coleman: each step keeps eta = (I + m l^2 cos(2 a)) / (I + m l^2) of the rate; it ends in a limit cycle.

    The rate at the beginning of a step, from the last: w'^2 = eta^2 (w^2 + 4 m g l sin(a) sin(slope) / (I + m l^2)).
    """
    slope, rate = 0.12, 2.0
    about = moment + SPOKE**2
    keeps = (moment + SPOKE**2 * np.cos(2 * SECTOR)) / about
    gain = 4 * G * SPOKE * np.sin(SECTOR) * np.sin(slope) / about
    place = SPOKE * np.array([-np.sin(SECTOR), 0, np.cos(SECTOR)])
    start = {"w.position": place, "w.orientation": turned_by((0, 1, 0), -SECTOR)}
    start |= {"w.angular_velocity": [0, rate, 0], "w.velocity": np.cross([0, rate, 0], place)}
    states = rimless(slope, dt, moment).states(start, 2.0)
    w, q = states["w.angular_velocity"][:, 1], states["w.orientation"]
    angle = 2 * np.arctan2(q[:, 2], q[:, 0])
    stance = np.round(angle / (2 * SECTOR))
    stance[0] = 0
    leaning = angle - 2 * SECTOR * stance
    # that rate by energy from the rate in the middle of the step: V = m g l cos(leaning + slope)
    began = np.sqrt(w**2 + 2 * G * SPOKE / about * (np.cos(leaning + slope) - np.cos(slope - SECTOR)))
    steps = range(int(stance[-1]))
    found = [began[stance == k][np.argmin(np.abs(leaning[stance == k]))] for k in steps]
    expected = [rate]
    for _ in steps[1:]:
        expected.append(keeps * np.sqrt(expected[-1] ** 2 + gain))
    assert len(found) >= 4
    assert found == pytest.approx(expected, abs=RATE_ERROR * dt**2)


def eccentric(mu: float, dt: float) -> Lab:
    """A ball whose centre of mass lies below its middle."""
    return Lab(
        make_world(
            [Body("t", 0.02, (T_ACROSS, T_ACROSS, T_ALONG), (Sphere(T_R, (0, 0, T_OFF)),))], [Plane.ground()], Law(mu)
        ),
        Scheme(dt=dt),
    )


T_R, T_OFF = 0.02, 0.006
T_ACROSS, T_ALONG = 0.02 * 0.4 * 0.02**2 * 1.05, 0.02 * 0.4 * 0.02**2


def exact_tippe(tilt: float, spin: float, mu: float, time: float) -> Array:
    """(101, 4): orientations, equally spaced in time: Newton, Euler, Coulomb, the contact kept."""
    inertia = np.diag([T_ACROSS, T_ACROSS, T_ALONG])
    mass = 0.02

    def parts(y: Array) -> tuple[Array, Array, Array, Array, Array]:
        r = turn(y[:4])
        arm = T_OFF * r[:, 2] - [0, 0, T_R]
        inverse = r @ np.linalg.inv(inertia) @ r.T
        return r, arm, inverse, inverse @ y[4:7], T_OFF * r[:, 2]

    def rate(_: float, y: Array) -> Array:
        _, arm, inverse, w, middle = parts(y)
        v = np.array([*y[7:9], -np.cross(w, middle)[2]])
        slip = (v + np.cross(w, arm))[:2]
        push = np.array([*(-mu * slip / np.sqrt(slip @ slip + 1e-12)), 1.0])
        # height of the centre of mass: R - middle_z, so m (-(w' x middle + w x (w x middle))_z) = N - m g
        own = -inverse @ np.cross(w, y[4:7])
        turned = inverse @ np.cross(arm, push)
        free = -(np.cross(own, middle) + np.cross(w, np.cross(w, middle)))[2]
        load = (free + G) / (1 / mass + np.cross(turned, middle)[2])
        return np.concatenate([spinning(y[:4], w), load * np.cross(arm, push), load * push[:2] / mass])

    q = turned_by((0, 1, 0), tilt)
    r = turn(q)
    y0 = np.concatenate([q, r @ inertia @ r.T @ [0, 0, spin], [0, 0]])
    y = solve_ivp(rate, (0, time), y0, method="LSODA", rtol=1e-9, atol=1e-11, t_eval=np.linspace(0, time, 101)).y.T
    return np.asarray(y[:, :4])


@pytest.mark.slow
@first("dt", [0.002, 0.001])
def test_tippe_top(dt: float) -> None:
    """Jellett 1872: L . r, r from the centre of mass to the contact, is kept whatever friction does; the top rises.

    Against Newton and Euler with Coulomb's friction, at first order: it has the direction of the step's end.
    """
    tilt, spin, mu, time = 0.1, 150.0, 0.3, 1.0
    q, inertia = turned_by((0, 1, 0), tilt), np.diag([T_ACROSS, T_ACROSS, T_ALONG])
    start = {"t.position": [0, 0, T_R - T_OFF * np.cos(tilt)], "t.orientation": q, "t.angular_velocity": [0, 0, spin]}
    states = eccentric(mu, dt).states(start, time)
    turns = np.array([turn(each) for each in states["t.orientation"]])
    moments = [r @ inertia @ r.T @ w for r, w in zip(turns, states["t.angular_velocity"], strict=True)]
    kept = (np.array(moments) * (T_OFF * turns[:, :, 2] - [0, 0, T_R])).sum(axis=1)
    assert np.abs(kept / kept[0] - 1).max() < 20 * dt**2
    every = round(time / dt) // 100
    exact = np.array([turn(each)[2, 2] for each in exact_tippe(tilt, spin, mu, time)])
    assert np.abs(turns[::every, 2, 2] - exact).max() < 20 * dt
    assert turns[-1, 2, 2] < -0.7


def coin(dt: float, mu: float = 0.3) -> Lab:
    """A thin disc of radius .1 with twelve points on its rim, and a wall."""
    angles = np.arange(12) * np.pi / 6
    rim = tuple(Sphere(0.004, (0.1 * np.cos(a), 0.1 * np.sin(a), 0.0)) for a in angles)
    body = Body("c", 0.1, (2.5e-4, 2.5e-4, 5e-4), rim)
    return Lab(make_world([body], [Plane.ground(), Plane("wall", (-1.0, 0, 0), -0.12)], Law(mu, 0.3)), Scheme(dt=dt))


@pytest.mark.slow
@pytest.mark.parametrize(("dt", "spin"), [thorough(0.01, 10.0), (0.01, 30.0), thorough(0.005, 30.0)])
def test_spinning_coin_loses_energy(dt: float, spin: float) -> None:
    """Euler's disc: whatever rolls, slides and strikes, also against a wall, the energy does not rise."""
    lab = coin(dt)
    q = turned_by((1, 0, 0), 1.3)
    lowest = min((turn(q) @ s.centre)[2] for s in lab.world.bodies[0].shapes)
    start = {"c.position": [0, 0, 0.004 - lowest], "c.orientation": q}
    start |= {"c.angular_velocity": [0, 0, spin], "c.velocity": [0.3, 0, 0]}
    states = lab.states(start, 1.5)
    kept = energy(lab.world, states)
    # what the position pass lifts: 1.9e-5 of 0.22 J in a step of 10 ms
    assert np.diff(kept).max() < 1e-4 * kept[0]
    assert kept.max() < (1 + 1e-4) * kept[0]
    assert kept[-1] == pytest.approx(0.1 * G * 0.004, abs=1e-6)
