"""Spheres and capsules on one body against a cylinder on another."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.fields.capsule import capsule_in_field
from symphys.dynamics.collision.pairs.sphere_sphere import direction, distance
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Capsule, Cylinder, Sphere
from symphys.records import dataclass
from symphys.types import Expr

MIN_AXIS_DISTANCE = 2e-12
"""[m] from the axis at which a point counts that is nearer to it, so that it has a direction."""


@dataclass(frozen=True)
class CylinderField:
    """Distances from a cylinder along z: ``radius`` and ``half_length`` [m].

    Outside the nearest point of the surface counts, inside the side or the nearest end.
    """

    radius: Expr
    half_length: Expr

    def distance(self, point: Expr) -> Expr:
        """Implement ``Field.distance``."""
        side, end = self._over(point)
        out_side, out_end = ca.fmax(side, 0), ca.fmax(end, 0)
        return ca.sqrt(out_side * out_side + out_end * out_end + TINY_SQUARE) + ca.fmin(ca.fmax(side, end), 0)

    def normal(self, point: Expr) -> Expr:
        """Implement ``Field.normal``."""
        side, end = self._over(point)
        out_side, out_end = ca.fmax(side, 0), ca.fmax(end, 0)
        square = out_side * out_side + out_end * out_end
        away, size = square > TINY_SQUARE, ca.sqrt(ca.fmax(square, TINY_SQUARE))
        nearer_side = side >= end
        across = ca.if_else(away, out_side / size, nearer_side)
        along = ca.if_else(away, out_end / size, ca.logic_not(nearer_side))
        outward = direction(self._from_axis(point))
        return across * outward + along * ca.if_else(point[2] >= 0, 1, -1) * ca.SX([0, 0, 1])

    def _from_axis(self, point: Expr) -> Expr:
        """Return the vector (3,) from the axis to a point; along x where the point is on it."""
        on_axis = point[0] * point[0] + point[1] * point[1] < TINY_SQUARE
        return ca.vertcat(point[0] + ca.if_else(on_axis, MIN_AXIS_DISTANCE, 0), point[1], 0)

    def _over(self, point: Expr) -> tuple[Expr, Expr]:
        """Return how far the point is beyond the side and beyond the nearer end [m]."""
        return distance(self._from_axis(point)) - self.radius, ca.fabs(point[2]) - self.half_length


def sphere_cylinder(sphere: Sphere, cylinder: Cylinder, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    field = CylinderField(cylinder.radius, cylinder.half_length)
    return [ball_in_field(a.path(sphere.centre), a.arm(sphere.centre), sphere.radius, cylinder, field, b)]


def capsule_cylinder(capsule: Capsule, cylinder: Cylinder, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return three points: the round ends, and where the side is nearest."""
    field = CylinderField(cylinder.radius, cylinder.half_length)
    return capsule_in_field(capsule, cylinder, field, a, b)
