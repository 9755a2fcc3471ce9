"""A sphere on one body against a capsule on another."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.pairs.sphere_sphere import direction, distance
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.signed_distance import NEWTON_STEPS
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.model.shapes import Capsule, Sphere
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class BallAtCapsule:
    """A ball that one body carries against a capsule on another: all that counts of this is its axis.

    Attributes:
        radii: of the ball and of the capsule [m].
        half_length: of the capsule [m].
        path: of the ball's centre from the capsule's, world frame.
        arms: of both centres, from their bodies' centres of mass.
        starts: (3,) each: where both centres are at t_k [m].
        axis: of the capsule, of length 1 at t_k.
    """

    radii: tuple[Expr, Expr]
    half_length: Expr
    path: Parabola
    arms: tuple[Parabola, Parabola]
    starts: tuple[Expr, Expr]
    axis: Parabola

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        return distance(self._from_segment(self.path.at(t), self.axis.at(t))) - self.radii[0] - self.radii[1]

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        apart = self.path.at(t)
        away = self._from_segment(apart, self.axis.at(t))
        normal, foot = direction(away), apart - away
        arms = self.arms[0].at(t) - self.radii[0] * normal, self.arms[1].at(t) + foot + self.radii[1] * normal
        return Frame(normal, arms)

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        ball = first.moved(self.starts[0], self.arms[0].start)
        centre = second.moved(self.starts[1], self.arms[1].start)
        apart = ball - centre - ca.cross(second.angular, ball - centre)
        return distance(self._from_segment(apart, self.axis.start)) - self.radii[0] - self.radii[1]

    def _from_segment(self, apart: Expr, axis: Expr) -> Expr:
        """Return the vector (3,) from the nearest point of the capsule's segment."""
        along = ca.fmin(ca.fmax(ca.dot(axis, apart), -self.half_length), self.half_length)
        return apart - along * axis


def ball_at_capsule(path: Parabola, arm: Parabola, radius: Expr, capsule: Capsule, b: PredictedPath) -> Contact:
    """Return the contact of a ball with a capsule on b; ``path`` and ``arm`` of the ball's centre."""
    centre = b.path(capsule.centre)
    arms, axis = (arm, b.arm(capsule.centre)), axes(b, capsule)[2]
    radii, starts = (radius, capsule.radius), (path.start, centre.start)
    geometry = BallAtCapsule(radii, capsule.half_length, path - centre, arms, starts, axis)
    return contact_along(geometry, b.dt, NEWTON_STEPS)


def sphere_capsule(sphere: Sphere, capsule: Capsule, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    return [ball_at_capsule(a.path(sphere.centre), a.arm(sphere.centre), sphere.radius, capsule, b)]
