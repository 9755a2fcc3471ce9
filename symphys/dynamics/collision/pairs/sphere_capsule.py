"""A sphere on one body against a capsule on another."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Expr
from symphys.dynamics.collision.pairs.sphere_sphere import direction, distance
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.model.shapes import Capsule, Sphere


@dataclass(frozen=True)
class CapsuleField:
    """Distances from a capsule along z: ``radius`` and ``half_length`` [m]."""

    radius: Expr
    half_length: Expr

    def distance(self, point: Expr) -> Expr:
        """See ``Field``."""
        return distance(self._from_segment(point)) - self.radius

    def normal(self, point: Expr) -> Expr:
        """See ``Field``."""
        return direction(self._from_segment(point))

    def _from_segment(self, point: Expr) -> Expr:
        along = ca.fmin(ca.fmax(point[2], -self.half_length), self.half_length)
        return ca.vertcat(point[0], point[1], point[2] - along)


def sphere_capsule(sphere: Sphere, capsule: Capsule, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """One point."""
    field = CapsuleField(capsule.radius, capsule.half_length)
    return [ball_in_field(a.path(sphere.centre), a.arm(sphere.centre), sphere.radius, capsule, field, b)]
