"""A ball that one body carries against a shape whose distance is known everywhere, in that shape's own frame."""

from __future__ import annotations

from typing import Protocol

import casadi as ca

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.model.shapes import SolidShape
from symphys.records import dataclass
from symphys.types import Expr

NEWTON_STEPS = 5
"""Towards the instant of touch: with 3 a tenth of what flies through a thin wall in one step is not seen to hit it."""


class Field(Protocol):
    """Distances from a shape at the origin. Implementations are frozen dataclasses."""

    def distance(self, point: Expr) -> Expr:
        """Return the signed distance of a point (3,) from the surface [m], negative inside."""
        ...

    def normal(self, point: Expr) -> Expr:
        """Return the unit vector in which the distance grows (3,)."""
        ...


@dataclass(frozen=True)
class InField:
    """A ball in the field of a shape.

    Attributes:
        field: of the shape.
        radius: of the ball [m].
        path: of the ball's centre from the shape's centre, world frame.
        arms: of the ball's centre and of the shape's centre, from their bodies' centres of mass.
        starts: (3,) each: where both centres are at t_k [m].
        axes: the shape's.
    """

    field: Field
    radius: Expr
    path: Parabola
    arms: tuple[Parabola, Parabola]
    starts: tuple[Expr, Expr]
    axes: tuple[Parabola, Parabola, Parabola]

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        return self.field.distance(self._inside(self.path.at(t), t)) - self.radius

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        apart = self.path.at(t)
        point = self._inside(apart, t)
        normal = self._outside(self.field.normal(point), t)
        foot = apart - self.field.distance(point) * normal
        return Frame(normal, (self.arms[0].at(t) - self.radius * normal, self.arms[1].at(t) + foot))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        ball = first.moved(self.starts[0], self.arms[0].start)
        centre = second.moved(self.starts[1], self.arms[1].start)
        apart = ball - centre - ca.cross(second.angular, ball - centre)
        return self.field.distance(self._inside(apart, 0)) - self.radius

    def _inside(self, vector: Expr, t: Expr) -> Expr:
        """Return a world vector in the shape's frame."""
        return ca.vertcat(*(ca.dot(axis.at(t), vector) for axis in self.axes))

    def _outside(self, vector: Expr, t: Expr) -> Expr:
        """Return a vector of the shape's frame in the world's, at its length."""
        turned = sum(vector[i] * axis.at(t) for i, axis in enumerate(self.axes))
        return turned / ca.sqrt(ca.dot(turned, turned))


def ball_in_field(
    path: Parabola, arm: Parabola, radius: Expr, shape: SolidShape, field: Field, b: PredictedPath
) -> Contact:
    """Return the contact of a ball with a shape on b; ``path`` and ``arm`` of the ball's centre."""
    centre = b.path(shape.centre)
    arms = (arm, b.arm(shape.centre))
    geometry = InField(field, radius, path - centre, arms, (path.start, centre.start), axes(b, shape))
    return contact_along(geometry, b.dt, NEWTON_STEPS)
