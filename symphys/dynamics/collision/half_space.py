"""Shapes on a body against a static plane: each touches it with balls or points that the body carries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.collision.body_points import corners, ends
from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.time_of_impact import first_root
from symphys.model.shapes import Box, Capsule, Plane, Sphere
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class OnPlane:
    """A ball against a plane.

    Attributes:
        normal: (3,).
        offset: [m].
        radius: [m].
        arm: from the body's centre of mass to the ball's centre.
        centre: (3,) of the ball at t_k [m].
    """

    normal: Expr
    offset: Expr
    radius: Expr
    arm: Parabola
    centre: Expr

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        return Frame(self.normal, (self.arm.at(t) - self.radius * self.normal, ca.SX.zeros(3)))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        return ca.dot(self.normal, first.moved(self.centre, self.arm.start)) - self.offset - self.radius


def ball_on_plane(body_path: PredictedPath, offset: Sequence[Any], radius: Expr, plane: Plane) -> Contact:
    """Return the contact of a ball at body-frame ``offset`` with ``plane``."""
    normal, path, dt = ca.vertcat(*plane.normal), body_path.path(offset), body_path.dt
    gap = ca.dot(normal, path.start) - plane.offset - radius
    rate = ca.dot(normal, path.velocity)
    bend = ca.dot(normal, path.acceleration)
    end = gap + dt * rate + dt * dt / 2 * bend
    return Contact(
        gap=gap,
        rate=rate,
        hit=end < 0,
        time=first_root(gap, rate, bend, dt),
        end=end,
        geometry=OnPlane(normal, plane.offset, radius, body_path.arm(offset), path.start),
    )


def sphere_plane(sphere: Sphere, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    return [ball_on_plane(a, sphere.centre, sphere.radius, plane)]


def capsule_plane(capsule: Capsule, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return two points: the round ends."""
    return [ball_on_plane(a, end, capsule.radius, plane) for end in ends(capsule)]


def box_plane(box: Box, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return eight points: the corners, balls where edges are round."""
    return [ball_on_plane(a, corner, box.edge, plane) for corner in corners(box)]
