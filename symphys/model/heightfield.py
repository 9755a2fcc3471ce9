"""A surface through heights on a grid: cubic B-splines in x times cubic B-splines in y, twice differentiable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Expr = Any
"""casadi SX, MX or DM, or float"""

PIECES = (1, -4, 6, -4)
"""A cubic B-spline on the knots -2, -1, 0, 1, 2 is the sum of these times max(t - knot, 0)^3 / 6, up to t = 2."""


@dataclass(frozen=True)
class Heightfield:
    """z = height(x, y), the natural cubic spline through a grid of heights.

    Beyond the edges of the grid it goes straight on: with the height and slope of the edge, and no curvature across it,
    so that value, slope and curvature are continuous and finite everywhere.

    Attributes:
        heights: rows along y, columns along x [m]; two or more of each.
        spacing: (2,) between neighbours along x and along y [m].
        origin: (2,) x and y of the first height [m].

    Example:
        >>> from symphys import Heightfield, Terrain
        >>> hills = Terrain("hills", Heightfield(((0, 0, 0), (0, 0.2, 0), (0, 0, 0)), spacing=(1, 1), origin=(-1, -1)))
        >>> float(hills.height(0, 0))
        0.2
    """

    heights: tuple[tuple[float, ...], ...]
    spacing: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)

    def __call__(self, x: Expr, y: Expr) -> Expr:
        """The height at a place [m]; casadi scalars or numbers in, a casadi scalar out."""
        rows, columns = self.coefficients.shape
        across = weights((x - self.origin[0]) / self.spacing[0], columns)
        along = weights((y - self.origin[1]) / self.spacing[1], rows)
        return total(along, [total(across, row) for row in self.coefficients.tolist()])

    @cached_property
    def coefficients(self) -> Array:
        """(rows + 2, columns + 2): of the splines, whose middles lie on the grid and one step around it [m]."""
        heights = np.array(self.heights, float)
        return natural(natural(heights).T).T


def total(weights: Sequence[Expr], values: Sequence[Expr]) -> Expr:
    """The sum of products."""
    result = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        result = result + weight * value
    return result


def natural(values: Array) -> Array:
    """(n + 2, m): spline coefficients whose splines pass through (n, m) values, without curvature at both ends."""
    count = len(values)
    system = np.zeros((count + 2, count + 2))
    inner = np.arange(count)
    for offset, share in enumerate((1 / 6, 4 / 6, 1 / 6)):
        system[inner + 1, inner + offset] = share
    system[0, :3] = system[-1, -3:] = (1, -2, 1)
    none = np.zeros((1, values.shape[1]))
    return np.asarray(np.linalg.solve(system, np.vstack([none, values, none])))


def weights(place: Expr, count: int) -> list[Expr]:
    """How much each of ``count`` splines, with middles at -1, 0, 1, ..., counts at a place on the grid's scale.

    Between the edges, at 0 and ``count - 3``, that is the spline's value; beyond, its value and slope at the edge
    continued. Only the three splines next to an edge have a slope there.
    """
    inside = ca.fmin(ca.fmax(place, 0.0), count - 3.0)
    beyond = place - inside
    found = []
    for k in range(count):
        value, slope = spline(inside - k + 1)
        found.append(value + beyond * slope if k < 3 or k >= count - 3 else value)
    return found


def spline(t: Expr) -> tuple[Expr, Expr]:
    """Value and slope of the cubic B-spline about 0 with knots one apart; 0 beyond -2 and 2."""
    above = [ca.fmax(ca.fmin(t, 2.0) + 2 - k, 0.0) for k in range(len(PIECES))]
    squares = [rest * rest for rest in above]
    cubes = [rest * square for rest, square in zip(above, squares, strict=True)]
    return total(PIECES, cubes) / 6, total(PIECES, squares) / 2
