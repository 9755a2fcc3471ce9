"""A surface through heights on a grid that nowhere leaves the range of the four heights around a place.

It is the natural cubic spline, twice differentiable, where that keeps the range. Elsewhere its slopes at the heights
are lowered: there it is differentiable once, with finite second derivatives. On the grid's scale, where neighbours are
1 apart, a bicubic piece lies in the hull of its sixteen Bernstein coefficients. Those on the grid's lines are in the
range of both heights where a slope is between 0 and three times the slopes to both neighbours, and 0 at the top of a
rise (Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980; Hyman, "Accurate monotonicity preserving
cubic interpolation", 1983). The inner ones are put into the range of all four heights by the twist, and by lower
slopes where no twist does it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product

import casadi as ca
import numpy as np

from symphys.records import dataclass
from symphys.types import Array, Expr

MAX_SLOPE_RATIO = 3.0
"""Largest slope at a height, as a multiple of the smaller of the slopes to its neighbours."""
SIDES = (-1, 1)
PIECES = (1, -4, 6, -4)
"""A cubic B-spline on the knots -2, -1, 0, 1, 2 is the sum of these times max(t - knot, 0)^3 / 6, up to t = 2."""
VALUE, SLOPE = (1 / 6, 4 / 6, 1 / 6), (-1 / 2, 0, 1 / 2)
"""Values and slopes of a cubic B-spline at the heights before, at and after its middle."""
ROUNDING_TOLERANCE = 1e-12
"""Smallest change of a slope that is made, as a share of the largest height."""
GRID_REFINEMENT = 4
"""Number of parts of a spacing at whose ends a surface is compared with triangles."""
MAX_COMPARED = 1_000_000
"""Largest number of places at which it is compared, roughly."""
Term = tuple[list[Expr], Array, list[Expr]]
"""Functions of y, coefficients (rows, columns) [m], functions of x: a part of the surface is the sum of products."""


@dataclass(frozen=True)
class Slopes:
    """(rows, columns) each, at the heights: slopes along x and along y, and the twist d2z/dxdy [m]."""

    x: Array
    y: Array
    twist: Array


def limited(heights: Array, wanted: Slopes) -> Slopes:
    """Slopes as near to those ``wanted`` as the range of the heights (rows, columns) [m] allows."""
    x, y = limited_along(heights, wanted.x), limited_along(heights.T, wanted.y.T).T

    # bounds low0 + share low1 <= twist / 9 <= high0 + share high1, of the inner coefficient next to each height
    bounds = []
    for across, along in product(SIDES, SIDES):
        least, most = range_of_cells(heights, across, along)
        step = (across * x + along * y) / 3
        rising = across * along > 0
        bounds.append((least, -step, most, -step) if rising else (-most, step, -least, step))

    # the largest share of the slopes with which no lower bound is above an upper one
    share = np.ones_like(heights)
    for (low, low_rate, *_), (*_, high, high_rate) in product(bounds, bounds):
        closing = low_rate - high_rate
        closes = closing > 0
        share = np.where(closes, np.minimum(share, (high - low) / np.where(closes, closing, 1)), share)
    low = np.max([one + share * rate for one, rate, _, _ in bounds], axis=0)
    high = np.min([one + share * rate for _, _, one, rate in bounds], axis=0)
    return Slopes(share * x, share * y, 9 * np.clip(wanted.twist / 9, low, np.maximum(low, high)))


def limited_along(heights: Array, slopes: Array) -> Array:
    """The slopes (rows, columns) along rows of heights, between 0 and what both neighbours allow."""
    rises = np.diff(heights, axis=1)
    before, after = np.hstack([rises[:, :1], rises]), np.hstack([rises, rises[:, -1:]])
    rises_on = before * after > 0
    most = np.where(rises_on, MAX_SLOPE_RATIO * np.minimum(np.abs(before), np.abs(after)), 0)
    found: Array = np.sign(after) * np.clip(np.sign(after) * slopes, 0, most)
    return found


def range_of_cells(heights: Array, across: int, along: int) -> tuple[Array, Array]:
    """Return how far the extremes of the cell on one side are from each height; infinite without a cell."""
    corners = np.array([heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]])
    ends = ((1, 0), (0, 1))
    pad = [ends[along > 0], ends[across > 0]]
    least = np.pad(corners.min(axis=0), pad, constant_values=-np.inf)
    most = np.pad(corners.max(axis=0), pad, constant_values=np.inf)
    return least - heights, most - heights


def off_triangles(fine: Array, corners: Array, finer: int) -> float:
    """Return how far heights are from triangles on a grid, for both ways to cut its squares [m].

    ``fine``: the heights at ``finer`` parts of each spacing.
    """
    z00, z10, z01, z11 = corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:]
    most = 0.0
    for row, column in product(range(finer + 1), repeat=2):
        u, v = column / finer, row / finer
        there = fine[row : fine.shape[0] - finer + row : finer, column : fine.shape[1] - finer + column : finer]
        near, far = z00 + u * (z10 - z00) + v * (z01 - z00), z11 + (1 - u) * (z01 - z11) + (1 - v) * (z10 - z11)
        rising = z00 + (u * (z10 - z00) + v * (z11 - z10) if u >= v else v * (z01 - z00) + u * (z11 - z01))
        falling = near if u + v <= 1 else far
        most = max(most, float(np.abs(there - rising).max()), float(np.abs(there - falling).max()))
    return most


@dataclass(frozen=True)
class Basis:
    """Functions of a place along one side of the grid, on the grid's scale, where heights are 1 apart.

    Attributes:
        splines: cubic B-splines, with middles at the heights and one step beyond both ends.
        values: for each height the cubic that is 1 there and 0 at all others, level at all.
        slopes: for each height the cubic that is 0 at all and level at all others, and has slope 1 there.
    """

    splines: list[Expr]
    values: list[Expr]
    slopes: list[Expr]


@dataclass(frozen=True)
class Heightfield:
    """z = height(x, y), a smooth surface through a grid of heights.

    Between four neighbours it stays within the range of their heights, so a kerb has no ditch before it, and along the
    grid's lines it rises and falls as the heights do. It is the natural cubic spline where that does so. Beyond the
    edges of the grid it goes straight on, with the height and slope of the edge, so that value and slope are continuous
    and finite everywhere.

    Attributes:
        heights: rows along y, columns along x [m]; two or more of each.
        spacing: (2,) between neighbours along x and along y [m].
        origin: (2,) x and y of the first height [m].

    Example:
        >>> from symphys.model import Heightfield, Terrain
        >>> hills = Terrain("hills", Heightfield(((0, 0, 0), (0, 0.2, 0), (0, 0, 0)), spacing=(1, 1), origin=(-1, -1)))
        >>> float(hills.height(0, 0))
        0.2
    """

    heights: tuple[tuple[float, ...], ...]
    spacing: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)

    def __call__(self, x: Expr, y: Expr) -> Expr:
        """The height at a place [m]; casadi scalars or numbers in, a casadi scalar out."""
        parts = self._terms((y - self.origin[1]) / self.spacing[1], (x - self.origin[0]) / self.spacing[0])
        found = [combined(*part) for part in parts]
        return sum(found, 0 * x)  # a grid of zeros has no part

    def on_grid(self, rows: Array, columns: Array) -> Array:
        """(m, n) [m]: the heights at m places along y and n along x, on the grid's scale."""
        parts = self._terms(ca.DM(rows), ca.DM(columns))
        sides = [[np.array(ca.horzcat(*each)) for each in (along, across)] for along, _, across in parts]
        found = (along @ part[1] @ across.T for (along, across), part in zip(sides, parts, strict=True))
        return np.asarray(sum(found, np.zeros((len(rows), len(columns)))))

    def off_triangles(self, heights: Array | None = None) -> float:
        """Return how far it is from triangles over the same area, for both ways to cut the squares [m].

        ``heights``: (m, n) [m], rows along y; None: its own.
        """
        corners = self._values if heights is None else heights
        finer = max(1, min(GRID_REFINEMENT, int(np.sqrt(MAX_COMPARED / corners.size))))
        sizes = zip(corners.shape, self._values.shape, strict=True)
        rows, columns = (np.linspace(0, own - 1, finer * (count - 1) + 1) for count, own in sizes)
        return off_triangles(self.on_grid(rows, columns), corners, finer)

    def _terms(self, along: Expr, across: Expr) -> list[Term]:
        """The spline, and what is added to its slopes along x, along y, and to its twist."""
        (rows, columns), added = self._values.shape, self._added
        v, u = basis(along, rows), basis(across, columns)
        terms = [(v.splines, self._coefficients, u.splines)]
        terms += [(v.values, added.x, u.slopes), (v.slopes, added.y, u.values), (v.slopes, added.twist, u.slopes)]
        return [term for term in terms if term[1].any()]

    @cached_property
    def _values(self) -> Array:
        return np.array(self.heights, float)

    @cached_property
    def _coefficients(self) -> Array:
        """(rows + 2, columns + 2): of the splines [m]."""
        return natural(natural(self._values).T).T

    @cached_property
    def _added(self) -> Slopes:
        """Return the correction of the slopes that keeps the range of the heights; exactly 0 if they keep it."""
        (rows, columns), spline = self._values.shape, self._coefficients
        y, x = ({kind: banded(count, kind) for kind in (VALUE, SLOPE)} for count in (rows, columns))
        x_slope, y_slope, twist = ((VALUE, SLOPE), (SLOPE, VALUE), (SLOPE, SLOPE))
        own = Slopes(*(y[one] @ spline @ x[other].T for one, other in (x_slope, y_slope, twist)))
        kept, least = limited(self._values, own), ROUNDING_TOLERANCE * float(np.abs(self._values).max())
        changes = [kept.x - own.x, kept.y - own.y, kept.twist - own.twist]
        return Slopes(*(np.where(np.abs(change) > least, change, 0.0) for change in changes))


def combined(along: Sequence[Expr], coefficients: Array, across: Sequence[Expr]) -> Expr:
    """The sum of all products of a function of y, a coefficient and a function of x; those of 0 are left out."""
    pairs = [(weight, row.tolist()) for weight, row in zip(along, coefficients, strict=True) if row.any()]
    return total([weight for weight, _ in pairs], [total(across, row) for _, row in pairs])


def total(weights: Sequence[Expr], values: Sequence[Expr]) -> Expr:
    """The sum of products."""
    result = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        result = result + weight * value
    return result


def banded(count: int, band: tuple[float, ...]) -> Array:
    """(count, count + 2): from spline coefficients to values or slopes at the heights."""
    return np.asarray(sum(share * np.eye(count, count + 2, offset) for offset, share in enumerate(band)))


def natural(values: Array) -> Array:
    """(n + 2, m): spline coefficients whose splines pass through (n, m) values, without curvature at both ends."""
    count = len(values)
    ends = np.zeros((2, count + 2))
    ends[0, :3] = ends[1, -3:] = (1, -2, 1)
    system = np.vstack([ends[:1], banded(count, VALUE), ends[1:]])
    none = np.zeros((1, values.shape[1]))
    return np.asarray(np.linalg.solve(system, np.vstack([none, values, none])))


def basis(place: Expr, count: int) -> Basis:
    """The functions of a place among ``count`` heights, at 0, 1, ... on the grid's scale.

    Beyond the ends they go on with their value and slope there.
    """
    inside = ca.fmin(ca.fmax(place, 0.0), count - 1.0)
    beyond = place - inside
    splines, values, slopes = [], [], []
    for k in range(count + 2):
        value, slope = spline(inside - k + 1)
        splines.append(value + beyond * slope if k < 3 or k >= count - 1 else value)
    for k in range(count):
        value, slope = hermite(inside - k)
        values.append(value)
        slopes.append(slope)
    first_half = 2 * place < count - 1
    slopes[0] = slopes[0] + first_half * beyond
    slopes[-1] = slopes[-1] + (1 - first_half) * beyond
    return Basis(splines, values, slopes)


def hermite(t: Expr) -> tuple[Expr, Expr]:
    """The cubics about 0 of ``Basis.values`` and ``Basis.slopes``; 0 beyond -1 and 1."""
    near = ca.fmin(t, 1.0)
    rest, after = ca.fmax(near + 1, 0.0), ca.fmax(near, 0.0)
    square, cube, after_square = rest * rest, rest * rest * rest, after * after
    return 3 * square - 2 * cube + 4 * after * after_square, cube - square - 4 * after_square


def spline(t: Expr) -> tuple[Expr, Expr]:
    """Value and slope of the cubic B-spline about 0 with knots one apart; 0 beyond -2 and 2."""
    above = [ca.fmax(ca.fmin(t, 2.0) + 2 - k, 0.0) for k in range(len(PIECES))]
    squares = [rest * rest for rest in above]
    cubes = [rest * square for rest, square in zip(above, squares, strict=True)]
    return total(PIECES, cubes) / 6, total(PIECES, squares) / 2
