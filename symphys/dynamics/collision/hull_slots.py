"""Which corners of a convex hull may touch ground in a substep: as many as it has slots.

A hull of few corners has a slot for each. Of many, six slots take the deepest on ground that leans by ``LEAN`` to six
sides: these are the outermost corners of a face that lies on the ground, and both ends of an edge. Two more take the
deepest where it is expected to touch, and at the end of the substep, if it is deeper than those. So a hull stands on
its faces and rolls over its edges, and no corner that is the deepest is left out. A corner counts once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import casadi as ca

from symphys.model.shapes import SLOTS, Convex
from symphys.types import Expr

Point = Sequence[Any]
LEAN = 0.01
"""[rad] how much the ground is tilted, in thought, for the corners around a face."""
SIDES = tuple((cos(a), sin(a)) for a in (0.3 + 2 * pi * k / (SLOTS - 2) for k in range(SLOTS - 2)))
"""Directions in the ground; turned from its axes, so that faces along these have no two corners equally far out."""
DEEPER = 1e-6
"""Times its extent: what is deeper by less is equally deep. At rest rounding decides which corner of a face is."""
AWAY = 4.0
"""Times its extent: how far a slot without a corner of its own stays off the ground."""


@dataclass(frozen=True)
class OverGround:
    """A point of a hull at one instant: its height over the ground, and its place along two directions of it [m]."""

    height: Expr
    x: Expr
    y: Expr


Seen = Callable[[Expr], Callable[[Point], OverGround]]
"""Of a time, of a point (3,) along the shape's own axes."""


def slot_points(shape: Convex, seen: Seen, dt: Expr) -> list[tuple[tuple[Expr, ...], Expr]]:
    """For each slot a corner, along the shape's own axes, and a radius: 0, or less for a slot without a corner.

    Args:
        shape: the hull.
        seen: how its points lie over the ground.
        dt: length of the substep [s].
    """
    corners, away = shape.hull.corners.tolist(), -AWAY * shape.extent
    if len(corners) <= SLOTS:
        own = [(tuple(corner), 0.0) for corner in corners]
        return own + [(tuple(corners[0]), away)] * (SLOTS - len(corners))
    start, end = (lowest(corners, [each.height for each in map(seen(t), corners)]) for t in (ca.SX(0), dt))
    meets = ca.logic_and(start[0] > 0, end[0] < 0)
    share = ca.if_else(meets, start[0] / ca.if_else(meets, start[0] - end[0], 1), ca.if_else(start[0] > 0, 1, 0))
    then = list(map(seen(share * dt), corners))
    found = [lowest(corners, [each.height - LEAN * (c * each.x + s * each.y) for each in then])[1] for c, s in SIDES]
    slots = [(point, ca.if_else(taken(point, found[:k]), away, 0)) for k, point in enumerate(found)]
    for t, (least, point) in ((share * dt, lowest(corners, [each.height for each in then])), (dt, end)):
        others = [seen(t)(other).height for other in found]
        deeper = least < ca.mmin(ca.vertcat(*others)) - DEEPER * shape.extent
        slots.append((point, ca.if_else(deeper, 0, away)))
        found.append(point)
    return slots


def lowest(corners: Sequence[Point], heights: Sequence[Expr]) -> tuple[Expr, tuple[Expr, ...]]:
    """The least height, and the corner that has it; the first of equals."""
    least, point = heights[0], tuple(map(ca.SX, corners[0]))
    for corner, height in zip(corners[1:], heights[1:], strict=True):
        deeper = height < least
        least = ca.fmin(height, least)
        point = tuple(ca.if_else(deeper, new, old) for new, old in zip(corner, point, strict=True))
    return least, point


def taken(point: tuple[Expr, ...], before: Sequence[tuple[Expr, ...]]) -> Expr:
    """1 if a corner is among others."""
    found = ca.SX(0)
    for other in before:
        same = ca.logic_and(ca.logic_and(point[0] == other[0], point[1] == other[1]), point[2] == other[2])
        found = ca.logic_or(found, same)
    return found
