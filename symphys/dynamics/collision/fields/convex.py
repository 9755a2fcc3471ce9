"""A sphere on one body against a convex hull on another: the nearest of the hull's triangles, chosen once a substep.

It is chosen where the bodies are, and again where they are expected to touch. What rolls over an edge within a substep
is against the triangle that it comes from until the next one.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.signed_distance import ball_in_field
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.shapes import Convex, Sphere
from symphys.records import dataclass
from symphys.types import Expr

EDGES = ((0, 1), (1, 2), (2, 0))
"""The edges of a triangle."""


@dataclass(frozen=True)
class TriangleField:
    """Distances from a triangle of a hull: corners (3,) each [m], counter-clockwise as seen from outside.

    Negative behind the triangle itself, within its edges.
    """

    corners: tuple[Expr, Expr, Expr]

    def distance(self, point: Expr) -> Expr:
        """Implement ``Field.distance``."""
        height, within, away = self._foot(point)
        return ca.if_else(within, height, ca.sqrt(ca.dot(away, away) + TINY_SQUARE))

    def normal(self, point: Expr) -> Expr:
        """Implement ``Field.normal``."""
        _, within, away = self._foot(point)
        square = ca.dot(away, away)
        apart = ca.logic_and(ca.logic_not(within), square > TINY_SQUARE)
        return ca.if_else(apart, away / ca.sqrt(ca.fmax(square, TINY_SQUARE)), self._face())

    def _face(self) -> Expr:
        a, b, c = self.corners
        area = ca.cross(b - a, c - a)
        return area / ca.sqrt(ca.dot(area, area))

    def _foot(self, point: Expr) -> tuple[Expr, Expr, Expr]:
        """Return the height over the plane, whether the foot is within the edges, and the vector from these."""
        face = self._face()
        height, within, found = ca.dot(face, point - self.corners[0]), ca.SX(1), list[Expr]()
        for i, j in EDGES:
            edge, arm = self.corners[j] - self.corners[i], point - self.corners[i]
            within = ca.logic_and(within, ca.dot(ca.cross(face, edge), arm) >= 0)
            share = ca.fmin(ca.fmax(ca.dot(edge, arm) / ca.dot(edge, edge), 0), 1)
            found.append(arm - share * edge)
        away = found[0]
        for other in found[1:]:
            away = ca.if_else(ca.dot(other, other) < ca.dot(away, away), other, away)
        return height, within, away


def squared_distances(triangles: NDArray[np.float64], point: Expr) -> list[Expr]:
    """Return the squared distance of a point (3,) from each of (m, 3, 3) triangles [m^2]."""
    planes = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    planes /= np.linalg.norm(planes, axis=1, keepdims=True)
    height = ca.mtimes(ca.DM(planes), point) - ca.DM((planes * triangles[:, 0]).sum(axis=1))
    within, nearest = ca.SX(ca.DM.ones(len(triangles))), ca.SX(ca.DM.inf(len(triangles)))
    for i, j in EDGES:
        start, edge = triangles[:, i], triangles[:, j] - triangles[:, i]
        inward, length = np.cross(planes, edge), (edge**2).sum(axis=1)
        beside = ca.mtimes(ca.DM(inward), point) - ca.DM((inward * start).sum(axis=1))
        along = (ca.mtimes(ca.DM(edge), point) - ca.DM((edge * start).sum(axis=1))) / ca.DM(length)
        share = ca.fmin(ca.fmax(along, 0), 1)
        away = ca.SX(ca.DM.ones(len(triangles), 1)) @ point.T - ca.DM(start) - ca.repmat(share, 1, 3) * ca.DM(edge)
        square = ca.sum2(away * away)
        within = ca.logic_and(within, beside >= 0)
        nearest = ca.fmin(nearest, square)
    found: list[Expr] = ca.if_else(within, height * height, nearest).elements()
    return found


def nearest_triangle(shape: Convex, point: Expr) -> TriangleField:
    """Return the triangle of a hull that is nearest to a point (3,), along the shape's own axes."""
    triangles = shape.hull.corners[shape.hull.triangles]
    squares = squared_distances(triangles, point)
    least, chosen = squares[0], ca.SX(ca.DM(triangles[0].ravel()))
    for square, triangle in zip(squares[1:], triangles[1:], strict=True):
        chosen = ca.if_else(square < least, ca.DM(triangle.ravel()), chosen)
        least = ca.fmin(square, least)
    return TriangleField((chosen[0:3], chosen[3:6], chosen[6:9]))


def sphere_convex(sphere: Sphere, shape: Convex, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    path, frame = a.path(sphere.centre), axes(b, shape)
    apart = path - b.path(shape.centre)
    contact, time = None, ca.SX(0)
    for _ in range(2):
        inside = ca.vertcat(*(ca.dot(axis.at(time), apart.at(time)) for axis in frame))
        field = nearest_triangle(shape, inside)
        contact = ball_in_field(path, a.arm(sphere.centre), sphere.radius, shape, field, b)
        time = contact.time
    assert contact is not None
    return [contact]
