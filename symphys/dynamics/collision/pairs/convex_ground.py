"""A convex hull on a body against a static plane or terrain: its corners, in eight slots.

On terrain corners are chosen over the paraboloid below the hull's centre, and measured over the terrain itself.

A hull of few corners has a slot for each. Of many, six slots take the deepest on ground that leans by ``TILT`` to six
sides: these are the outermost corners of a face that lies on the ground, and both ends of an edge. Two more take the
deepest where it is expected to touch, and at the end of the substep, if it is deeper than those. So a hull stands on
its faces and rolls over its edges, and no corner that is the deepest is left out. A corner counts once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi, sin
from typing import Any

import casadi as ca

from symphys.dynamics.collision.body_points import axes, placed
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.terrain import Paraboloid, ball_on_terrain, surface_of
from symphys.model.shapes import SLOTS, Convex, Plane, Terrain
from symphys.records import dataclass
from symphys.types import Expr

Point = Sequence[Any]
TILT = 0.01
"""[rad] how much the ground is tilted, in thought, for the corners around a face."""
TILT_DIRECTIONS = tuple((cos(a), sin(a)) for a in (0.3 + 2 * pi * k / (SLOTS - 2) for k in range(SLOTS - 2)))
"""Directions in the ground; turned from its axes, so that faces along these have no two corners equally far out."""
EQUAL_DEPTH_SHARE = 1e-6
"""Times its extent: what is deeper by less is equally deep. At rest rounding decides which corner of a face is."""
EMPTY_SLOT_HEIGHT = 4.0
"""Times its extent: how far a slot without a corner of its own stays off the ground."""


@dataclass(frozen=True)
class OverGround:
    """A point of a hull at one instant: its height over the ground, and its place along two directions of it [m]."""

    height: Expr
    x: Expr
    y: Expr


Seen = Callable[[Expr], Callable[[Point], OverGround]]
"""A function of time, whose value is a function of a point (3,) along the shape's own axes."""


def slot_points(shape: Convex, seen: Seen, dt: Expr) -> list[tuple[tuple[Expr, ...], Expr]]:
    """Return for each slot a corner in the shape's axes, and a radius: 0, or negative for an empty slot.

    Args:
        shape: the hull.
        seen: how its points lie over the ground.
        dt: length of the substep [s].
    """
    corners, away = shape.hull.corners.tolist(), -EMPTY_SLOT_HEIGHT * shape.extent
    if len(corners) <= SLOTS:
        own = [(tuple(corner), 0.0) for corner in corners]
        return own + [(tuple(corners[0]), away)] * (SLOTS - len(corners))
    start, end = (lowest(corners, [each.height for each in map(seen(t), corners)]) for t in (ca.SX(0), dt))
    meets = ca.logic_and(start[0] > 0, end[0] < 0)
    share = ca.if_else(meets, start[0] / ca.if_else(meets, start[0] - end[0], 1), ca.if_else(start[0] > 0, 1, 0))
    then = list(map(seen(share * dt), corners))
    found = [
        lowest(corners, [each.height - TILT * (c * each.x + s * each.y) for each in then])[1]
        for c, s in TILT_DIRECTIONS
    ]
    slots = [(point, ca.if_else(is_among(point, found[:k]), away, 0)) for k, point in enumerate(found)]
    for t, (least, point) in ((share * dt, lowest(corners, [each.height for each in then])), (dt, end)):
        others = [seen(t)(other).height for other in found]
        deeper = least < ca.mmin(ca.vertcat(*others)) - EQUAL_DEPTH_SHARE * shape.extent
        slots.append((point, ca.if_else(deeper, 0, away)))
        found.append(point)
    return slots


def lowest(corners: Sequence[Point], heights: Sequence[Expr]) -> tuple[Expr, tuple[Expr, ...]]:
    """Return the least height, and the corner that has it; the first of equals."""
    least, point = heights[0], tuple(map(ca.SX, corners[0]))
    for corner, height in zip(corners[1:], heights[1:], strict=True):
        deeper = height < least
        least = ca.fmin(height, least)
        point = tuple(ca.if_else(deeper, new, old) for new, old in zip(corner, point, strict=True))
    return least, point


def is_among(point: tuple[Expr, ...], before: Sequence[tuple[Expr, ...]]) -> Expr:
    """Return 1 if a corner is among others."""
    found = ca.SX(0)
    for other in before:
        same = ca.logic_and(ca.logic_and(point[0] == other[0], point[1] == other[1]), point[2] == other[2])
        found = ca.logic_or(found, same)
    return found


def convex_plane(shape: Convex, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return eight points."""
    normal, centre, frame = ca.vertcat(*plane.normal), a.path(shape.centre), axes(a, shape)
    across = tangents(ca.SX(normal))

    def seen(t: Expr) -> Callable[[Point], OverGround]:
        base, own = ca.dot(normal, centre.at(t)) - plane.offset, [axis.at(t) for axis in frame]
        up, x, y = ([ca.dot(direction, axis) for axis in own] for direction in (normal, *across))
        return lambda point: OverGround(base + along(up, point), along(x, point), along(y, point))

    return [ball_on_plane(a, placed(shape, point), radius, plane) for point, radius in slot_points(shape, seen, a.dt)]


def convex_terrain(shape: Convex, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return eight points."""
    centre, frame, surface = a.path(shape.centre), axes(a, shape), surface_of(terrain)
    x, y, z = shape.hull.centroid.tolist()
    middle = a.path(placed(shape, (x, y, z))).start[:2]
    ground = Paraboloid(middle, *surface(middle))

    def seen(t: Expr) -> Callable[[Point], OverGround]:
        base, own = centre.at(t), [axis.at(t) for axis in frame]

        def over(point: Point) -> OverGround:
            at = base + along(own, point)
            return OverGround(at[2] - ground.surface(at[:2])[0], at[0], at[1])

        return over

    return [ball_on_terrain(placed(shape, point), r, terrain, a) for point, r in slot_points(shape, seen, a.dt)]


def along(parts: list[Expr], point: Point) -> Expr:
    """Return the sum of three parts, each times a coordinate."""
    return parts[0] * point[0] + parts[1] * point[1] + parts[2] * point[2]


def tangents(n: Expr) -> tuple[Expr, Expr]:
    """Return two unit vectors (3,) at right angles to a unit vector and to each other.

    Duff and others, "Building an orthonormal basis, revisited", 2017.
    """
    sign = ca.if_else(n[2] >= 0, 1, -1)
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    return ca.vertcat(1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), ca.vertcat(b, sign + n[1] * n[1] * a, -n[1])
