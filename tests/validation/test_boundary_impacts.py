"""An impact that falls on the boundary of two steps, bit for bit, keeps its value and its slope.

A body flies at another, or at what is static, without gravity and friction. A gap s0 closes at v after s0 / v and then
opens at e v: gap(T) = e (v T - s0); the centre of mass of the two goes on. All numbers are dyadic fractions, so that
the gap at the end of a step is 0 in floating point; one unit in the last place before and after are tried beside it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.agreement import transcribed
from tools.laboratory import Lab
from tools.repeats import few, thorough

from symphys.model.joints import HINGE, SLIDER, Joint, JointFrame, Limits
from symphys.model.shapes import Box, Capsule, Fixture, Plane, Sphere, Terrain
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

DT, STEPS = 1 / 16, 16
STOUT = 1e9
"""[kg m^2]: so much that a body does not turn, since only the instant of the impact is tested."""
HALF = 0.5**0.5
ALONG_Y, ALONG_X = (HALF, HALF, 0.0, 0.0), (HALF, 0.0, HALF, 0.0)
BALL, ROD, BRICK = Sphere(0.25), Capsule(0.25, 1.0, orientation=ALONG_X), Box((1.0, 1.0, 0.25))
CROSS = Capsule(0.25, 1.0, orientation=ALONG_Y)
"""All reach 0.25 m up and down."""
PAIRS: dict[str, tuple[Any, Any]] = {
    "sphere-sphere": (BALL, BALL),
    "sphere-capsule": (BALL, ROD),
    "sphere-box": (BALL, BRICK),
    "capsule-capsule": (ROD, ROD),
    "crossed capsules": (ROD, CROSS),
    "capsule-box": (ROD, BRICK),
    "box-box": (BRICK, Box((0.5, 0.5, 0.25))),
    "sphere-plane": (BALL, Plane.ground(0.25)),
    "capsule-plane": (ROD, Plane.ground(0.25)),
    "box-plane": (BRICK, Plane.ground(0.25)),
    "sphere-terrain": (BALL, Terrain("ground", lambda x, y: 0.25 + 0 * x)),
    "capsule-terrain": (ROD, Terrain("ground", lambda x, y: 0.25 + 0 * x)),
    "box-terrain": (BRICK, Terrain("ground", lambda x, y: 0.25 + 0 * x)),
    "sphere-fixed box": (BALL, Fixture("ground", Box((4.0, 4.0, 0.25)))),
    "box-fixed box": (BRICK, Fixture("ground", Box((4.0, 4.0, 0.25)))),
}
"""The first flies down at the second, whose surface is 0.25 m above its reference point."""
REPEATED = {"box-fixed box", "crossed capsules", "capsule-box", "capsule-terrain", "box-terrain"}
"""Pairs whose parts others show."""
LARGE = {"box-box", "capsule-capsule"}
"""Pairs with so many points that their steps are not cut in every run of the tests."""
CUTS = [
    thorough(name, cuts)
    if name in REPEATED or (cuts is None if name in LARGE else cuts == 0 and not name.startswith("sphere"))
    else (name, cuts)
    for cuts in (None, 0)
    for name in PAIRS
]
"""Without cuts every pair has the same law."""
CASES = 12


def world_of(name: str, e: Any) -> World:
    """The two of a pair under one law."""
    first, second = PAIRS[name]
    upper = Body("a", 1.0, STOUT, (first,))
    if isinstance(second, Plane | Terrain | Fixture):
        return make_world([upper], [second], Law(0.0, e), (0, 0, 0))
    return make_world([upper, Body("b", 3.0, STOUT, (second,))], [], Law(0.0, e), (0, 0, 0))


@cache
def height_at_the_end(name: str, cuts: int | None) -> ca.Function:
    """(z_a, z_b, v, e) -> (z_a at the end, its gradient by the first three)."""
    z, e = ca.MX.sym("z", 3), ca.MX.sym("e")
    p = ca.SX.sym("e")
    lab = Lab(world_of(name, p), Scheme(dt=DT, cuts=cuts, sweeps=4), parameters=[p])
    start = {"a.position": ca.vertcat(0, 0, z[0]), "a.velocity": ca.vertcat(0, 0, -z[2])}
    if "b.position" in lab.layout:
        start |= {"b.position": ca.vertcat(0, 0, z[1])}
    end = lab.trajectory(start, DT * STEPS, p=e)[lab.layout["a.position"], -1][2]
    return ca.Function("end", [z, e], [end, ca.gradient(end, z)])


def closed_form(z: Array, e: float, share: float) -> tuple[float, Array]:
    """Height of the first body at the end and its gradient; ``share``: of the second's mass, 1 if it is static.

    z_a = mean + share (reach + gap), mean = (1 - share) z_a0 + share z_b0 - (1 - share) v T, gap = e (v T - s0).
    """
    above, below, speed = z
    time, s0 = DT * STEPS, above - below - 0.5
    end = (1 - share) * (above - speed * time) + share * below + share * (0.5 + e * (speed * time - s0))
    slopes = [1 - share - share * e, share + share * e, -(1 - share) * time + share * e * time]
    return end, np.array(slopes)


def cases(name: str) -> list[tuple[Array, float]]:
    """Impacts on the boundary of a step, and one unit in the last place of the gap to either side."""
    rng = np.random.default_rng([19, list(PAIRS).index(name)])
    static, found = isinstance(PAIRS[name][1], Plane | Terrain | Fixture), []
    for _ in range(CASES):
        step, speed, e = int(rng.integers(1, STEPS)), rng.integers(4, 33) / 8, float(rng.choice([0.5, 0.75, 1.0]))
        below = 0.0 if static else rng.integers(-8, 9) / 8
        above = below + 0.5 + speed * step * DT
        found += [(np.array([z, below, speed]), e) for z in (above, np.nextafter(above, 9), np.nextafter(above, -9))]
    return found


@few(("name", "cuts"), CUTS, 2)
def test_an_impact_on_the_boundary_keeps_its_slope(name: str, cuts: int | None) -> None:
    """Value and gradient equal the closed form on the boundary, one unit before and one after."""
    end, share = height_at_the_end(name, cuts), 1.0 if len(world_of(name, 1.0).bodies) == 1 else 0.75
    many = cases(name)
    values, slopes = end.map(len(many))(np.array([z for z, _ in many]).T, np.array([e for _, e in many])[None])
    for k, (z, e) in enumerate(many):
        value, slope = closed_form(z, e, share)
        assert float(values[0, k]) == pytest.approx(value, abs=1e-6), (z, e)
        kept = slice(0, 3) if share < 1 else [0, 2]
        assert np.array(slopes[:, k]).ravel()[kept] == pytest.approx(slope[kept], abs=1e-6), (z, e)


FALLS = [(n, v) for n in range(1, 6) for v in (0.0, -1.0, 0.25) if n * DT * 2 > v]
"""Steps until a ball meets the ground under 4 m/s^2, and its velocity at the start."""


@few("shape", ["ball", "box"], 1)
def test_a_slow_impact_on_the_boundary_keeps_its_slope(shape: str) -> None:
    """Released from rest, thrown down and up: at v it rebounds with e v, and is e v s - g s^2 / 2 high after s."""
    g, e, z = 4.0, 0.75, ca.MX.sym("z", 2)
    body = Body("a", 1.0, STOUT, (Sphere(0.5) if shape == "ball" else Box((0.5, 0.5, 0.5)),))
    lab = Lab(make_world([body], [Plane.ground()], Law(0.0, e), (0, 0, -g)), Scheme(dt=DT))
    start = {"a.position": ca.vertcat(0, 0, z[0]), "a.velocity": ca.vertcat(0, 0, z[1])}
    for n, speed in FALLS:
        end = lab.trajectory(start, DT * (n + 1))[lab.layout["a.position"], -1][2]
        found = ca.Function("end", [z], [end, ca.gradient(end, z)])
        time, v = n * DT, g * n * DT - speed
        height, sooner = 0.5 + g * time**2 / 2 - speed * time, (g * DT - e * v) / v
        slopes = [e * g * DT / v + sooner, e * DT * (g * time / v - 1) + time * sooner]
        for at in (height, np.nextafter(height, 9), np.nextafter(height, -9)):
            value, slope = found([at, speed])
            assert float(value) == pytest.approx(0.5 + e * v * DT - g * DT**2 / 2, abs=1e-6), (n, speed)
            assert np.array(slope).ravel() == pytest.approx(slopes, abs=1e-5), (n, speed, at - height)


@cache
def coordinate_at_the_end(kind: str) -> ca.Function:
    """(value, rate, limit) -> (a coordinate at the end, its gradient) of a block on a rail, or a rod on a hinge."""
    z, limit = ca.MX.sym("z", 3), ca.SX.sym("limit")
    joint = Joint("j", SLIDER if kind == "slider" else HINGE, 0, None, (JointFrame(),) * 2, limits=Limits(None, limit))
    world = World((Body("a", 1.0, 1.0),), gravity=(0.0, 0.0, 0.0), joints=(joint,))
    lab, zero = Lab(world, Scheme(dt=DT), parameters=[limit]), ca.MX.zeros(2)
    if kind == "slider":
        start = {"a.position": ca.vertcat(z[0], zero), "a.velocity": ca.vertcat(z[1], zero)}
        of = lab.trajectory(start, DT * STEPS, p=z[2])[lab.layout["a.position"], -1][0]
    else:
        turned = ca.vertcat(ca.cos(z[0] / 2), ca.sin(z[0] / 2), zero)
        start = {"a.orientation": turned, "a.angular_velocity": ca.vertcat(z[1], zero)}
        q = lab.trajectory(start, DT * STEPS, p=z[2])[lab.layout["a.orientation"], -1]
        of = 2 * ca.atan2(q[1], q[0])
    return ca.Function("end", [z], [of, ca.gradient(of, z)])


@pytest.mark.parametrize("kind", ["slider", "hinge"])
def test_a_limit_reached_on_the_boundary_keeps_its_slope(kind: str) -> None:
    """What reaches a limit stays there: the coordinate at the end is the limit, whatever it began with."""
    rng, end = np.random.default_rng(20), coordinate_at_the_end(kind)
    for _ in range(40):
        step, rate, limit = int(rng.integers(1, STEPS)), rng.integers(4, 17) / 8, rng.integers(2, 9) / 8
        for start in (limit - rate * step * DT, *(np.nextafter(limit - rate * step * DT, far) for far in (-9, 9))):
            value, slope = end([start, rate, limit])
            assert float(value) == pytest.approx(limit, abs=1e-9)
            assert np.array(slope).ravel() == pytest.approx([0, 0, 1], abs=1e-9), (start, rate, limit)


BRICK_SHAPE, ROD_SHAPE = "box = { size = [1, 1, 1] }", "capsule = { radius = 0.25, length = 0.5 }"
COMPILED = """
[simulation]
duration = 1.0
dt = 0.0625
[world]
gravity = [0, 0, 0]
[contact]
friction = 0
restitution = 0.5
[ground]
[[body]]
name = "ball"
shape = { sphere = { radius = 0.5 } }
mass = 1
collides_with = ["ground"]
[[body]]
name = "brick"
shape = { box = { size = [1, 1, 1] } }
mass = 1
inertia = 1e9
position = [9, 0, 0]
collides_with = ["ground"]
[[variable]]
name = "ball_height"
sets = "ball.position[2]"
guess = 1
[[variable]]
name = "ball_speed"
sets = "ball.velocity[2]"
guess = -1
[[variable]]
name = "brick_height"
sets = "brick.position[2]"
guess = 1
[[variable]]
name = "brick_speed"
sets = "brick.velocity[2]"
guess = -1
[[cost]]
name = "ball"
value = "ball.position[2]"
[[cost]]
name = "brick"
value = "8 * brick.position[2]"
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("backend", "brick"), [("casadi", True), ("simd", False), thorough("casadi", False), thorough("simd", True)]
)
def test_compiled_kernels_keep_the_slope(backend: str, brick: bool) -> None:
    """z(T) = r + e (v T - (z0 - r)) by z0 and v, of a ball and of a brick or a rod, as on the virtual machine."""
    text = COMPILED if brick else COMPILED.replace(BRICK_SHAPE, ROD_SHAPE)
    starts = [0.5 + 0.125 * step * speed / 2 for step in (1, 5, 12) for speed in (1.0, 1.5)]
    starts = [z for at in starts for z in (at, np.nextafter(at, 9), np.nextafter(at, -9))]
    speeds = [-speed for _ in (1, 5, 12) for speed in (1.0, 1.5) for _ in range(3)]
    Z = np.array([[z, v, z, v] for z, v in zip(starts, speeds, strict=True)])
    values = transcribed(text, backend).shooting.evaluator.gradient(Z, 0.0)
    assert values.gradient is not None
    assert values.gradient == pytest.approx(np.tile([-0.5, -0.5, -4.0, -4.0], (len(Z), 1)), abs=1e-5)
    ends = 0.5 + 0.5 * (-Z[:, 1] - (Z[:, 0] - 0.5))
    assert values.objective == pytest.approx(9 * ends, abs=1e-5)
