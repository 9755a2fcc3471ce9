"""An ellipsoid on a body against a static plane or terrain: its one lowest point, in closed form."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.body_points import axes
from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.terrain import (
    MIN_DETERMINANT,
    Paraboloid,
    determinant,
    nearest,
    solved,
    surface_of,
    upwards,
)
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.maths.smoothing import length
from symphys.model.shapes import Ellipsoid, Plane, Terrain
from symphys.records import dataclass
from symphys.types import Expr

TOUCH_STEPS = 4
"""Newton steps towards the place where the ellipsoid and bent ground are parallel."""


@dataclass(frozen=True)
class MovingEllipsoid:
    """An ellipsoid over the step: paths of its centre, of that from the centre of mass, and of its axes; radii [m]."""

    centre: Parabola
    arm: Parabola
    axes: tuple[Parabola, Parabola, Parabola]
    radii: tuple[Expr, ...]

    def support(self, normal: Expr, t: Expr) -> Expr:
        """Return the vector (3,) [m] from the centre to the farthest point along a vector."""
        along = [r * r * ca.dot(axis.at(t), normal) * axis.at(t) for r, axis in zip(self.radii, self.axes, strict=True)]
        return sum(along) / self.reach(normal, t)

    def reach(self, normal: Expr, t: Expr) -> Expr:
        """Return the support along a vector: the extent from the centre times the vector's length."""
        return length(
            ca.vertcat(*(r * ca.dot(axis.at(t), normal) for r, axis in zip(self.radii, self.axes, strict=True)))
        )


def moving(ellipsoid: Ellipsoid, a: PredictedPath) -> MovingEllipsoid:
    """Return an ellipsoid that is carried along a path."""
    return MovingEllipsoid(a.path(ellipsoid.centre), a.arm(ellipsoid.centre), axes(a, ellipsoid), ellipsoid.radii)


def turned_back(normal: Expr, displacement: Displacement) -> Expr:
    """Return a unit vector (3,) of the world as a displaced body sees it, to third order in the turn."""
    turned = normal - ca.cross(displacement.angular, normal)
    return turned / length(turned)


@dataclass(frozen=True)
class EllipsoidOnPlane:
    """An ellipsoid over {x: normal . x = offset}."""

    normal: Expr
    offset: Expr
    solid: MovingEllipsoid

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        return ca.dot(self.normal, self.solid.centre.at(t)) - self.offset - self.solid.reach(self.normal, t)

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        arm = self.solid.arm.at(t) - self.solid.support(self.normal, t)
        return Frame(self.normal, (arm, ca.SX.zeros(3)))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        centre = first.moved(self.solid.centre.start, self.solid.arm.start)
        reach = self.solid.reach(turned_back(self.normal, first), ca.SX(0))
        return ca.dot(self.normal, centre) - self.offset - reach


def ellipsoid_plane(ellipsoid: Ellipsoid, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    return [contact_along(EllipsoidOnPlane(ca.vertcat(*plane.normal), plane.offset, moving(ellipsoid, a)), a.dt)]


@dataclass(frozen=True)
class EllipsoidOnTerrain:
    """An ellipsoid over ground that is a paraboloid."""

    ground: Paraboloid
    solid: MovingEllipsoid

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        return self._apart(self.solid, t, self._place(self.solid, t))

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        normal = upwards(self.ground.surface(self._place(self.solid, t))[1])
        return Frame(normal, (self.solid.arm.at(t) - self.solid.support(normal, t), ca.SX.zeros(3)))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after`` over the tangent plane at the first point of touch."""
        place = self._place(self.solid, ca.SX(0))
        height, slope, _ = self.ground.surface(place)
        normal = upwards(slope)
        centre = first.moved(self.solid.centre.start, self.solid.arm.start) - ca.vertcat(place, height)
        return ca.dot(normal, centre) - self.solid.reach(turned_back(normal, first), ca.SX(0))

    def _apart(self, solid: MovingEllipsoid, t: Expr, place: Expr) -> Expr:
        height, slope, _ = self.ground.surface(place)
        normal = upwards(slope)
        return ca.dot(normal, solid.centre.at(t) - ca.vertcat(place, height)) - solid.reach(normal, t)

    def _place(self, solid: MovingEllipsoid, t: Expr) -> Expr:
        """Return x, y (2,) where the ground is parallel to the ellipsoid's nearest point, by Newton's method.

        Where the ground is bent more than the ellipsoid, so that there is no one such place, by that of Gauss.
        """
        place = nearest(self.ground.surface, solid.centre.at(t))
        for _ in range(TOUCH_STEPS):
            height, slope, bend = self.ground.surface(place)
            square = 1 + ca.dot(slope, slope)
            normal = upwards(slope)
            tangents = ca.vertcat(ca.SX.eye(2), slope.T)
            over = solid.centre.at(t) - solid.support(normal, t) - ca.vertcat(place, height)
            # how the lowest point moves as the normal turns with the place
            turn = -(ca.SX.eye(3) - ca.mtimes(normal, normal.T))[:, :2] / ca.sqrt(square)
            moves = ca.mtimes([tangents.T, self._bend_of_support(solid, normal, t), turn, bend])
            rough = ca.SX.eye(2) + ca.mtimes(slope, slope.T)
            exact = rough - over[2] * bend + moves
            convex = ca.logic_and(exact[0, 0] > MIN_DETERMINANT, determinant(exact) > MIN_DETERMINANT)
            place = place + solved(ca.if_else(convex, exact, rough), ca.mtimes(tangents.T, over))
        return place

    def _bend_of_support(self, solid: MovingEllipsoid, normal: Expr, t: Expr) -> Expr:
        """Return the derivative of the support with respect to the normal [m] (3, 3)."""
        form = sum(r * r * ca.mtimes(axis.at(t), axis.at(t).T) for r, axis in zip(solid.radii, solid.axes, strict=True))
        support = solid.support(normal, t)
        return (form - ca.mtimes(support, support.T)) / solid.reach(normal, t)


def ellipsoid_terrain(ellipsoid: Ellipsoid, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return the one point of contact."""
    solid, surface = moving(ellipsoid, a), surface_of(terrain)
    contact, place = None, nearest(surface, solid.centre.start)
    for _round in range(2):
        geometry = EllipsoidOnTerrain(Paraboloid(place, *surface(place)), solid)
        contact = contact_along(geometry, a.dt)
        place = geometry._place(solid, contact.time)
    assert contact is not None
    return [contact]
