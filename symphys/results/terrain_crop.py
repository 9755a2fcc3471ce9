"""The part of a terrain that a picture shows, and the heights in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from symphys.model.shapes import Terrain
from symphys.model.world import Body, World
from symphys.shooting import Array

MOST = 49
"""Heights along the longer side."""
LEAST_SHARE = 0.3
"""Of the shorter side in the longer one."""
MARGIN = 0.15
"""On each side, as a share of the longer one."""


@dataclass(frozen=True)
class Window:
    """A rectangle of the x-y plane: ``low`` and ``high`` (2,) [m]."""

    low: Array
    high: Array


def window(world: World, places: Array) -> Window:
    """Where bodies at (n, 3) places may touch the ground, with room around."""
    flat = places[np.isfinite(places).all(axis=1), :2]
    flat = flat if len(flat) else np.zeros((1, 2))
    low, high = flat.min(axis=0), flat.max(axis=0)
    reach = max(size(body) for body in world.bodies)
    side = float((high - low).max()) + 2 * reach
    side = side if side > 0 else 1.0
    room = np.maximum(high - low + 2 * reach, LEAST_SHARE * side) / 2 + MARGIN * side
    middle = (low + high) / 2
    return Window(middle - room, middle + room)


def size(body: Body) -> float:
    """From a body's centre of mass to the farthest point of its surface, at most [m]."""
    return max((float(np.linalg.norm(shape.centre)) + shape.extent for shape in body.shapes), default=0.0)


def sample(terrain: Terrain, near: Window) -> dict[str, Any]:
    """``x`` (columns,) and ``y`` (rows,) [m], and ``z`` (rows, columns): the heights there [m]."""
    sides = near.high - near.low
    columns, rows = (int(count) for count in np.maximum(np.round(MOST * sides / sides.max()), 2))
    x, y = (np.linspace(near.low[k], near.high[k], count) for k, count in enumerate((columns, rows)))
    a, b = ca.SX.sym("x"), ca.SX.sym("y")
    height = ca.Function("height", [a, b], [terrain.height(a, b)])
    found = height(np.tile(x, rows)[None, :], np.repeat(y, columns)[None, :])
    z = np.array(found, float).reshape(rows, columns)
    return {"x": short(x), "y": short(y), "z": [short(row) for row in z]}


def short(numbers: Array) -> list[float]:
    """Numbers with no more digits than a picture can show."""
    return [float(f"{number:.7g}") for number in numbers.tolist()]
