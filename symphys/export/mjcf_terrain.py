"""Write terrain as MJCF height fields, triangles between heights on a grid, and measure their error."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np

from symphys.export.mjcf_bodies import StartState
from symphys.model.height_limits import off_triangles
from symphys.model.heightfield import FINER, Heightfield
from symphys.model.shapes import Terrain
from symphys.types import Array

SAMPLED_MARGIN = 10.0
"""Margin around the bodies at the start within which terrain without a grid is sampled [m]."""
SAMPLE_SPACING = 0.2
"""Distance of its samples [m]."""
THICKNESS = 1.0
"""Thickness of the solid below the lowest height [m]."""


@dataclass(frozen=True)
class Grid:
    """The grid of a height field.

    Attributes:
        origin: (2,) x and y of the first height [m], world frame.
        spacing: (2,) distances along x and along y [m].
        count: (2,) numbers of heights along x and along y.
    """

    origin: tuple[float, float]
    spacing: tuple[float, float]
    count: tuple[int, int]


def window(start: StartState, terrain: Terrain) -> Grid:
    """Return the grid of terrain that has one; otherwise one around the bodies at the start."""
    height = terrain.height
    if isinstance(height, Heightfield):
        return Grid(height.origin, height.spacing, (len(height.heights[0]), len(height.heights)))
    places = np.array([start.of(k, "position")[:2] for k in range(len(start.world.bodies))])
    low, high = np.floor(places.min(0) - SAMPLED_MARGIN), np.ceil(places.max(0) + SAMPLED_MARGIN)
    columns, rows = np.rint((high - low) / SAMPLE_SPACING).astype(int) + 1
    return Grid((float(low[0]), float(low[1])), (SAMPLE_SPACING, SAMPLE_SPACING), (int(columns), int(rows)))


def sampled(terrain: Terrain, grid: Grid, finer: int = 1) -> Array:
    """Sample heights (rows, columns) [m] on a grid, rows along y, with ``finer`` parts in each spacing."""
    columns, rows = (finer * (n - 1) + 1 for n in grid.count)
    height = terrain.height
    if isinstance(height, Heightfield):
        return height.on_grid(np.arange(rows) / finer, np.arange(columns) / finer)
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("height", [x, y], [ca.densify(ca.SX(height(x, y)))])
    xs, ys = (
        origin + step * np.arange(n) / finer
        for origin, step, n in zip(grid.origin, grid.spacing, (columns, rows), strict=True)
    )
    places = [each.reshape(1, -1) for each in np.meshgrid(xs, ys)]
    return np.array(function(*map(ca.DM, places))).reshape(rows, columns)


def deviation(terrain: Terrain, grid: Grid) -> float:
    """Return the largest distance of a surface from triangles on its grid [m], for either diagonal of each square."""
    fine = sampled(terrain, grid, FINER)
    return off_triangles(fine, fine[::FINER, ::FINER], FINER)


def height_field(start: StartState, terrain: Terrain) -> Element:
    """Write the asset of a height field: heights between 0 and 1, and their scale."""
    grid = window(start, terrain)
    heights = sampled(terrain, grid)
    low, high = float(heights.min()), float(heights.max())
    scaled = (heights - low) / (high - low) if high > low else np.zeros_like(heights)
    half = [step * (n - 1) / 2 for step, n in zip(grid.spacing, grid.count, strict=True)]
    size = [*half, high - low if high > low else 1.0, THICKNESS]
    return Element(
        "hfield",
        name=terrain.name,
        nrow=str(grid.count[1]),
        ncol=str(grid.count[0]),
        size=" ".join(map(repr, size)),
        elevation=" ".join(repr(float(each)) for each in scaled[::-1].ravel()),
    )


def middle(start: StartState, terrain: Terrain) -> tuple[float, float, float]:
    """Return the position (3,) [m] of a height field, whose lowest point has height 0."""
    grid = window(start, terrain)
    x, y = (o + step * (n - 1) / 2 for o, step, n in zip(grid.origin, grid.spacing, grid.count, strict=True))
    return x, y, float(sampled(terrain, grid).min())
