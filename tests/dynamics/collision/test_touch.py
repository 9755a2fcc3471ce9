"""The instant of touch, on bodies that move numerically: it is the first one at which the distance is zero."""

from __future__ import annotations

import numpy as np
import pytest
from tools.distances import distance
from tools.repeats import few, first, thorough
from worlds.meetings import STILL, Meet, Thing, flying, met, moved_to, random_thing, rule, shifted

from symphys.model.shapes import Plane, Terrain
from symphys.types import Array

KINDS = ("sphere", "capsule", "box")
PAIRS = [(a, b) for a in KINDS for b in KINDS]
DT = 0.01
THIN = {"sphere": np.array([0.05]), "capsule": np.array([0.02, 0.4]), "box": np.array([0.4, 0.3, 0.01])}


def course(a: Thing, b: Thing, until: float, samples: int = 24) -> Array:
    """Distances on the way, the last of them at ``until``."""
    return np.array([distance(a.at(t), b.at(t)) for t in np.linspace(0, until, samples)])


def approaching(
    rng: np.random.Generator, pair: tuple[str, str], speed: float, spin: float, dt: float = DT
) -> list[Thing]:
    """Two things that may meet within a step or may not, both turning."""
    a, b = (random_thing(rng, kind) for kind in pair)
    a = moved_to(a, b, speed * dt * rng.uniform(0, 0.8), rng)
    way = b.at(0).centre - a.at(0).centre
    aside = rng.normal(size=(2, 3)) * 0.3
    return [
        flying(a, speed * (way / np.linalg.norm(way) + aside[0]), spin * rng.normal(size=3), 5 * rng.normal(size=3)),
        flying(b, speed * aside[1], spin * rng.normal(size=3)),
    ]


def fault(a: Thing, b: Thing, found: Meet, dt: float = DT) -> float:
    """How wrong a touch is [m]: what is left between the surfaces, or how deep they are in each other before it."""
    if np.isinf(found.first):
        return float(max(-course(a, b, dt).min(), 0))
    return float(max(abs(distance(a.at(found.first), b.at(found.first))), -course(a, b, found.first).min()))


@pytest.mark.parametrize(("speed", "spin"), [(5.0, 5.0), thorough(1.0, 1.0), thorough(10.0, 0.0)])
@few("pair", PAIRS, 3)
def test_touch_is_where_the_distance_ends(pair: tuple[str, str], speed: float, spin: float) -> None:
    """Hits, misses and instants. Arms are parabolas of time, so that of turning bodies is off by (w dt)^3 / 6 of them.

    What two boxes touch with is chosen where they would meet if their distances changed evenly. Where that is off by
    (w dt)^2 and another corner or edge is as near, the one that is not chosen is found a little late, or too early.
    """
    rng, function = np.random.default_rng(PAIRS.index(pair)), rule(*pair)
    faults, hits = [], 0
    for _ in range(30):
        a, b = approaching(rng, pair, speed, spin)
        found = met(function, *a.numbers(), *b.numbers(), DT)
        faults.append(fault(a, b, found))
        hits += np.isfinite(found.first)
    assert hits >= 15
    third = 1e-9 + (4 * spin * DT) ** 3 / 6
    if "box" not in pair or "sphere" in pair:
        assert max(faults) < third
    else:
        assert np.sort(faults)[-3] < third
        assert max(faults) < third + (4 * spin * DT) ** 2


@few("pair", [("sphere", "box"), ("capsule", "capsule"), ("capsule", "box"), ("box", "box")], 1)
def test_error_is_of_third_order(pair: tuple[str, str]) -> None:
    """Half the step, an eighth of the error: bodies that turn by 0.2 in it."""
    worst = []
    for dt in (0.02, 0.01, 0.005):
        rng, function, faults = np.random.default_rng(0), rule(*pair), []
        for _ in range(24):
            a, b = approaching(rng, pair, 3.0, 6.0, dt)
            faults.append(fault(a, b, met(function, *a.numbers(), *b.numbers(), dt), dt))
        worst.append(np.median([f for f in faults if f > 1e-13]))
    assert worst[2] < worst[0] / 20


@first("travel", [2.0, 0.5])
@few("wall", KINDS, 2)
@few("kind", KINDS, 1)
def test_nothing_flies_through_thin_walls(kind: str, wall: str, travel: float) -> None:
    """Many times its size and the wall's within one step, straight on or past: hit when, and only when, it must be.

    What only grazes may be missed, as deep as Newton's method has not come by then.
    """
    rng, function = np.random.default_rng(5), rule(kind, wall, static=True)
    seen = {True: 0, False: 0}
    for _ in range(25):
        b = Thing(wall, THIN[wall], random_thing(rng, wall).place)
        a = random_thing(rng, kind)
        a = moved_to(Thing(kind, a.size * 0.2, a.place, a.motion), b, travel * rng.uniform(0.05, 0.3), rng)
        way = b.at(0).centre + rng.normal(size=3) * 0.25 - a.at(0).centre
        a = flying(a, way / np.linalg.norm(way) * travel / DT)
        found = met(function, *a.numbers(), *b.numbers(), DT)
        if np.isfinite(found.first):
            assert abs(distance(a.at(found.first), b.at(found.first))) < 1e-6
            assert course(a, b, found.first * 0.999, 20).min() > 0
        else:
            assert course(a, b, DT, 100).min() > -1e-3
        seen[bool(np.isfinite(found.first))] += 1
    assert min(seen.values()) >= 2


@pytest.mark.parametrize("pair", PAIRS)
def test_what_lies_still_or_parts_is_not_hit(pair: tuple[str, str]) -> None:
    """Apart, in common motion or moving away."""
    rng, function = np.random.default_rng(9), rule(*pair)
    for k in range(12):
        b = random_thing(rng, pair[1])
        a = moved_to(random_thing(rng, pair[0]), b, 10.0 ** -(k % 6), rng)
        common = rng.normal(size=3)
        found = met(function, *a.numbers(), *b.numbers(), DT)
        way = found.normal[np.argmin(found.gap)]
        for speed in (0.0, 3.0) if found.gap.min() < 1 else (0.0,):
            parts = flying(a, common + speed * way).numbers(), flying(b, common).numbers()
            assert not met(function, *parts[0], *parts[1], DT).hit.any()


@few("kind", KINDS, 3)
@pytest.mark.parametrize("static", ["plane", "terrain"])
def test_touching_ground(kind: str, static: str) -> None:
    """A slope as a plane, and as terrain; a paraboloid follows in the next test."""
    normal = np.array([-0.5, 0.3, 1]) / np.sqrt(1.34)
    ground = Plane("p", tuple(normal)) if static == "plane" else Terrain("t", lambda x, y: 0.5 * x - 0.3 * y)
    rng, function = np.random.default_rng(3), rule(kind, "", surface=ground)
    for _ in range(20):
        a = random_thing(rng, kind)
        lowest = (a.at(0).corners() @ normal).min() - a.at(0).radius
        a = flying(a, 3 * rng.normal(size=3) - [0, 0, 5], 2 * rng.normal(size=3), [0, 0, -9.81])
        a = Thing(kind, a.size, a.place, a.motion - np.concatenate([(lowest - 0.03) * normal, np.zeros(16)]))
        found = met(function, *a.numbers(), [], np.zeros(7), STILL, DT)

        def height(t: float, a: Thing = a) -> float:
            return float((a.at(t).corners() @ normal).min() - a.at(t).radius)

        if np.isfinite(found.first):
            assert height(found.first) == pytest.approx(0, abs=2e-5)
        else:
            assert height(DT) > -2e-5


def test_a_ball_falls_into_a_bowl() -> None:
    """Of radius .1 into z = x^2 + y^2 / 2: the paraboloid is exact there, and so is the instant."""
    function = rule("sphere", "", surface=Terrain("bowl", lambda x, y: x * x + y * y / 2))
    for speed in (8.0, 4.0):
        a = flying(Thing("sphere", np.array([0.1])), [speed, 0.3 * speed, -2 * speed])
        a = shifted(a, np.array([0.1, 0.1, 0.12 + 0.01 * speed]))
        found = met(function, *a.numbers(), [], np.zeros(7), STILL, DT)
        centre = a.at(found.first).centre
        x, y = np.meshgrid(*(c + np.linspace(-0.15, 0.15, 1001) for c in centre[:2]))
        squares = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (x * x + y * y / 2 - centre[2]) ** 2
        assert found.hit.all()
        assert np.sqrt(squares.min()) == pytest.approx(0.1, abs=1e-6)
