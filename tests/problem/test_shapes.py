"""Bodies that are boxes, capsules and compounds: their mass and inertia, and the sizes that variables may set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from tools.repeats import few

from symphys.maths import rotation
from symphys.model.shapes import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from symphys.model.shapes.inertia import specific
from symphys.problem import Problem
from symphys.types import Array

Load = Callable[..., Problem]

BASE = "[simulation]\nduration = 1.0\ndt = 0.01\n"
TILTED = (np.cos(0.4), 0.0, np.sin(0.4) * 0.6, np.sin(0.4) * 0.8)
BOX = Box((0.1, 0.2, 0.3))
CAPSULE = Capsule(0.1, 0.25)
SIZES = "{ box = { size = [0.2, 0.4, 0.6] } }"


def thing(shape: str, keys: str = "mass = 3.0") -> str:
    return f'{BASE}[[body]]\nname = "thing"\nshape = {shape}\n{keys}\n'


def inside(shape: Shape, points: Array) -> NDArray[np.bool_]:
    """Which of (n, 3) points of the body frame belong to a shape."""
    points = points - np.array(shape.centre)
    if not isinstance(shape, Sphere):
        points = points @ np.array(rotation.matrix(ca.DM(shape.orientation)))
    if isinstance(shape, Box):
        return np.asarray((np.abs(points) <= np.array(shape.half_sizes)).all(axis=1))
    half = shape.half_length if isinstance(shape, Capsule) else 0.0
    points[:, 2] -= np.clip(points[:, 2], -half, half)
    return np.asarray((points**2).sum(axis=1) <= shape.radius**2)


def integrated(shapes: tuple[Shape, ...]) -> tuple[float, Array]:
    """Volume and inertia per mass about the origin, summed over a fine grid of cells; parts count one by one."""
    side = np.linspace(-0.6, 0.6, 121)
    points = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    held = np.concatenate([points[inside(shape, points)] for shape in shapes])
    second = held.T @ held / len(held)
    return len(held) * (side[1] - side[0]) ** 3, np.trace(second) * np.eye(3) - second


@few(
    "shapes",
    [
        (Sphere(0.31),),
        (Box((0.105, 0.205, 0.305)),),
        (Capsule(0.15, 0.3),),
        (Box((0.1, 0.2, 0.3), (0.05, 0.1, -0.1), TILTED),),
        (Capsule(0.15, 0.3, (0.0, 0.1, 0.1), TILTED), Box((0.2, 0.1, 0.15), (-0.2, 0.1, 0.0)), Sphere(0.2)),
    ],
    2,
)
def test_volume_and_inertia_are_those_of_integrals(shapes: tuple[Shape, ...]) -> None:
    held, expected = integrated(shapes)
    assert sum(shape.volume for shape in shapes) == pytest.approx(held, rel=0.02)
    np.testing.assert_allclose(np.array(specific(shapes), float), expected, atol=0.005 * np.trace(expected))


def test_a_capsule_lies_between_sphere_and_rod() -> None:
    """In the limits I = 2/5 r^2, and h^2/3 for a rod of half length h."""
    np.testing.assert_allclose(Capsule(1.0, 1e-9).moments, 2 / 5, rtol=1e-8)
    assert Capsule(1e-9, 1.0).moments[0] == pytest.approx(1 / 3)


def test_a_box(load: Load) -> None:
    body = load(text=thing(SIZES)).world().bodies[0]
    assert body.shapes == (BOX,)
    np.testing.assert_allclose(body.inertia, 3 / 12 * np.array([0.16 + 0.36, 0.04 + 0.36, 0.04 + 0.16]))


def test_a_cube_turns_alike_about_every_axis(load: Load) -> None:
    inertia = load(text=thing("{ box = { size = [0.5, 0.5, 0.5] } }")).world().bodies[0].inertia
    assert inertia == pytest.approx(3 * 0.25 / 6)


def test_a_capsule(load: Load) -> None:
    problem = load(text=thing("{ capsule = { radius = 0.1, length = 0.5 } }", "density = 100"))
    body = problem.world().bodies[0]
    assert body.shapes == (CAPSULE,)
    assert body.mass == pytest.approx(100 * np.pi * 0.01 * (0.5 + 4 / 3 * 0.1))
    np.testing.assert_allclose(body.inertia, body.mass * np.array(CAPSULE.moments))


def test_a_cylinder_and_an_ellipsoid(load: Load) -> None:
    body = load(text=thing("{ cylinder = { radius = 0.1, length = 0.5 } }", "density = 100")).world().bodies[0]
    assert body.shapes == (Cylinder(0.1, 0.25),)
    assert body.mass == pytest.approx(100 * np.pi * 0.01 * 0.5)
    np.testing.assert_allclose(body.inertia, body.mass * np.array([0.01 / 4 + 0.25 / 12] * 2 + [0.005]))
    problem = load(text=thing("{ ellipsoid = { radii = [0.1, 0.2, 0.3] } }"))
    assert problem.world().bodies[0].shapes == (Ellipsoid((0.1, 0.2, 0.3)),)
    assert problem.parameters["thing.radii"].tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(problem.world().bodies[0].inertia, 3 / 5 * np.array([0.13, 0.1, 0.05]))


def test_a_hull(load: Load) -> None:
    """The corners of a box in any order, and a point inside: mass and inertia of that box; no parameter."""
    rows = [list(corner) for corner in BOX.rounded_hull.corners[::-1]] + [[0.01, 0.02, 0.0]]
    problem = load(text=thing(f"{{ convex = {{ points = {rows} }} }}", "density = 10"))
    body = problem.world().bodies[0]
    assert body.mass == pytest.approx(10 * BOX.volume)
    np.testing.assert_allclose(
        np.diag(np.array(body.inertia)) if np.ndim(body.inertia) == 2 else body.inertia,
        body.mass * np.array(BOX.moments),
        rtol=1e-12,
    )
    assert "thing.points" not in problem.parameters
    again = load(text=thing(f"{{ parts = [{{ convex = {{ points = {rows} }}, centre = [0, 0, 0] }}] }}", "mass = 2"))
    assert again.world().bodies[0].shapes == body.shapes


def test_a_compound_of_all(load: Load) -> None:
    parts = """{ parts = [
        { box = { size = [0.2, 0.4, 0.6] }, centre = [0.3, 0, 0], orientation = { yaw_deg = 90 } },
        { box = { size = [0.2, 0.4, 0.6] }, centre = [-0.3, 0, 0], orientation = [1, 0, 0, 1] },
        { sphere = { radius = 0.1 } },
        { capsule = { radius = 0.1, length = 0.5 }, orientation = { pitch_deg = 90 } },
    ] }"""
    problem = load(text=thing(parts, "density = 10"))
    body = problem.world().bodies[0]
    first, second, ball, bar = body.shapes
    assert isinstance(first, Box)
    assert isinstance(second, Box)
    assert (first.half_sizes, first.centre, second.centre) == ((0.1, 0.2, 0.3), (0.3, 0, 0), (-0.3, 0, 0))
    assert first.orientation == pytest.approx(second.orientation)
    assert ball == Sphere(0.1)
    masses = [10 * shape.volume for shape in body.shapes]
    assert body.mass == pytest.approx(sum(masses))
    along, across = bar.moments[2] * masses[3], bar.moments[0] * masses[3]
    boxes = 2 * masses[0] * np.array([0.04 + 0.36, 0.16 + 0.36, 0.16 + 0.04]) / 12  # turned by a quarter: x and y swap
    boxes[0] = 2 * masses[0] * (0.04 + 0.36) / 12
    boxes += 2 * masses[0] * 0.09 * np.array([0, 1, 1])
    expected = boxes + masses[2] * 0.4 * 0.01 + np.array([along, across, across])
    np.testing.assert_allclose(body.inertia, expected)
    assert "thing.size" not in problem.parameters


def test_parameters_are_sizes(load: Load) -> None:
    assert load(text=thing(SIZES)).parameters["thing.size"].tolist() == [0.2, 0.4, 0.6]
    found = load(text=thing("{ capsule = { radius = 0.1, length = 0.5 } }")).parameters
    assert (found["thing.radius"].tolist(), found["thing.length"].tolist()) == ([0.1], [0.5])


def values(problem: Problem, **overrides: Any) -> list[float]:
    """Mass and inertia as functions of symbols, at the numbers that they stand for."""
    named = {f"thing.{key}": (ca.SX.sym(key, np.size(value)), ca.DM(value)) for key, value in overrides.items()}
    body = problem.world({name: symbol for name, (symbol, _) in named.items()}).bodies[0]
    inertia = ca.vertcat(*body.inertia) if isinstance(body.inertia, tuple) else body.inertia
    function = ca.Function("f", [symbol for symbol, _ in named.values()], [ca.vertcat(body.mass, inertia)])
    return [float(x) for x in np.array(function(*(value for _, value in named.values()))).ravel()]


def test_mass_and_inertia_follow_the_sizes(load: Load) -> None:
    by_density = load(text=thing(SIZES, "density = 100"))
    larger = load(text=thing("{ box = { size = [0.3, 0.5, 0.6] } }", "density = 100")).world().bodies[0]
    assert values(by_density, size=[0.3, 0.5, 0.6]) == pytest.approx([larger.mass, *larger.inertia])
    by_mass = load(text=thing(SIZES))
    expected = 4 / 12 * np.array([0.25 + 0.36, 0.09 + 0.36, 0.09 + 0.25])
    assert values(by_mass, size=[0.3, 0.5, 0.6], mass=4) == pytest.approx([4, *expected])
    rod = load(text=thing("{ capsule = { radius = 0.1, length = 0.5 } }"))
    expected = 3 * np.array(Capsule(0.2, 0.3).moments)
    assert values(rod, radius=0.2, length=0.6) == pytest.approx([3, *expected])


def test_a_turned_part_has_a_full_tensor_of_symbols(load: Load) -> None:
    part = "{ parts = [{ box = { size = [0.2, 0.4, 0.6] }, orientation = { roll_deg = 30 } }] }"
    problem = load(text=thing(part))
    size = ca.SX.sym("size", 3)
    inertia = problem.world({"thing.size": size}).bodies[0].inertia
    found = ca.Function("f", [size], [ca.vertcat(*(ca.horzcat(*row) for row in inertia))])([0.2, 0.4, 0.6])
    np.testing.assert_allclose(np.array(found), np.array(problem.world().bodies[0].inertia), atol=1e-15)
    assert abs(float(found[1, 2])) > 1e-3


def test_a_variable_may_set_a_size(load: Load) -> None:
    variable = '[[variable]]\nname = "build"\nsets = "thing.size"\n'
    (found,) = load(text=thing(SIZES) + variable).variables
    np.testing.assert_allclose(found.lower, [2e-4, 4e-4, 6e-4])
    (edge,) = load(text=thing(SIZES) + variable.replace("size", "size[1]")).variables
    assert (edge.guess.tolist(), edge.lower.tolist()) == ([0.4], [pytest.approx(4e-4)])
