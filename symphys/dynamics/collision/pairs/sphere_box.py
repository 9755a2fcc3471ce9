"""A sphere on one body against a box on another."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Expr
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Box, Sphere


@dataclass(frozen=True)
class BoxField:
    """Distances from a box: ``half_sizes`` (3,) [m].

    Outside the nearest point of the surface counts, inside the nearest face.
    """

    half_sizes: tuple[Expr, ...]

    def distance(self, point: Expr) -> Expr:
        """See ``Field``."""
        over = self._over(point)
        outside = ca.fmax(over, 0)
        return ca.sqrt(ca.dot(outside, outside) + TINY_SQUARE) + ca.fmin(ca.fmax(ca.fmax(over[0], over[1]), over[2]), 0)

    def normal(self, point: Expr) -> Expr:
        """See ``Field``."""
        over = self._over(point)
        outside = ca.fmax(over, 0)
        square = ca.dot(outside, outside)
        sign = ca.if_else(point >= 0, 1, -1)
        away = sign * outside / ca.sqrt(ca.fmax(square, TINY_SQUARE))
        return ca.if_else(square > TINY_SQUARE, away, sign * self._nearest_face(over))

    def _over(self, point: Expr) -> Expr:
        """(3,): how far the point is beyond the faces."""
        reach: Expr = ca.fabs(point)
        return reach - ca.vertcat(*self.half_sizes)

    def _nearest_face(self, over: Expr) -> Expr:
        """(3,): 1 for the axis of the nearest face; the first of equals."""
        x = ca.logic_and(over[0] >= over[1], over[0] >= over[2])
        y = ca.logic_and(ca.logic_not(x), over[1] >= over[2])
        return ca.vertcat(x, y, ca.logic_not(ca.logic_or(x, y)))


def sphere_box(sphere: Sphere, box: Box, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """One point."""
    path, arm = a.path(sphere.centre), a.arm(sphere.centre)
    return [ball_in_field(path, arm, sphere.radius, box, BoxField(box.half_sizes), b)]
