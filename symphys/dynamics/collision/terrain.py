"""Shapes on a body against terrain: their round ends and corners touch it, as balls or points that the body carries.

The surface is replaced by its osculating paraboloid below the place where the ball is expected to touch, so that it
is evaluated a few times a step only. Within a step that is right to third order in the distance covered. A ball that
fits into a valley at one place touches there; one that is too large for it touches at the nearest point that Newton's
method finds. Shapes with several balls or points (capsules, boxes) do not see a peak between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.collision.body_points import corners, ends
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import ZERO_PATH, PredictedPath, at_rest
from symphys.dynamics.collision.signed_distance import InField
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.model.shapes import Box, Capsule, Sphere, Terrain
from symphys.records import dataclass
from symphys.types import Expr

FOOT_STEPS = 3
"""Newton steps towards the foot of a perpendicular."""
MIN_DETERMINANT = 0.1
"""Least determinant of the squared distance's Hessian for Newton's method; else Gauss-Newton."""
MAX_FOOT_ERROR = 0.1
"""Largest deviation of a line from the perpendicular, as a share of its length, for it to count as a distance."""
MAX_STEP_RATIO = 10.0
"""Longest step of that search, as a multiple of the height over the surface."""
FREE_STEP = 0.1
"""[m] A step of this length is always allowed, since points near the surface need no bound."""
MIN_AREA = 1e-12
"""[m^2] below which squares of lengths count as zero there."""
Surface = Callable[[Expr], tuple[Expr, Expr, Expr]]
"""A function of x, y (2,): the height, its gradient (2,) and its Hessian (2, 2)."""


@dataclass(frozen=True)
class Paraboloid:
    """Distances from the graph z = height + slope . d + d . bend d / 2, d = (x, y) - place; (2,), (2, 2)."""

    place: Expr
    height: Expr
    slope: Expr
    bend: Expr

    def surface(self, xy: Expr) -> tuple[Expr, Expr, Expr]:
        """Implement ``Surface.surface``."""
        d = xy - self.place
        turn = ca.mtimes(self.bend, d)
        return self.height + ca.dot(self.slope, d) + ca.dot(d, turn) / 2, self.slope + turn, self.bend

    def distance(self, point: Expr) -> Expr:
        """Implement ``Field.distance``."""
        xy = nearest(self.surface, point)
        height, slope, _ = self.surface(xy)
        line = point - ca.vertcat(xy, height)
        return ca.dot(line, upwards(slope))

    def normal(self, point: Expr) -> Expr:
        """Implement ``Field.normal``."""
        return upwards(self.surface(nearest(self.surface, point))[1])


def upwards(slope: Expr) -> Expr:
    """Return the unit normal of a surface with this gradient (3,)."""
    return ca.vertcat(-slope, 1) / ca.sqrt(1 + ca.dot(slope, slope))


def foot(surface: Surface, point: Expr) -> Expr:
    """Return x, y (2,) of the surface's point that is nearest to ``point``, searched from straight below it."""
    xy, longest = point[:2], None
    for _ in range(FOOT_STEPS):
        height, slope, bend = surface(xy)
        over = point[2] - height
        longest = MAX_STEP_RATIO * ca.fabs(over) + FREE_STEP if longest is None else longest
        residual = xy - point[:2] - over * slope
        rough = ca.SX.eye(2) + ca.mtimes(slope, slope.T)
        exact = rough - over * bend
        convex = ca.logic_and(exact[0, 0] > MIN_DETERMINANT, determinant(exact) > MIN_DETERMINANT)
        step = solved(ca.if_else(convex, exact, rough), residual)
        xy = xy - ca.fmin(ca.fmax(step, -longest), longest)
    return xy


def nearest(surface: Surface, point: Expr) -> Expr:
    """Return x, y (2,) of the foot; of the place straight below if none was found, as far from a bent surface."""
    xy = foot(surface, point)
    height, slope, _ = surface(xy)
    line, normal = point - ca.vertcat(xy, height), upwards(slope)
    along = ca.dot(line, normal)
    aside = line - along * normal
    perpendicular = ca.dot(aside, aside) <= MAX_FOOT_ERROR**2 * ca.dot(line, line) + MIN_AREA
    same_side = along * (point[2] - surface(point[:2])[0]) >= -MIN_AREA
    return ca.if_else(ca.logic_and(perpendicular, same_side), xy, point[:2])


def determinant(m: Expr) -> Expr:
    """Return the determinant of a (2, 2) matrix."""
    return m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]


def solved(m: Expr, b: Expr) -> Expr:
    """Return m^-1 b (2,), with a determinant of at least ``MIN_DETERMINANT``, whatever rounding leaves of it."""
    found = ca.vertcat(m[1, 1] * b[0] - m[0, 1] * b[1], m[0, 0] * b[1] - m[1, 0] * b[0])
    return found / ca.fmax(determinant(m), MIN_DETERMINANT)


def ball_on_terrain(offset: Sequence[Any], radius: Expr, terrain: Terrain, a: PredictedPath) -> Contact:
    """Return the contact of a ball at body-frame ``offset`` with terrain."""
    path, world = a.path(offset), at_rest(a.dt)
    axes = world.arm((1.0, 0.0, 0.0)), world.arm((0.0, 1.0, 0.0)), world.arm((0.0, 0.0, 1.0))
    surface = surface_of(terrain)
    contact, centre = None, path.start
    for _ in range(2):
        xy = nearest(surface, centre)
        geometry = InField(
            Paraboloid(xy, *surface(xy)), radius, path, (a.arm(offset), ZERO_PATH), (path.start, ZERO_PATH.start), axes
        )
        contact = contact_along(geometry, a.dt)
        centre = path.at(contact.time)
    assert contact is not None
    return contact


def surface_of(terrain: Terrain) -> Surface:
    """Return height, gradient and Hessian of terrain."""
    xy = ca.SX.sym("xy", 2)
    height = ca.SX(terrain.height(xy[0], xy[1]))
    bend, slope = ca.hessian(height, xy)
    function = ca.Function("surface", [xy], [height, ca.densify(slope), ca.densify(bend)])
    return lambda place: tuple(function.call([place]))  # type: ignore[return-value]


def sphere_terrain(sphere: Sphere, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    return [ball_on_terrain(sphere.centre, sphere.radius, terrain, a)]


def capsule_terrain(capsule: Capsule, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return two points: the round ends."""
    return [ball_on_terrain(end, capsule.radius, terrain, a) for end in ends(capsule)]


def box_terrain(box: Box, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return eight points: the corners, balls where edges are round."""
    return [ball_on_terrain(corner, box.edge, terrain, a) for corner in corners(box)]
