"""Derivatives of contacts along ways through sizes, places and motions, and the differences that they must match."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
from worlds.meetings import MOTION, PLACE, WIDTHS, arguments, contacts

from symphys.model.shapes import Terrain
from symphys.types import Array


@cache
def sloped(first: str, second: str, terrain: bool = False) -> tuple[ca.Function, ca.Function]:
    """(z) -> all numbers of a pair's contacts, and (z, way) -> their derivative along a way."""
    surface = Terrain("waves", lambda x, y: 0.1 * ca.sin(3 * x) * ca.cos(2 * y)) if terrain else None
    symbols = arguments(first, second)
    found = contacts(first, second, symbols, False, surface)
    frames = [c.geometry.frame(c.time) for c in found]
    numbers = [ca.vertcat(c.gap, c.rate, c.time, f.normal, *f.arms) for c, f in zip(found, frames, strict=True)]
    z, result = ca.vertcat(*symbols), ca.densify(ca.horzcat(*numbers))
    way = ca.SX.sym("way", z.numel())
    flat = ca.vec(result)
    slope = ca.reshape(ca.jtimes(flat, z, way), result.shape)
    return ca.Function("f", [z], [result]), ca.Function("df", [z, way], [result, slope])


def some_way(rng: np.random.Generator, z: Array, kinds: tuple[str, str]) -> Array:
    """A random direction along which quaternions stay of length 1: others leave the axes of a shape at right angles."""
    way = rng.normal(size=z.size)
    start = 0
    for kind in kinds:
        for at in (start + WIDTHS.get(kind, 0) + 3, start + WIDTHS.get(kind, 0) + PLACE + 3):
            q = z[at : at + 4]
            way[at : at + 4] -= q * (q @ way[at : at + 4])
        start += WIDTHS.get(kind, 0) + PLACE + MOTION
    return way


def compared(pair: tuple[str, str], z: Array, way: Array, terrain: bool = False) -> tuple[Array, Array]:
    """Derivatives of the candidates that are near, and central differences."""
    value, slope = sloped(*pair, terrain)
    numbers, exact = (np.array(part) for part in slope(z, way))
    high, low = (np.array(value(z + h * way)) for h in (1e-6, -1e-6))
    near = np.abs(numbers[0]) < 0.3
    return exact[:, near], ((high - low) / 2e-6)[:, near]
