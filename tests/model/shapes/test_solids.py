"""Solids say of themselves what their points say: volume, moments of inertia, extent, and the hull that is drawn."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from symphys.model.shapes import SHAPES, Box, Capsule, Shape, Sphere

SOLIDS = (Sphere(0.3), Box((0.1, 0.2, 0.35)), Capsule(0.15, 0.25))


def grid(shape: Shape, count: int = 120) -> tuple[NDArray[np.float64], float]:
    """(n, 3) points inside a solid, of a regular grid, and the volume that each stands for.

    Inside is what lies within the radius of the rounded hull, which is here that of a box, a line or a point.
    """
    radius, corners = shape.rounded_hull.radius, np.array(shape.rounded_hull.corners)
    half = corners.max(axis=0)
    assert sorted(corners.tolist()) == sorted(map(list, product(*({-h, h} for h in half))))
    sides = half + radius
    points = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count * 2 - 1 for _ in range(3))), axis=-1)
    points = points.reshape(-1, 3) * sides
    outside = np.maximum(np.abs(points) - half, 0)
    return points[(outside**2).sum(axis=1) <= radius**2 + 1e-12], float(np.prod(2 * sides / count))


@pytest.mark.parametrize("shape", SOLIDS, ids=[each.kind for each in SOLIDS])
def test_volume_moments_and_extent_are_those_of_its_points(shape: Shape) -> None:
    points, each = grid(shape)
    assert shape.volume == pytest.approx(len(points) * each, rel=5e-3)
    squares = (points**2).mean(axis=0)
    assert shape.moments == pytest.approx(squares.sum() - squares, rel=5e-3)
    farthest = np.linalg.norm(points, axis=1).max()
    assert 0.97 * shape.extent < farthest <= shape.extent


def test_every_kind_is_among_them() -> None:
    assert {type(shape) for shape in SOLIDS} == set(SHAPES.values())


@pytest.mark.parametrize("shape", SOLIDS, ids=[each.kind for each in SOLIDS])
def test_the_same_sizes_make_the_same_shape(shape: Shape) -> None:
    assert shape.resized(shape.sizes) == shape
    assert [key.name for key in shape.size_keys] == list(shape.sizes)


def test_only_a_ball_about_the_origin_is_central() -> None:
    assert [shape.central for shape in SOLIDS] == [True, False, False]
    assert not replace(Sphere(0.3), centre=(0.0, 0.01, 0.0)).central
