"""A surface through heights on a grid: it passes through them, is smooth, and goes straight on beyond its edges."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from symphys.model.heightfield import Heightfield

Array = NDArray[np.float64]
SPACING, ORIGIN = (0.5, 0.25), (1.0, -2.0)
HEIGHTS = np.random.default_rng(3).standard_normal((5, 7))


def field(heights: Array) -> Heightfield:
    return Heightfield(tuple(tuple(row) for row in heights.tolist()), SPACING, ORIGIN)


def derivatives(surface: Heightfield) -> ca.Function:
    """(x, y) -> height, slope (2,), curvature (2, 2)."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    height = surface(x, y)
    slope = ca.gradient(height, ca.vertcat(x, y))
    return ca.Function("surface", [x, y], [height, slope, ca.jacobian(slope, ca.vertcat(x, y))])


def place(row: float, column: float) -> tuple[float, float]:
    return ORIGIN[0] + SPACING[0] * column, ORIGIN[1] + SPACING[1] * row


def test_it_passes_through_the_heights() -> None:
    surface = field(HEIGHTS)
    found = [[float(surface(*place(j, i))) for i in range(7)] for j in range(5)]
    np.testing.assert_allclose(found, HEIGHTS, atol=1e-14)


@pytest.mark.parametrize("row", [-1.0, 0.0, 0.5, 2.0, 4.0, 4.7])
@pytest.mark.parametrize("column", [-2.5, 0.0, 0.3, 3.0, 6.0, 7.0])
def test_slope_and_curvature_are_those_of_differences(row: float, column: float) -> None:
    """Also on grid lines and on the edge, where the pieces meet: central differences of the one below."""
    at = derivatives(field(HEIGHTS))
    (x, y), h = place(row, column), 1e-6
    for level in range(2):
        low = [np.array(at(x - h, y)[level]).ravel(), np.array(at(x, y - h)[level]).ravel()]
        high = [np.array(at(x + h, y)[level]).ravel(), np.array(at(x, y + h)[level]).ravel()]
        differences = (np.array(high) - np.array(low)) / (2 * h)
        np.testing.assert_allclose(np.array(at(x, y)[level + 1]).ravel(), differences.ravel(), atol=2e-3, rtol=1e-4)


def test_it_is_the_natural_spline_along_a_line() -> None:
    """Three heights 0, 1, 0 one apart: between the first two z = (3 t - t^3) / 2."""
    surface = Heightfield(((0.0, 1.0, 0.0),) * 2, (1.0, 1.0))
    for t in (0.1, 0.5, 0.9):
        assert float(surface(t, 0.3)) == pytest.approx((3 * t - t**3) / 2, abs=1e-14)


def test_beyond_the_edge_it_goes_straight_on() -> None:
    surface = field(HEIGHTS)
    x, y = place(1.3, 6)
    height, slope, _ = derivatives(surface)(x, y)
    assert float(surface(x + 10, y)) == pytest.approx(float(height + 10 * slope[0]))
    assert np.isfinite(float(surface(1e6, -1e6)))


def test_two_by_two_heights_are_a_twisted_plane() -> None:
    surface = Heightfield(((0.0, 1.0), (2.0, 5.0)), (1.0, 1.0))
    for x, y in ((0.25, 0.75), (3.0, -2.0)):
        assert float(surface(x, y)) == pytest.approx(x + 2 * y + 2 * x * y)


def test_the_largest_grid_is_still_exact() -> None:
    heights = np.random.default_rng(0).standard_normal((2, 512))
    surface = Heightfield(tuple(tuple(row) for row in heights.tolist()), (1.0, 1.0))
    found = [float(surface(float(i), 1.0)) for i in (0, 255, 511)]
    np.testing.assert_allclose(found, heights[1, [0, 255, 511]], atol=1e-12)


def test_it_travels_to_other_processes() -> None:
    surface = field(HEIGHTS)
    assert pickle.loads(pickle.dumps(surface)) == surface
