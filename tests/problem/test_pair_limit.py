"""How many points of contact a world has: counted without listing them, refused where they are too many."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.model import shapes
from symphys.model.shapes import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    Fixture,
    Plane,
    Sphere,
    Terrain,
    contact_points,
)
from symphys.model.world import Law
from symphys.problem import Problem
from symphys.problem.limits import MAX_POINTS
from symphys.problem.parametric.collision_filter import KINDS, CollisionFilter
from symphys.problem.parametric.parts import PairRule, ParametricBody, ParametricStatic, Part
from symphys.problem.parametric.world import ParametricWorld

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]

BASE = "[simulation]\nduration = 1.0\ndt = 0.01\n[ground]\n"
BOX = "{ box = { size = [1, 1, 1] } }"
CUBE = Box((0.5, 0.5, 0.5))
EACH, DOWN, TOUCH = (contact_points(CUBE, other) for other in (CUBE, Plane("ground"), Capsule(0.1, 0.5)))
"""Points of a box against a box, the ground and a capsule."""


def crowd(count: int, keys: str = "", shape: str = BOX) -> str:
    body = '[[body]]\nname = "b{i}"\nshape = {shape}\nmass = 1\nposition = [{x}, 0, 1]\n{keys}\n'
    return "".join(body.format(i=i, x=2 * i, shape=shape, keys=keys) for i in range(count))


def test_number_contributors_and_remedy_are_named(refused: Refused, names: Names) -> None:
    error = refused(text=BASE + crowd(40))
    largest = rf"\(40 boxes against each other: {780 * EACH}, 40 boxes against ground: {40 * DOWN}\)"
    names(error, "body", f"{780 * EACH + 40 * DOWN} points .* 2000 are allowed {largest}; let")
    names(error, "body", "group, .* collides_with .* spheres in place of boxes")


def test_groups_and_compounds_are_called_by_name(refused: Refused) -> None:
    two = "{ parts = [{ box = { size = [1, 1, 1] } }, { capsule = { radius = 0.1, length = 1 } }] }"
    message = str(refused(text=BASE + crowd(40, 'group = "pins"') + crowd(1, shape=two).replace("b0", "tower")))
    assert f"40 boxes of pins against each other: {780 * EACH}" in message
    assert f"40 boxes of pins against tower: {40 * (EACH + TOUCH)}" in message


def test_spheres_are_not_advised_to_be_spheres(refused: Refused) -> None:
    balls = crowd(80, shape="{ sphere = { radius = 0.1 } }")
    message = str(refused(text=BASE + balls))
    assert "3240 points" in message
    assert "in place of" not in message


@pytest.mark.slow
def test_what_may_not_meet_does_not_count(load: Load) -> None:
    apart = BASE + crowd(40, 'group = "g"') + '[[pair]]\nbetween = ["g", "g"]\ncollide = false\n'
    assert len(load(text=apart).world().pairs) == 40 * DOWN
    assert len(load(text=BASE + crowd(40, 'collides_with = ["ground"]')).world().pairs) == 40 * DOWN


@pytest.mark.slow
def test_the_most_that_is_allowed(load: Load, refused: Refused) -> None:
    assert MAX_POINTS == 2000
    text = BASE + crowd(2000 // DOWN, 'collides_with = ["ground"]')
    assert len(load(text=text).world().pairs) == 2000
    more = text + '[[body]]\nname = "one"\nshape = { sphere = { radius = 1 } }\nmass = 1\ncollides_with = ["ground"]\n'
    assert "2001 points" in str(refused(text=more))


def plans(count: int, **keys: object) -> list[Part]:
    """Boxes b0, b1, ...; ``keys`` for all, functions of the index among them."""
    chosen = [{key: value(i) if callable(value) else value for key, value in keys.items()} for i in range(count)]
    usual = {"collides_with": None, "group": None}
    return [
        ParametricBody(f"b{i}", 1.0, None, (Box((1.0, 1.0, 1.0)),), False, 1.0, {}, **{**usual, **own})  # type: ignore[arg-type]
        for i, own in enumerate(chosen)
    ]


def lines_of(call: Callable[[], object]) -> int:
    """How many lines of Python a call executes."""
    count, before = 0, sys.gettrace()

    def trace(frame: object, event: str, argument: object) -> object:
        nonlocal count
        count += event == "line"
        return trace

    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"group": lambda i: f"g{i % 7}", "collides_with": lambda i: frozenset({f"g{i % 5}"})},
        {"collides_with": lambda i: frozenset({f"b{i + 1}", f"b{i - 1}"})},
    ],
    ids=["free", "groups", "chain"],
)
def test_the_work_of_counting_grows_as_the_number_of_parts(keys: dict[str, Any]) -> None:
    """Not as that of pairs: twice as many parts take at most twice as many lines."""

    def count(parts: list[Part]) -> None:
        assert CollisionFilter([*parts, ParametricStatic(Plane.ground(), {})], []).count(MAX_POINTS).points > MAX_POINTS

    few, many = (lines_of(partial(count, plans(n, **keys))) for n in (600, 1200))
    assert 600 < few < many <= 2.1 * few


def random_parts(rng: np.random.Generator) -> tuple[list[Part], list[PairRule]]:
    """A few bodies and statics with random groups, named and tables."""
    groups = [None, "g", "h"]
    surfaces = [Sphere(1.0), Box((1.0, 1.0, 1.0)), Capsule(1.0, 1.0)]
    names = [f"b{i}" for i in range(6)] + ["plane", "block"]

    def some(pool: list[str]) -> frozenset[str]:
        return frozenset(str(name) for name in rng.choice(pool, rng.integers(0, 4)))

    parts: list[Part] = []
    for name in names[:6]:
        held = tuple(surfaces[k] for k in rng.integers(0, 3, rng.integers(0, 3)))
        named = some(["g", "h", *(other for other in names if other != name)]) if rng.random() < 0.5 else None
        parts.append(ParametricBody(name, 1.0, None, held, False, 1.0, {}, named, groups[rng.integers(3)]))
    parts.append(ParametricStatic(Plane("plane"), {}, groups[rng.integers(3)]))
    parts.append(ParametricStatic(Fixture("block", Box((1.0, 1.0, 1.0))), {}, groups[rng.integers(3)]))
    tables = {frozenset(str(n) for n in rng.choice([*names, "g", "h"], 2)) for _ in range(rng.integers(0, 6))}
    kept = [table for table in sorted(tables, key=sorted) if len(table) == 2 or table <= {"g", "h"}]
    return parts, [PairRule("-".join(sorted(table)), table, bool(rng.random() < 0.4), {}) for table in kept]


def contradicts(plan: ParametricWorld, a: Part, b: Part) -> bool:
    """Whether tables of one rank say different things about two parts; a file with such tables is refused."""
    if any(pair.between == {a.name, b.name} for pair in plan.pairs):
        return False
    keys = [frozenset((a.name, b.group)), frozenset((b.name, a.group))]
    return len({pair.collide for pair in plan.pairs if pair.between in keys}) > 1


@pytest.mark.parametrize("seed", range(40))
def test_classes_meet_as_their_members_do(seed: int) -> None:
    """Counting and listing by classes gives what looking at every two parts gives."""
    parts, tables = random_parts(np.random.default_rng(seed))
    bodies = tuple(part for part in parts if isinstance(part, ParametricBody))
    statics = tuple(part for part in parts if not isinstance(part, ParametricBody))
    plan = ParametricWorld(bodies, statics, tuple(tables), Law(), (0, 0, -9.81))
    if any(contradicts(plan, a, b) for a, b in combinations(parts, 2)):
        tables, plan = [], replace(plan, pairs=())
    expected = []
    for (i, a), (j, b) in combinations(enumerate(parts), 2):
        table = plan.pair(a.name, b.name)
        meet = i < len(bodies) and plan.lets(a.name, b.name) and plan.lets(b.name, a.name)
        if meet and (table is None or table.collide) and a.surfaces and b.surfaces:
            expected.append((i, j))
    assert list(plan.collision_pairs) == expected
    points = sum(contact_points(s, t) for i, j in expected for s in parts[i].surfaces for t in parts[j].surfaces)
    assert CollisionFilter(parts, tables).count(MAX_POINTS).points == points
    assert len(plan.world({}).pairs) == points


def test_every_kind_of_surface_is_counted() -> None:
    assert set(KINDS) == {Sphere, Capsule, Box, Cylinder, Ellipsoid, Convex, Plane, Terrain}
    assert {kind for both in shapes.POINTS for kind in both} == set(KINDS)


def test_surfaces_that_no_rule_covers(
    refused: Refused, load: Load, names: Names, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(shapes.POINTS, (Box, Terrain))
    hills = '[[terrain]]\nname = "hills"\nheight = "x"\n'
    names(refused(text=BASE + hills + crowd(2)), "body", "is not known: b0 and hills.*collides_with .* collide = false")
    apart = '[[pair]]\nbetween = ["hills", "g"]\ncollide = false\n'
    assert len(load(text=BASE + hills + crowd(2, 'group = "g"') + apart).world().pairs) == EACH + 2 * DOWN
