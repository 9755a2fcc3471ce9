"""Pendulums and chains: shaken pivots, unequal masses, springs in a row, hanging chains, walls and stops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from data.textbook import G
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from tools.laboratory import Lab
from tools.repeats import few, first
from worlds.linkage import ABOUT_Y, ABOUT_Z, chain, hanging, rod

from symphys.model.joints import BALL, HINGE, SLIDER, Joint, JointFrame, Limits, Spring, VelocityMotor
from symphys.model.shapes import Plane, Sphere
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

LENGTH = 0.3


def kapitza(dt: float) -> Lab:
    """A bob on a light rod of 0.3 m, its pivot on a vertical rail driven at commanded velocities."""
    bodies = (Body("cart", 1.0, 0.1), Body("bob", 0.1, 1e-7))
    rail = Joint(
        "rail",
        SLIDER,
        0,
        None,
        (JointFrame((0, 0, 0), ABOUT_Z),) * 2,
        VelocityMotor(1e6, 1e3),
    )
    pin = Joint("pin", HINGE, 1, 0, (JointFrame((0, 0, -LENGTH), ABOUT_Y), JointFrame((0, 0, 0), ABOUT_Y)))
    return Lab(World(bodies, joints=(rail, pin)), Scheme(dt=dt), ["rail.command"])


@pytest.mark.slow
@few("share", [0.8, 1.3], 1)
def test_kapitzas_pendulum(share: float) -> None:
    """Upright it is stable iff a w > sqrt(2 g l), a the amplitude, w the frequency of the pivot (Landau, Lifshitz 30).

    Against l theta'' = (g + z'') sin(theta), whose pivot changes velocity as commanded, in steps.
    """
    frequency, time, tilt = 2 * np.pi * 25, 1.0, 0.1
    fastest = share * np.sqrt(2 * G * LENGTH)

    def rate(t: float, y: Array) -> list[float]:
        return [y[1], (G + fastest * frequency * np.cos(frequency * t)) / LENGTH * np.sin(y[0])]

    errors = []
    for dt in (0.001, 0.0005):
        times = np.arange(round(time / dt) + 1) * dt
        start: dict[str, Any] = {"bob.position": LENGTH * np.array([np.sin(tilt), 0, np.cos(tilt)])}
        start |= {"bob.orientation": [np.cos(tilt / 2), 0, np.sin(tilt / 2), 0]}
        states = kapitza(dt).states(start, time, u=fastest * np.sin(frequency * (times[:-1] + dt / 2))[None])
        p = states["bob.position"] - states["cart.position"]
        angle = np.arctan2(p[:, 0], p[:, 2])
        exact = solve_ivp(rate, (0, time), [tilt, 0.0], rtol=1e-10, atol=1e-12, t_eval=times).y[0]
        errors.append(np.abs(angle - exact).max())
        assert (np.abs(angle).max() < 0.2) == (share > 1)
    assert errors[0] < 5e-4
    assert errors[1] < errors[0] / 1.5


def slow_mode(masses: tuple[float, float], dt: float) -> tuple[float, float]:
    """Error of a double pendulum that swings in its slow mode, of its swing, and what second order allows.

    (w^2 M - K) a = 0: M = [[m1 + m2, m2], [m2, m2]] l^2, K = diag(m1 + m2, m2) g l. The phase of leapfrog is off by
    (w dt)^2 / 24 of itself.
    """
    length, tilt, time = 0.5, 1e-3, 2.0
    m1, m2 = masses
    bodies = (Body("a", m1, 1e-9 * m1), Body("b", m2, 1e-9 * m2))
    up = JointFrame((0, 0, length))
    joints = (Joint("top", BALL, 0, None, (up, JointFrame())), Joint("mid", BALL, 1, 0, (up, JointFrame())))
    squares, modes = eigh(np.diag([m1 + m2, m2]) * G * length, np.array([[m1 + m2, m2], [m2, m2]]) * length**2)
    w, angles = np.sqrt(squares[0]), tilt * modes[:, 0] / np.abs(modes[:, 0]).max()
    start: dict[str, Any] = {}
    place = np.zeros(3)
    for name, angle in zip("ab", angles, strict=True):
        place = place - length * np.array([np.sin(angle), 0, np.cos(angle)])
        start |= {f"{name}.position": place, f"{name}.orientation": [np.cos(angle / 2), 0, np.sin(angle / 2), 0]}
    states = Lab(World(bodies, joints=joints), Scheme(dt=dt)).states(start, time)
    x = np.stack([states["a.position"][:, 0], states["b.position"][:, 0]], axis=1)
    exact = np.cos(w * np.arange(len(x)) * dt)[:, None] * x[0]
    return float(np.abs(x - exact).max() / np.abs(x[0]).max()), 2 * (w * dt) ** 2 / 24 * w * time


@first("dt", [0.01, 0.0025])
@few("masses", [(1.0, 1.0), (1.0, 300.0), (1000.0, 1.0), (1e6, 1.0)], 2)
def test_double_pendulum_of_unequal_bobs(masses: tuple[float, float], dt: float) -> None:
    error, allowed = slow_mode(masses, dt)
    assert error < allowed


@first("dt", [0.01, 0.0025])
def test_how_heavy_a_load_may_hang(dt: float) -> None:
    """A mass m between two spans l under a tension T is stepped explicitly: w^2 = T / m (1 / l + 1 / l), w dt < 2.

    That is a load of 1000 times the mass at dt = 0.01, as docs/joints.md has it; beyond, the mass flutters.
    """
    length = 0.5
    for share, holds in ((0.98, True), (1.02, False)):
        error, allowed = slow_mode((1.0, (2 * share / dt) ** 2 * length / (2 * G)), dt)
        assert (error < allowed) == holds
        assert holds or error > 1


@first("dt", [0.01, 0.0025])
def test_carts_on_springs(dt: float) -> None:
    """Rayleigh: n carts in a row, the first tied to a wall: w_k = 2 sqrt(c/m) sin((2 k - 1) pi / (2 (2 n + 1)))."""
    n, stiffness, mass = 4, 40.0, 0.5
    bodies = tuple(Body(f"c{k}", mass, 0.1) for k in range(n))
    joints = tuple(
        Joint(
            f"j{k}", SLIDER, k, k - 1 if k else None, (JointFrame(), JointFrame((0.2, 0, 0))), spring=Spring(stiffness)
        )
        for k in range(n)
    )
    lab = Lab(World(bodies, gravity=(0, 0, 0), joints=joints), Scheme(dt=dt))
    fastest = 2 * np.sqrt(stiffness / mass)
    for k in (1, 2, n):
        w = 2 * np.sqrt(stiffness / mass) * np.sin((2 * k - 1) * np.pi / (2 * (2 * n + 1)))
        shape = np.sin((2 * k - 1) * np.pi * np.arange(1, n + 1) / (2 * n + 1))
        start = {f"c{i}.position": [0.2 * (i + 1) + 0.02 * shape[i], 0, 0] for i in range(n)}
        time = 1.0
        states = lab.states(start, time)
        x = np.stack([states[f"c{i}.position"][:, 0] - 0.2 * (i + 1) for i in range(n)], axis=1)
        exact = 0.02 * np.cos(w * np.arange(len(x)) * dt)[:, None] * shape
        # second order in the step times the fastest mode
        assert np.abs(x - exact).max() / 0.02 < fastest**2 * dt**2 * (1 / 6 + w * time / 12)


@pytest.mark.slow
def test_hanging_chain_carries_its_weight() -> None:
    """Four equal rods between two hooks: tan of the outer slopes is three times that of the inner, H = m g / (2 tan).

    The last hook closes a loop; its force is kept in the axes of the last rod, which is along its z.
    """
    length, inner = 0.5, 0.3
    outer = float(np.arctan(3 * np.tan(inner)))
    slopes = [-outer, -inner, inner, outer]
    ends = np.cumsum([[0, 0]] + [[length * np.cos(s), length * np.sin(s)] for s in slopes], axis=0)
    half = JointFrame((0, 0, -length / 2)), JointFrame((0, 0, length / 2))
    joints = [Joint("hook", BALL, 0, None, (half[0], JointFrame()))]
    joints += [Joint(f"j{k}", BALL, k, k - 1, half) for k in range(1, 4)]
    joints += [Joint("end", BALL, 3, None, (half[1], JointFrame((ends[-1][0], 0, ends[-1][1]))))]
    bodies = tuple(rod(f"b{k}", length) for k in range(4))
    start: dict[str, Any] = {}
    for k, s in enumerate(slopes):
        middle = (ends[k] + ends[k + 1]) / 2
        start[f"b{k}.position"] = [middle[0], 0, middle[1]]
        t = np.pi / 2 - s
        start[f"b{k}.orientation"] = [np.cos(t / 2), 0, np.sin(t / 2), 0]
    lab = Lab(World(bodies, joints=tuple(joints)), Scheme(sweeps=20))
    states = lab.states(start, 0.5)
    level, up = G / (2 * np.tan(inner)), 2 * G
    along, across = np.array([np.cos(outer), np.sin(outer)]), np.array([np.sin(outer), -np.cos(outer)])
    force = states["end.lock"][-1]
    assert force[[0, 2]] == pytest.approx([across @ [level, up], along @ [level, up]], abs=1e-6)
    assert max(np.abs(states[f"b{k}.velocity"]).max() for k in range(4)) < 1e-9


@first("dt", [0.01, 0.0025])
def test_pendulum_against_a_wall(dt: float) -> None:
    """An elastic wall at its lowest point halves the period: |theta| of a free swing."""
    length, tilt, r = 0.5, 0.05, 0.02
    body = Body("b0", 1.0, (1 / 48, 1 / 48, 1e-3), (Sphere(r, (0, 0, -length / 2)),))
    wall = Plane("wall", (1.0, 0, 0), -r)
    world = make_world([body], [wall], Law(0.0, 1.0))
    world = World(world.bodies, world.statics, world.pairs, joints=chain(1).joints)
    lab = Lab(world, Scheme(dt=dt))
    start = hanging(1, [-tilt])
    time = 4.0
    x = lab.states(start, time)["b0.position"][:, 0]

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], -1.5 * G / length * np.sin(y[0])]

    times = np.arange(len(x)) * dt
    swing = solve_ivp(rate, (0, time), [tilt, 0.0], rtol=1e-11, atol=1e-13, t_eval=times).y[0]
    assert np.abs(x - length / 2 * np.abs(np.sin(swing))).max() / (length / 2 * tilt) < 10 * dt**2


@first("dt", [0.01, 0.0025])
def test_knee_strikes_its_stop(dt: float) -> None:
    """McGeer: a knee that reaches its limit locks plastically; angular momentum about the hip is kept.

    Two rods of mass m and length l without gravity: thigh at rest, shank turning at w: I = 1/3 each about its end.
    The stop is where the leg is straight.
    """
    length, w0, bend = 0.5, 3.0, 0.6
    joints = chain(2).joints
    knee = Joint("j1", HINGE, 1, 0, joints[1].frames, limits=Limits(upper=0.0))
    lab = Lab(World(chain(2).bodies, gravity=(0, 0, 0), joints=(joints[0], knee)), Scheme(dt=dt))
    start = hanging(2, [0.0, -bend])
    start |= {"b1.angular_velocity": [0, w0, 0]}
    arm = start["b1.position"] - [0, 0, -length]
    start |= {"b1.velocity": np.cross([0, w0, 0], arm)}
    states = lab.states(start, 1.0)
    rates = np.stack([states[f"b{k}.angular_velocity"][:, 1] for k in range(2)], axis=1)
    momentum = 0.0
    for k in range(2):
        p, v = states[f"b{k}.position"], states[f"b{k}.velocity"]
        momentum = momentum + np.cross(p, v)[:, 1] + length**2 / 12 * rates[:, k]
    whole = 2 * (2 * length) ** 2 / 3
    assert np.ptp(momentum) < 0.2 * dt**2
    assert rates[-1] == pytest.approx(np.full(2, momentum[0] / whole), abs=0.5 * dt**2)
