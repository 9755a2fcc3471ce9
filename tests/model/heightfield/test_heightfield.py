"""A surface through heights on a grid: it passes through them, overshoots none, and goes straight on at its edges."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from tools.repeats import few

from symphys.model.heightfield import Heightfield
from symphys.types import Array

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


@few("row", [-1.0, 0.0, 0.5, 2.0, 4.0, 4.7], 3)
@few("column", [-2.5, 0.0, 0.3, 3.0, 6.0, 7.0], 3)
def test_slopes_are_those_of_differences(row: float, column: float) -> None:
    """Also on grid lines and on the edge, where the pieces meet: central differences of the heights."""
    at = derivatives(field(HEIGHTS))
    (x, y), h = place(row, column), 1e-6
    low, high = [at(x - h, y)[0], at(x, y - h)[0]], [at(x + h, y)[0], at(x, y + h)[0]]
    differences = [float(one - other) / (2 * h) for one, other in zip(high, low, strict=True)]
    np.testing.assert_allclose(np.array(at(x, y)[1]).ravel(), differences, atol=1e-3)
    assert np.isfinite(np.array(at(x, y)[2])).all()


RISING = np.cumsum(np.cumsum(1 + np.abs(HEIGHTS), axis=0), axis=1)
"""Heights that rise along both sides, none much more than its neighbour."""


@pytest.mark.parametrize("row", [0.0, 0.5, 2.0, 4.0])
@pytest.mark.parametrize("column", [0.0, 0.3, 3.0, 6.0])
def test_where_nothing_overshoots_it_is_the_natural_spline(row: float, column: float) -> None:
    """Twice differentiable, also on grid lines: the curvature is that of differences of slopes."""
    x, y = place(row, column)
    expected = splines_of(RISING)(row, column)
    at, h = derivatives(field(RISING)), 1e-6
    assert float(at(x, y)[0]) == pytest.approx(expected, abs=1e-12)
    slopes = [np.array(at(x + dx, y + dy)[1]).ravel() for dx, dy in ((h, 0), (-h, 0), (0, h), (0, -h))]
    differences = np.array([slopes[0] - slopes[1], slopes[2] - slopes[3]]) / (2 * h)
    scale = np.abs(differences).max() + 1
    inside = 0 < row < 4 and 0 < column < 6  # on the edge the piece beyond it is straight
    if inside:
        np.testing.assert_allclose(np.array(at(x, y)[2]), differences, atol=1e-3 * scale)


def splines_of(heights: Array) -> Callable[[float, float], float]:
    """The natural spline in x of natural splines in y, at a place on the grid's scale."""
    rows, columns = heights.shape

    def height(row: float, column: float) -> float:
        line = CubicSpline(np.arange(rows), heights, bc_type="natural")(row)
        return float(CubicSpline(np.arange(columns), line, bc_type="natural")(column))

    return height


KERB = np.repeat([[0.0] * 6 + [0.2] * 5], 4, axis=0)
SPIKE = np.pad([[1.0]], 3)
GRIDS = {
    "kerb": KERB,
    "kerb along y": KERB.T,
    "kerb on a slope": KERB + 0.05 * np.arange(4)[:, None],
    "spike": SPIKE,
    "hole": -SPIKE,
    "ridge": np.repeat([[0.0, 0, 0, 1, 0, 0]], 5, axis=0),
    "trench": np.repeat([[0.0, 0, -1, -1, 0, 0]], 5, axis=0),
    "diagonal step": (np.add.outer(range(7), range(7)) > 6) * 1.0,
    "stairs": np.repeat([np.repeat(np.arange(4.0), 3)], 3, axis=0),
    "crater": (np.hypot(*np.meshgrid(range(-4, 5), range(-4, 5))).round() == 3) * 1.0,
    "checks": np.indices((6, 5)).sum(axis=0) % 2 * 1.0,
    "a square": np.array([[0.0, 1.0], [2.0, -1.0]]),
    "two rows": np.random.default_rng(1).standard_normal((2, 9)),
    "random": HEIGHTS,
    "steps": np.random.default_rng(2).integers(0, 3, (9, 8)) * 1.0,
    "steps over an offset": 1e3 + np.random.default_rng(2).integers(0, 3, (9, 8)),
}


@pytest.mark.parametrize("name", GRIDS)
def test_it_stays_within_the_range_of_the_four_heights_around(name: str) -> None:
    """No ditch before a kerb and no rim on it: at 13 x 13 places of each cell, up to rounding."""
    heights, parts = GRIDS[name], 12
    fine = field(heights).on_grid(*(np.arange(parts * (n - 1) + 1) / parts for n in heights.shape))
    rounding = 1e-13 * np.abs(heights).max()
    for row, column in np.ndindex(heights.shape[0] - 1, heights.shape[1] - 1):
        corners = heights[row : row + 2, column : column + 2]
        there = fine[parts * row : parts * (row + 1) + 1, parts * column : parts * (column + 1) + 1]
        assert there.min() >= corners.min() - rounding
        assert there.max() <= corners.max() + rounding


@pytest.mark.parametrize("name", GRIDS)
def test_it_is_the_same_seen_from_any_side(name: str) -> None:
    """Mirrored, and with x and y exchanged."""
    heights = GRIDS[name]
    rows, columns = (np.linspace(0, n - 1, 23) for n in heights.shape)
    seen, close = field(heights).on_grid(rows, columns), 1e-12 * np.abs(heights).max()
    assert field(heights[::-1]).on_grid(rows, columns)[::-1] == pytest.approx(seen, abs=close)
    assert field(heights[:, ::-1]).on_grid(rows, columns)[:, ::-1] == pytest.approx(seen, abs=close)
    np.testing.assert_allclose(field(heights.T).on_grid(columns, rows).T, seen, atol=close)


def test_numbers_on_a_grid_are_those_of_the_formula() -> None:
    surface = field(GRIDS["steps"])
    for row, column in ((0.0, 0.0), (1.3, 2.8), (7.9, 6.1)):
        expected = surface.on_grid(np.array([row]), np.array([column]))[0, 0]
        assert float(surface(*place(row, column))) == pytest.approx(expected, abs=1e-13)


def test_planes_and_slopes_beside_a_kerb_are_exact() -> None:
    """A plane stays one; along a kerb a street may rise evenly."""
    x, y = np.meshgrid(np.arange(7), np.arange(5))
    rows, columns = np.linspace(0, 4, 33), np.linspace(0, 6, 49)
    plane = field(2.0 * x - 3.0 * y + 1).on_grid(rows, columns)
    assert plane == pytest.approx(2 * columns - 3 * rows[:, None] + 1, abs=1e-13)
    kerb = field(GRIDS["kerb on a slope"]).on_grid(np.linspace(0, 3, 19), np.linspace(0, 5, 31))
    assert kerb == pytest.approx(np.repeat(0.05 * np.linspace(0, 3, 19)[:, None], 31, axis=1), abs=1e-14)


def test_it_is_the_natural_spline_along_a_line() -> None:
    """Three heights 0, 1, 0 one apart: between the first two z = (3 t - t^3) / 2."""
    surface = Heightfield(((0.0, 1.0, 0.0),) * 2, (1.0, 1.0))
    for t in (0.1, 0.5, 0.9):
        assert float(surface(t, 0.3)) == pytest.approx((3 * t - t**3) / 2, abs=1e-14)


def test_beyond_the_edge_it_goes_straight_on() -> None:
    surface, kerb = field(HEIGHTS), field(KERB)
    for column, away in ((6, 10), (0, -10)):
        x, y = place(1.3, column)
        height, slope, _ = derivatives(surface)(x, y)
        assert float(surface(x + away, y)) == pytest.approx(float(height + away * slope[0]))
    assert float(kerb(*place(1, -8))) == pytest.approx(0, abs=1e-15)
    assert float(kerb(*place(9, 18))) == pytest.approx(0.2)
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
