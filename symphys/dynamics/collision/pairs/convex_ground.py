"""A convex hull on a body against a static plane or terrain: its corners, in eight slots; see ``hull_slots``.

On terrain corners are chosen over the paraboloid below the hull's centre, and measured over the terrain itself.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from symphys.dynamics.collision.body_points import axes, placed
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.hull_slots import OverGround, Point, slot_points
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.terrain import Paraboloid, ball_on_terrain, surface_of
from symphys.model.shapes import Convex, Plane, Terrain
from symphys.types import Expr


def convex_plane(shape: Convex, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Eight points."""
    normal, centre, frame = ca.vertcat(*plane.normal), a.path(shape.centre), axes(a, shape)
    across = tangents(ca.SX(normal))

    def seen(t: Expr) -> Callable[[Point], OverGround]:
        base, own = ca.dot(normal, centre.at(t)) - plane.offset, [axis.at(t) for axis in frame]
        up, x, y = ([ca.dot(direction, axis) for axis in own] for direction in (normal, *across))
        return lambda point: OverGround(base + along(up, point), along(x, point), along(y, point))

    return [ball_on_plane(a, placed(shape, point), radius, plane) for point, radius in slot_points(shape, seen, a.dt)]


def convex_terrain(shape: Convex, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Eight points."""
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
    """The sum of three parts, each times a coordinate."""
    return parts[0] * point[0] + parts[1] * point[1] + parts[2] * point[2]


def tangents(n: Expr) -> tuple[Expr, Expr]:
    """Two unit vectors (3,) at right angles to a unit vector and to each other.

    Duff and others, "Building an orthonormal basis, revisited", 2017.
    """
    sign = ca.if_else(n[2] >= 0, 1, -1)
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    return ca.vertcat(1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), ca.vertcat(b, sign + n[1] * n[1] * a, -n[1])
