"""Slopes of a surface through heights on a grid, lowered where it would leave the range of the heights around a place.

On the grid's scale, where neighbours are 1 apart. A bicubic piece lies in the hull of its sixteen Bernstein
coefficients. Those on the grid's lines are in the range of both heights where a slope is between 0 and three times the
slopes to both neighbours, and 0 at the top of a rise (Fritsch and Carlson, "Monotone piecewise cubic interpolation",
1980; Hyman, "Accurate monotonicity preserving cubic interpolation", 1983). The inner ones are put into the range of all
four heights by the twist, and by lower slopes where no twist does it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from symphys.types import Array

STEEPEST = 3.0
"""Largest slope at a height, as a multiple of the smaller of the slopes to its neighbours."""
SIDES = (-1, 1)


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
    most = np.where(rises_on, STEEPEST * np.minimum(np.abs(before), np.abs(after)), 0)
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
