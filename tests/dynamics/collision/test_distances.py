"""The smallest gap of a pair's points is the distance between the surfaces, as brute force finds it."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize
from tools.distances import distance
from tools.repeats import few
from worlds.meetings import PLACE, STILL, Thing, met, moved_to, random_thing, rule, shifted

from symphys.dynamics.collision.pairs.box_box import RIM_SHARE
from symphys.model.shapes import POINTS, SHAPES, Plane, Terrain
from symphys.types import Array

KINDS = ("sphere", "capsule", "box")
PAIRS = [(a, b) for a in KINDS for b in KINDS]
ROUNDING = 1e-12
SHIFT = RIM_SHARE * 0.5
"""[m] how far beyond the rim of the largest box here a corner still counts."""


def errors(pair: tuple[str, str], gap: float, static: bool, count: int = 16) -> Array:
    """(count,): smallest gap less distance, for random poses ``gap`` apart."""
    rng, function = np.random.default_rng(PAIRS.index(pair) + 100 * static), rule(*pair, static=static)
    found = []
    for _ in range(count):
        b = random_thing(rng, pair[1], static)
        a = moved_to(random_thing(rng, pair[0]), b, gap, rng)
        assert distance(a.at(0), b.at(0)) == pytest.approx(gap, abs=1e-9)
        found.append(met(function, *a.numbers(), *b.numbers(), 0.01).gap.min() - gap)
    return np.array(found)


@few("static", [False, True], 1)
@few("gap", [0.1, 0.01, 1e-5, -1e-3], 2)
@few("pair", PAIRS, 11)
def test_smallest_gap_is_the_distance(pair: tuple[str, str], gap: float, static: bool) -> None:
    """In random poses. Two boxes have no point where corners or edges pass beside each other without touching yet."""
    found = errors(pair, gap, static)
    if pair != ("box", "box"):
        assert np.abs(found).max() < 1e-9
        return
    assert found.min() > -max(SHIFT, abs(gap) / 2)
    assert np.quantile(np.abs(found), 0.75 if gap > 0.01 else 0.9) < 1e-9
    if gap < 1e-4:
        assert found.max() < 1e-9


def at(kind: str, size: Any, position: Any, turn: Any = (1, 0, 0, 0)) -> Thing:
    """A thing that does not move."""
    return Thing(kind, np.array(size, float), motion=np.concatenate([position, turn, np.zeros(12)]))


EIGHTH = (np.cos(np.pi / 8), np.sin(np.pi / 8))
ONTO_EDGE, OTHER_EDGE = (EIGHTH[0], EIGHTH[1], 0, 0), (EIGHTH[0], 0, EIGHTH[1], 0)
ONTO_CORNER = np.array([np.cos(a := np.arctan(np.sqrt(2)) / 2), np.sin(a) / np.sqrt(2), np.sin(a) / np.sqrt(2), 0])
QUARTER = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
BESIDE = {
    "face on face": (at("box", (0.5, 0.4, 0.1), (0.1, 0.2, 0.31)), at("box", (0.3, 0.3, 0.2), (0, 0, 0)), 0.01, 4),
    "flush": (at("box", (0.3, 0.3, 0.1), (0, 0, 0.31)), at("box", (0.3, 0.3, 0.2), (0, 0, 0)), 0.01, 4),
    "edge on face": (
        at("box", (0.2, 0.1, 0.1), (0, 0, 0.1 * np.sqrt(2) + 0.21), ONTO_EDGE),
        at("box", (0.5, 0.5, 0.2), (0, 0, 0)),
        0.01,
        2,
    ),
    "edge across edge": (
        at("box", (0.4, 0.1, 0.1), (0, 0, 0.2 * np.sqrt(2) + 0.01), ONTO_EDGE),
        at("box", (0.1, 0.4, 0.1), (0, 0, 0), OTHER_EDGE),
        0.01,
        1,
    ),
    "corner on face": (
        at("box", (0.1, 0.1, 0.1), (0, 0, 0.1 * np.sqrt(3) + 0.21), ONTO_CORNER),
        at("box", (0.5, 0.5, 0.2), (0, 0, 0)),
        0.01,
        1,
    ),
    "face under corner": (
        at("box", (0.5, 0.5, 0.2), (0.1, 0, 0.1 * np.sqrt(3) + 0.21)),
        at("box", (0.1, 0.1, 0.1), (0, 0, 0), ONTO_CORNER),
        0.01,
        1,
    ),
    "rod along rod": (
        at("capsule", (0.1, 0.4), (0.21, 0, 0.3)),
        at("capsule", (0.1, 0.4), (0, 0, 0)),
        0.01,
        2,
    ),
    "rod across rod": (
        at("capsule", (0.1, 0.4), (0.21, 0.1, 0.2), QUARTER),
        at("capsule", (0.1, 0.4), (0, 0, 0)),
        0.01,
        1,
    ),
    "rod on end": (at("capsule", (0.1, 0.4), (0.02, 0.01, 0.61)), at("box", (0.5, 0.5, 0.1), (0, 0, 0)), 0.01, 1),
    "rod on face": (
        at("capsule", (0.1, 0.4), (0.2, 0, 0.21), QUARTER),
        at("box", (0.5, 0.5, 0.1), (0, 0, 0)),
        0.01,
        2,
    ),
    "rod over edges": (
        at("capsule", (0.1, 0.6), (0, 0.05, 0.21), QUARTER),
        at("box", (0.3, 0.3, 0.1), (0, 0, 0)),
        0.01,
        2,
    ),
}
"""Two things, how far apart, in how many places they will touch."""


@few("name", BESIDE, 11)
@pytest.mark.parametrize("flip", [False, True])
def test_aligned_shapes_touch_where_they_should(name: str, flip: bool) -> None:
    """Faces, edges and corners along each other: the gap, and that the points carry all of the region."""
    a, b, gap, places = BESIDE[name]
    if flip:
        a, b = b, a
    assert distance(a.at(0), b.at(0)) == pytest.approx(gap, abs=1e-9)
    found = met(rule(a.kind, b.kind), *a.numbers(), *b.numbers(), 0.01)
    near = found.gap < gap + 1e-6
    assert found.gap.min() == pytest.approx(gap, abs=ROUNDING)
    where = np.round(found.arms[0][near] + a.motion[:3], 9)
    assert len(np.unique(where, axis=0)) == places


@pytest.mark.parametrize("kind", KINDS)
def test_planes(kind: str) -> None:
    """The distance from a plane is that of the lowest point of the core, less the radius."""
    rng = np.random.default_rng(1)
    normal = np.array([0.36, -0.48, 0.8])
    function = rule(kind, "", surface=Plane("p", tuple(normal), 0.3))
    for _ in range(20):
        a = random_thing(rng, kind)
        solid = a.at(0)
        found = met(function, *a.numbers(), [], np.zeros(PLACE), STILL, 0.01)
        assert found.gap.min() == pytest.approx((solid.corners() @ normal).min() - 0.3 - solid.radius, abs=ROUNDING)


def waves(x: Any, y: Any) -> Any:
    return 0.1 * ca.sin(3 * x) * ca.cos(2 * y)


SURFACES = {
    "bowl": lambda x, y: 0.3 * x * x + 0.1 * y * y,
    "hill": lambda x, y: -0.4 * x * x - 0.2 * y * y + 0.1 * x * y,
    "slope": lambda x, y: 0.5 * x - 0.3 * y,
    "waves": waves,
}
NUMERIC = SURFACES | {"waves": lambda x, y: 0.1 * np.sin(3 * x) * np.cos(2 * y)}


def from_surface(name: str, point: Array) -> float:
    """Distance of a point from a surface: the nearest of a grid, then a search from there; negative below."""
    height = NUMERIC[name]

    def square(xy: Array) -> Any:
        return (xy[0] - point[0]) ** 2 + (xy[1] - point[1]) ** 2 + (height(xy[0], xy[1]) - point[2]) ** 2

    grid = np.stack(np.meshgrid(*(point[i] + np.linspace(-1, 1, 41) for i in range(2)))).reshape(2, -1)
    best = grid[:, np.argmin(square(grid))]
    found = minimize(square, best, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-18})
    return float(np.sqrt(found.fun) * np.sign(point[2] - height(point[0], point[1])))


@few("name", SURFACES, 2)
@few("kind", KINDS, 2)
def test_terrain(name: str, kind: str) -> None:
    """Where each ball or corner is, from a little inside to well above."""
    rng, function = np.random.default_rng(2), rule(kind, "", surface=Terrain(name, SURFACES[name]))
    for _ in range(8):
        a = random_thing(rng, kind)
        a = Thing(a.kind, a.size / 2, a.place, a.motion)
        lowest = min(p[2] - NUMERIC[name](p[0], p[1]) - a.at(0).radius for p in a.at(0).corners())
        a = shifted(a, np.array([0, 0, rng.uniform(-0.01, 0.15) - lowest]))
        solid = a.at(0)
        expected = min(from_surface(name, corner) for corner in solid.corners()) - solid.radius
        found = met(function, *a.numbers(), [], np.zeros(PLACE), STILL, 0.01)
        assert found.gap.min() == pytest.approx(expected, abs=1e-7)


@pytest.mark.slow
def test_every_rule_gives_the_points_that_it_announces() -> None:
    names = {kind.__name__: name for name, kind in SHAPES.items()}
    surfaces = {"Plane": Plane.ground(), "Terrain": Terrain("t", lambda x, y: ca.SX(0))}
    for (first, second), count in POINTS.items():
        a, b = names[first.__name__], names.get(second.__name__, "")
        function = rule(a, b, surface=surfaces.get(second.__name__))
        assert function.size1_out(0) == count
