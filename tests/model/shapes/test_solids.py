"""Solids say of themselves what their points say: volume, inertia, centre of mass, extent, and the hull to draw."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from tools.repeats import few

from symphys.model.shapes import SHAPES, Box, Capsule, Convex, Cylinder, Ellipsoid, Shape, Sphere
from symphys.model.shapes.inertia import centre_of_mass, specific

TETRAHEDRON = ((0.4, 0.0, 0.1), (0.0, 0.3, 0.0), (-0.1, -0.2, 0.0), (0.1, 0.1, 0.5))
SOLIDS = (
    Sphere(0.3),
    Box((0.1, 0.2, 0.35)),
    Capsule(0.15, 0.25),
    Cylinder(0.15, 0.25),
    Ellipsoid((0.1, 0.2, 0.35)),
    Convex(TETRAHEDRON),
)


def grid(shape: Shape, count: int = 120) -> tuple[NDArray[np.float64], float]:
    """(n, 3) points inside a solid, of a regular grid, and the volume that each stands for."""
    hull = shape.rounded_hull
    low, high = np.min(hull.corners, axis=0) - hull.radius, np.max(hull.corners, axis=0) + hull.radius
    shares = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count for _ in range(3))), axis=-1).reshape(-1, 3)
    points = low + shares * (high - low)
    return points[inside(shape, points)], float(np.prod((high - low) / count))


def inside(shape: Shape, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,): which points lie in a solid, by its definition."""
    if isinstance(shape, Ellipsoid):
        return np.asarray(((points / np.array(shape.radii)) ** 2).sum(axis=1) <= 1)
    if isinstance(shape, Cylinder):
        return np.asarray((np.hypot(*points[:, :2].T) <= shape.radius) & (np.abs(points[:, 2]) <= shape.half_length))
    if isinstance(shape, Convex):
        planes = ConvexHull(np.array(shape.points)).equations
        return np.asarray((points @ planes[:, :3].T + planes[:, 3] <= 0).all(axis=1))
    hull = shape.rounded_hull  # of a box, a line or a point
    outside = np.maximum(np.abs(points) - np.array(hull.corners).max(axis=0), 0)
    return np.asarray((outside**2).sum(axis=1) <= hull.radius**2 + 1e-12)


@few("shape", SOLIDS, ids=[each.kind for each in SOLIDS], count=2)
def test_volume_moments_and_extent_are_those_of_its_points(shape: Shape) -> None:
    points, each = grid(shape)
    assert shape.volume == pytest.approx(len(points) * each, rel=1e-2)
    middle = points.mean(axis=0)
    assert shape.centroid == pytest.approx(middle, abs=2e-3)
    spread = np.cov(points.T, ddof=0)
    tensor = np.trace(spread) * np.eye(3) - spread
    assert shape.moments == pytest.approx(np.diag(tensor), rel=1e-2)
    assert shape.products == pytest.approx((tensor[1, 2], tensor[0, 2], tensor[0, 1]), abs=1e-2 * tensor.max())
    farthest = np.linalg.norm(points, axis=1).max()
    assert 0.95 * shape.extent < farthest <= shape.extent


@pytest.mark.parametrize("shape", SOLIDS, ids=[each.kind for each in SOLIDS])
def test_the_drawn_hull_is_within_the_solid_and_nearly_fills_it(shape: Shape) -> None:
    hull = shape.rounded_hull
    corners = np.array(hull.corners)
    assert inside(shape, corners + 1e-9 * (corners.mean(axis=0) - corners)).all()
    if len(corners) > 2:
        assert ConvexHull(corners).volume == pytest.approx(shape.volume, rel=0.08)
    assert np.linalg.norm(corners, axis=1).max() + hull.radius == pytest.approx(shape.extent, rel=1e-12)


def test_inertia_of_a_turned_hull_is_that_of_its_tetrahedra() -> None:
    """A cube off its centre and turned, as a hull and as a box: centre of mass and tensor are the same."""
    turn, half = (np.cos(0.4), 0.0, 0.6 * np.sin(0.4), 0.8 * np.sin(0.4)), np.array([0.1, 0.2, 0.3])
    off = np.array([0.05, -0.1, 0.2])
    corners = Box(tuple(half)).rounded_hull.corners + off
    hull = Convex(corners, (0.3, 0.1, 0.0), turn)
    centre = centre_of_mass([hull])
    box = Box(tuple(half), tuple(centre.tolist()), turn)
    assert np.array(specific([hull])) == pytest.approx(np.array(specific([box])), abs=1e-14)
    assert np.linalg.norm(centre - [0.3, 0.1, 0]) == pytest.approx(np.linalg.norm(off))


def test_points_inside_a_hull_change_nothing() -> None:
    more = Convex((*TETRAHEDRON, (0.1, 0.05, 0.15), TETRAHEDRON[0]))
    assert (more.volume, *more.moments) == pytest.approx((Convex(TETRAHEDRON).volume, *Convex(TETRAHEDRON).moments))
    assert len(more.rounded_hull.corners) == 4


@pytest.mark.parametrize(
    "points", [TETRAHEDRON[:3], [(x, y, 0.1) for x in (0, 1) for y in (0, 1)], [(k, k, k) for k in range(5)]]
)
def test_points_in_a_plane_are_no_solid(points: list[tuple[float, float, float]]) -> None:
    assert "plane" in Convex(points).flatness
    assert Convex(points).volume == 0


def test_thin_cylinders_and_ellipsoids_are_no_solids() -> None:
    assert "length" in Cylinder(1.0, 1e-9).flatness
    assert "radius" in Cylinder(1e-9, 1.0).flatness
    assert "radius" in Ellipsoid((1.0, 1e-9, 1.0)).flatness
    assert Cylinder(0.1, 0.2).volume == pytest.approx(pi * 0.004)


def test_every_kind_is_among_them() -> None:
    assert {type(shape) for shape in SOLIDS} == set(SHAPES.values())


@pytest.mark.parametrize("shape", SOLIDS, ids=[each.kind for each in SOLIDS])
def test_the_same_sizes_make_the_same_shape(shape: Shape) -> None:
    assert shape.resized(shape.sizes) == shape
    assert [key.name for key in shape.size_keys] == list(shape.sizes)


def test_only_a_ball_about_the_origin_is_central() -> None:
    assert [shape.central for shape in SOLIDS] == [True] + [False] * 5
    assert not replace(Sphere(0.3), centre=(0.0, 0.01, 0.0)).central
