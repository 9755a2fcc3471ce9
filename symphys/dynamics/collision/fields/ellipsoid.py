"""Spheres and capsules on one body against an ellipsoid on another."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.fields.capsule import capsule_in_field
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.maths.smoothing import TINY_SQUARE, length
from symphys.model.shapes import Capsule, Ellipsoid, Sphere
from symphys.records import dataclass
from symphys.types import Expr

FOOT_STEPS = 5
"""Newton steps towards the foot of a perpendicular."""
POLE_MARGIN = 0.02
"""Least distance of the multiplier from its pole, as a share of the smallest squared radius, for points deep inside."""


@dataclass(frozen=True)
class EllipsoidField:
    """Distances from an ellipsoid: ``radii`` (3,) [m].

    The foot of the perpendicular from p is r_i^2 p_i / (r_i^2 + m), where |r_i p_i / (r_i^2 + m)| = 1. Newton's method
    is applied to 1 / |.| - 1, which is nearly linear in m (More and Sorensen, "Computing a trust region step", 1983),
    from the largest m at which one term alone is 1. Deep inside, beyond the centres of curvature, a distance is too
    small.
    """

    radii: tuple[Expr, ...]

    def distance(self, point: Expr) -> Expr:
        """Implement ``Field.distance``."""
        multiplier, parts = self._foot(point)
        return multiplier * length(parts)

    def normal(self, point: Expr) -> Expr:
        """Implement ``Field.normal``."""
        parts = self._foot(point)[1]
        upright = ca.if_else(ca.dot(parts, parts) > TINY_SQUARE, 0, 1) * ca.SX([0, 0, 1])
        return (parts + upright) / length(parts + upright)

    def _foot(self, point: Expr) -> tuple[Expr, Expr]:
        """Return the multiplier m, and p_i / (r_i^2 + m): a vector along the normal."""
        radii = ca.vertcat(*map(ca.SX, self.radii))
        squares, scaled = radii * radii, radii * point
        low = (POLE_MARGIN - 1) * ca.mmin(squares)
        m = ca.fmax(ca.mmax(ca.fabs(scaled) - squares), low)
        for _ in range(FOOT_STEPS):
            parts = scaled / (squares + m)
            square = ca.dot(parts, parts) + TINY_SQUARE
            slope = ca.dot(parts, parts / (squares + m)) + TINY_SQUARE
            m = ca.fmax(m + (ca.sqrt(square) - 1) * square / slope, low)
        return m, point / (squares + m)


def sphere_ellipsoid(sphere: Sphere, ellipsoid: Ellipsoid, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    field = EllipsoidField(ellipsoid.radii)
    return [ball_in_field(a.path(sphere.centre), a.arm(sphere.centre), sphere.radius, ellipsoid, field, b)]


def capsule_ellipsoid(capsule: Capsule, ellipsoid: Ellipsoid, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return three points: the round ends, and where the side is nearest."""
    return capsule_in_field(capsule, ellipsoid, EllipsoidField(ellipsoid.radii), a, b)
