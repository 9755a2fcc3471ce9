"""A sphere on one body against a box on another.

A ball that rolls level over the rim of a top touches the top alone. The predicted path lacks the force that supports
the ball: it sinks there, and would strike the rim of the next of two boards that lie flush.
"""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.body_points import Offset, axes
from symphys.dynamics.collision.box_geometry import MIN_OVERLAP, is_nearly_vertical
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Box, Sphere
from symphys.records import dataclass
from symphys.types import Expr

MIN_RIM_APPROACH = 1e-9
"""[m] Smallest approach to a face in a step by which a ball counts as coming over its rim."""


@dataclass(frozen=True)
class BoxField:
    """Distances from a box: outside to the nearest point of its surface, inside to the nearest face.

    Attributes:
        half_sizes: (3,) [m].
        endless: per axis: 1 where the box counts as if it went on along it beyond its faces; empty: nowhere.
    """

    half_sizes: tuple[Expr, ...]
    endless: tuple[Expr, ...] = ()

    def distance(self, point: Expr) -> Expr:
        """Implement ``Field.distance``."""
        over = self._over(point)
        outside = ca.fmax(over, 0)
        return ca.sqrt(ca.dot(outside, outside) + TINY_SQUARE) + ca.fmin(ca.fmax(ca.fmax(over[0], over[1]), over[2]), 0)

    def normal(self, point: Expr) -> Expr:
        """Implement ``Field.normal``."""
        over = self._over(point)
        outside = ca.fmax(over, 0)
        square = ca.dot(outside, outside)
        sign = ca.if_else(point >= 0, 1, -1)
        away = sign * outside / ca.sqrt(ca.fmax(square, TINY_SQUARE))
        return ca.if_else(square > TINY_SQUARE, away, sign * self._nearest_face(over))

    def _over(self, point: Expr) -> Expr:
        """Return how far the point is beyond the faces (3,)."""
        reach: Expr = ca.fabs(point)
        over = reach - ca.vertcat(*self.half_sizes)
        return ca.if_else(ca.vertcat(*self.endless), ca.fmin(over, 0), over) if self.endless else over

    def _nearest_face(self, over: Expr) -> Expr:
        """Return a vector (3,) that is 1 for the axis of the nearest face; the first of equals."""
        x = ca.logic_and(over[0] >= over[1], over[0] >= over[2])
        y = ca.logic_and(ca.logic_not(x), over[1] >= over[2])
        return ca.vertcat(x, y, ca.logic_not(ca.logic_or(x, y)))


def sphere_box(sphere: Sphere, box: Box, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    return [ball_at_box(sphere.centre, sphere.radius, box, a, b)]


def ball_at_box(offset: Offset, radius: Expr, box: Box, a: PredictedPath, b: PredictedPath) -> Contact:
    """Return the contact of a ball at body-frame ``offset`` of a with a box on b."""
    field = BoxField(box.half_sizes, rolls_onto(offset, radius, box, a, b))
    return ball_in_field(a.path(offset), a.arm(offset), radius, box, field, b)


def rolls_onto(offset: Offset, radius: Expr, box: Box, a: PredictedPath, b: PredictedPath) -> tuple[Expr, ...]:
    """Return for each axis of the box 1 if a ball passes over a rim across it, at the height of a face."""
    gravity = a.gravity if a.gravity is not None else b.gravity
    if gravity is None:
        return ()
    own = [axis.start for axis in axes(b, box)]
    apart = (a.path(offset) - b.path(box.centre)).start
    velocity = a.true_velocity_of(offset) - b.true_velocity_of(box.centre) - ca.cross(b.angular_velocity, apart)
    now, change = (ca.vertcat(*(ca.dot(axis, vector) for axis in own)) for vector in (apart, a.dt * velocity))
    before, after = (ca.fabs(place) - ca.vertcat(*box.half_sizes) for place in (now, now + change))
    onto = ca.logic_or(after <= 0, ca.logic_and(after < before - MIN_RIM_APPROACH, after <= radius))
    level = ca.fmin(before, after) >= radius - MIN_OVERLAP
    tops = [ca.logic_and(level[k], is_nearly_vertical(own[k], gravity)) for k in range(3)]
    over = [ca.logic_and(tops[k], ca.logic_and(onto[(k + 1) % 3], onto[(k + 2) % 3])) for k in range(3)]
    return tuple(ca.logic_or(over[(k + 1) % 3], over[(k + 2) % 3]) for k in range(3))
