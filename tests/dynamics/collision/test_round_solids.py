"""Cylinders, ellipsoids and hulls against ground, spheres and capsules: gaps, frames, instants and derivatives."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq, nnls
from tools.repeats import few
from worlds.meetings import PLACE, STILL, Thing, course, flying, later, matrix, met, random_thing, rule, shifted
from worlds.meetings import shape as make
from worlds.slopes import compared, some_way

from symphys.dynamics.collision import collide
from symphys.dynamics.collision.predicted_path import at_rest
from symphys.model.shapes import Convex, Cylinder, Ellipsoid, Plane, Terrain
from symphys.types import Array

KINDS = ("cylinder", "ellipsoid", "convex")
ROUND = [("sphere", "cylinder"), ("sphere", "ellipsoid"), ("sphere", "convex")]
RODS = [("capsule", "cylinder"), ("capsule", "ellipsoid")]
NORMAL = np.array([0.36, -0.48, 0.8])
DT = 0.01
PLAIN = {"slope": lambda x, y: 0.5 * x - 0.3 * y, "bowl": lambda x, y: 0.15 * x * x + 0.1 * y * y}


def surface_points(thing: Thing, t: float = 0.0, count: int = 180) -> Array:
    """(n, 3): points of the surface in the world at a time, from its definition; corners of a hull."""
    solid = make(thing.kind, thing.size, thing.place)
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, count), np.linspace(0, np.pi, count))
    if isinstance(solid, Cylinder):
        around = np.linspace(0, 2 * np.pi, 30 * count)
        rim = np.stack([np.cos(around), np.sin(around)]) * solid.radius
        own = np.concatenate(
            [np.vstack([rim, np.full(rim.shape[1], end)]).T for end in (-solid.half_length, solid.half_length)]
        )
    elif isinstance(solid, Ellipsoid):
        ball = np.stack([np.sin(b) * np.cos(a), np.sin(b) * np.sin(a), np.cos(b)], axis=-1).reshape(-1, 3)
        own = ball * np.array(solid.radii, float)
    else:
        own = np.array(solid.points)
    place, axes = pose(thing, t)
    return np.asarray(place + own @ axes.T)


def pose(thing: Thing, t: float) -> tuple[Array, Array]:
    """Centre (3,) and axes (3, 3) of the shape in the world at time t, by exact rotation."""
    solid = (
        thing.at(t) if thing.kind in ("sphere", "capsule", "box") else Thing("sphere", np.ones(1), *place(thing)).at(t)
    )
    return solid.centre, solid.axes


def place(thing: Thing) -> tuple[Array, Array]:
    """Where a thing is on its body, and how that moves."""
    return thing.place, thing.motion


def to_solid(point: Array, thing: Thing, t: float = 0.0) -> float:
    """[m]: from a point outside to the nearest point of a solid, by its definition."""
    centre, axes = pose(thing, t)
    p, solid = axes.T @ (point - centre), make(thing.kind, thing.size, thing.place)
    if isinstance(solid, Cylinder):
        rho = np.hypot(p[0], p[1])
        return float(np.hypot(max(rho - solid.radius, 0), max(abs(p[2]) - solid.half_length, 0)))
    if isinstance(solid, Ellipsoid):
        radii = np.array(solid.radii, float)

        def excess(m: float) -> float:
            return float(np.sum((radii * p / (radii**2 + m)) ** 2) - 1)

        m = brentq(excess, 0, 10 + 10 * np.sum(p * p), xtol=1e-15) if excess(0) > 0 else 0.0
        return float(np.linalg.norm(p - radii**2 * p / (radii**2 + m)))
    corners, weight = np.array(solid.points), 1e4
    shares = nnls(np.vstack([corners.T, weight * np.ones(len(corners))]), np.append(p, weight))[0]
    return float(np.linalg.norm(corners.T @ shares / shares.sum() - p))


def test_points_that_are_inside_have_no_distance() -> None:
    """The yardstick itself."""
    for kind in KINDS:
        thing = random_thing(np.random.default_rng(0), kind)
        assert to_solid(pose(thing, 0)[0], thing) < 1e-6 or kind == "ellipsoid"
        assert to_solid(surface_points(thing).mean(axis=0) + np.array([0, 0, 5]), thing) > 3


def ground(name: str) -> Any:
    return Plane("p", tuple(NORMAL), 0.3) if name == "plane" else Terrain(name, PLAIN[name])


def heights(points: Array, name: str) -> Array:
    """(n,): distances of points from the ground, along its normal there; exact for flat ground."""
    if name == "plane":
        return np.asarray(points @ NORMAL - 0.3)
    x, y, z = points.T
    slope = np.array([0.5, -0.3]) if name == "slope" else np.stack([0.3 * x, 0.2 * y])
    return np.asarray((z - PLAIN[name](x, y)) / np.sqrt(1 + (slope**2).sum(axis=0)))


def lowered(thing: Thing, name: str, gap: float) -> Thing:
    """The thing with its lowest point so high over the ground."""
    for _ in range(4):
        thing = shifted(thing, np.array([0, 0, gap - heights(surface_points(thing), name).min()]))
    return thing


def down(kind: str, name: str) -> Any:
    return rule(kind, "", surface=GROUNDS[name])


GROUNDS = {name: ground(name) for name in ("plane", *PLAIN)}


@few("name", GROUNDS, 2)
@few("kind", KINDS, 2)
def test_the_smallest_gap_is_that_of_the_lowest_point(kind: str, name: str) -> None:
    """Of all points of the surface: those of a fine grid, and of a hull all corners.

    In a bowl the distance here is along the normal below, which is right to second order.
    """
    rng = np.random.default_rng(1)
    for _ in range(12):
        thing = lowered(random_thing(rng, kind), name, rng.uniform(-0.01, 0.1))
        gap = met(down(kind, name), *thing.numbers(), [], np.zeros(PLACE), STILL, DT).gap.min()
        expected = heights(surface_points(thing), name).min()
        assert gap == pytest.approx(
            expected, abs=1e-9 if kind == "convex" and name != "bowl" else 2e-3 if name == "bowl" else 1e-4
        )


@pytest.mark.parametrize("kind", KINDS)
def test_the_instant_of_touch(kind: str) -> None:
    """The lowest point is on the ground then, to third order of the turn, and was over it before."""
    rng, hits = np.random.default_rng(3), 0
    for _ in range(12):
        thing = lowered(random_thing(rng, kind), "plane", 0.03)
        thing = flying(thing, rng.normal(size=3) - 6 * NORMAL, 2 * rng.normal(size=3), [0, 0, -9.81])
        found = met(down(kind, "plane"), *thing.numbers(), [], np.zeros(PLACE), STILL, DT)
        ends = heights(surface_points(thing, DT), "plane").min()
        assert np.isfinite(found.first) == (ends < 0)
        if np.isfinite(found.first):
            assert heights(surface_points(thing, found.first), "plane").min() == pytest.approx(0, abs=1e-4)
            hits += 1
    assert hits >= 8


@pytest.mark.parametrize("kind", KINDS)
def test_gap_after_a_turn(kind: str) -> None:
    """To second order of the displacement."""
    rng = np.random.default_rng(4)
    for _ in range(8):
        thing = lowered(random_thing(rng, kind), "plane", 0.001)
        shift = 3e-3 * rng.normal(size=6)
        function = later(kind, "", surface=GROUNDS["plane"])
        gaps = np.array(function(*thing.numbers(), [], np.zeros(PLACE), STILL, DT, shift, np.zeros(6)))
        end = heights(surface_points(flying(thing, shift[:3] / DT, shift[3:] / DT), DT), "plane").min()
        assert gaps.min() == pytest.approx(end, abs=1e-4)


def test_a_cylinder_on_its_face_has_three_points_that_hold_it() -> None:
    """On a level face, one that is tilted by rounding, and one that is tilted by little."""
    for tilt in (0.0, 1e-12, 1e-5):
        turn = np.array([np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
        thing = Thing("cylinder", np.array([0.2, 0.3]), motion=np.concatenate([[0, 0, 0.3], turn, np.zeros(12)]))
        found = met(rule("cylinder", "", surface=Plane.ground()), *thing.numbers(), [], np.zeros(PLACE), STILL, DT)
        near = found.gap < 0.1
        assert near.sum() == 3
        arms = found.arms[0][near][:, :2]
        assert np.linalg.norm(arms, axis=1) == pytest.approx([0.2] * 3, abs=1e-5)
        assert arms.sum(axis=0) == pytest.approx([0, 0], abs=1e-5)
        assert found.gap.min() == pytest.approx(-0.2 * tilt, abs=1e-9)


def outside(pair: tuple[str, str], rng: np.random.Generator, gap: float) -> tuple[Thing, Thing]:
    """A sphere or capsule beside a solid, roughly ``gap`` apart."""
    b = random_thing(rng, pair[1])
    a = random_thing(rng, pair[0])
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    a = shifted(a, pose(b, 0)[0] - pose(a, 0)[0] + 3 * way)
    for _ in range(12):
        a = shifted(a, -(between(a, b) - gap) * 0.7 * way)
    return a, b


def between(a: Thing, b: Thing, t: float = 0.0) -> float:
    """[m] from the surface of a sphere or capsule to that of a solid."""
    centre, axes = pose(a, t)
    half = a.size[1] if a.kind == "capsule" else 0.0
    shares = np.linspace(-1, 1, 41) if half else np.zeros(1)
    away = [to_solid(centre + s * half * axes[:, 2], b, t) for s in shares]
    k = int(np.argmin(away))
    if half and 0 < k < 40:
        fine = np.linspace(shares[k - 1], shares[k + 1], 21)
        away = [to_solid(centre + s * half * axes[:, 2], b, t) for s in fine]
    return float(min(away) - a.size[0])


@few("pair", [*ROUND, *RODS], 2)
def test_balls_and_rods_beside_solids(pair: tuple[str, str]) -> None:
    """The smallest gap is the distance; where it is, both arms end in one place half the gap from either surface."""
    rng, function = np.random.default_rng(7), rule(*pair)
    for k in range(8 if pair in ROUND else 4):
        a, b = outside(pair, rng, 0.1 if k % 2 else 0.004)
        found = met(function, *a.numbers(), *b.numbers(), DT)
        assert found.gap.min() == pytest.approx(between(a, b), abs=1e-7 if pair in ROUND else 1e-5)
        at = int(found.gap.argmin())
        assert np.linalg.norm(found.normal[at]) == pytest.approx(1, abs=1e-9)
        toward = flying(a, -3 * max(found.gap[at], 0.01) / DT * found.normal[at], rng.normal(size=3))
        hit = met(function, *toward.numbers(), *b.numbers(), DT)
        assert between(toward, b, hit.first) == pytest.approx(0, abs=2e-4)
        k = int(np.argmin(np.where(hit.hit > 0, hit.time, np.inf)))
        points = [x.centre_of_mass(hit.time[k]) + arm[k] for x, arm in zip((toward, b), hit.arms, strict=True)]
        assert points[0] == pytest.approx(points[1], abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_deep_inside_everything_is_finite(kind: str) -> None:
    """At the centre, on the axes and far away."""
    b = Thing(kind, np.array([0.1, 0.3, 0.2][: 3 if kind == "ellipsoid" else 2 if kind == "cylinder" else 0]))
    for place_of_ball in ([0, 0, 0], [0.01, 0, 0], [0, 0.05, 0], [0, 0, 0.1], [0.1, 0, 0], [0, 0, 1e6]):
        a = shifted(Thing("sphere", np.array([0.05])), np.array(place_of_ball, float))
        found = met(rule("sphere", kind), *a.numbers(), *b.numbers(), DT)
        assert all(np.isfinite(part).all() for part in (found.gap, found.rate, found.time, found.normal, *found.arms))


@few("pair", [*ROUND, *RODS, ("cylinder", ""), ("ellipsoid", ""), ("convex", "")], 3)
def test_derivatives(pair: tuple[str, str]) -> None:
    """Of gap, rate, time and frame along random ways, against central differences; on waves for those without other."""
    rng, worst = np.random.default_rng(8), []
    for _ in range(6):
        if pair[1]:
            a, b = outside(pair, rng, 0.005)
            a = flying(a, 2 * (pose(b, 0)[0] - pose(a, 0)[0]), rng.normal(size=3))
            z = np.concatenate([*a.numbers(), *b.numbers(), [DT]])
        else:
            a = flying(random_thing(rng, pair[0]), [1, 0, -2], rng.normal(size=3), [0, 0, -9.81])
            z = np.concatenate([*a.numbers(), np.zeros(26), [DT]])
            z[len(a.size) + 9] += 0.5 - a.motion[2]
        exact, differences = compared(pair, z, some_way(rng, z, pair), terrain=not pair[1])
        worst.append(np.abs(exact - differences).max(initial=0) / (1 + np.abs(exact).max(initial=0)))
    assert np.sort(worst)[-2] < 1e-5


def test_a_hull_of_many_corners_stands_on_those_around_its_face() -> None:
    """A drum of 32 corners a face: six of them, all around, whichever way it leans by little."""
    turns = np.linspace(0, 2 * np.pi, 33)[:-1]
    drum = Convex(np.array([(0.2 * np.cos(a), 0.2 * np.sin(a), z) for a in turns for z in (-0.3, 0.3)]))
    motion = ca.SX.sym("motion", 19)
    found = collide(drum, Plane.ground(), course(motion, DT), at_rest(DT))
    function = ca.Function("drum", [motion], [ca.vertcat(*(c.gap for c in found)), arms(found)])
    for axis in ((1, 0, 0), (0, 1, 0), (0.6, 0.8, 0)):
        for tilt in (0.0, 1e-12, 1e-5, 1e-3):
            turn = np.append(np.cos(tilt / 2), np.sin(tilt / 2) * np.array(axis))
            gaps, points = (np.array(x) for x in function(np.concatenate([[0, 0, 0.3], turn, np.zeros(12)])))
            near = gaps[:, 0] < 0.1
            around = np.sort(np.arctan2(points[near, 1], points[near, 0]))
            assert np.diff(np.append(around, around[0] + 2 * np.pi)).max() < 1.6
            lowest = (np.array(drum.points) @ matrix(turn)[2]).min() + 0.3
            assert gaps.min() == pytest.approx(lowest, abs=5e-7)


def arms(found: list[Any]) -> Any:
    """(n, 3): from the centre of mass to each point."""
    return ca.horzcat(*(contact.geometry.frame(ca.SX(0)).arms[0] for contact in found)).T


def test_casadi_takes_every_rule_with_symbols_of_no_value() -> None:
    """A derivative at a cylinder that stands exactly on its face is finite."""
    thing = Thing("cylinder", np.array([0.2, 0.3]), motion=np.concatenate([[0, 0, 0.3, 1, 0, 0, 0], np.zeros(12)]))
    z = [*thing.numbers(), [], np.zeros(PLACE), STILL, DT]
    function = rule("cylinder", "", surface=Plane.ground())
    slopes = function.jacobian()(*z, *function.call([ca.DM(each) for each in z]))
    assert all(np.isfinite(np.array(part)).all() for part in slopes)
