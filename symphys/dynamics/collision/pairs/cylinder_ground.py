"""A cylinder on a body against a static plane or terrain: three points of each rim.

The deepest point of the rim wanders over it as the cylinder rolls, and two more lie 120 degrees to either side of it:
with both rims it lies and rolls on two points, and stands on its face on three. Where a face is parallel to the ground,
up to rounding, no point of its rim is the deepest, and the three are marked on the body.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import casadi as ca

from symphys.dynamics.collision.body_points import SIGNS, Offset, axes, placed
from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.pairs.ellipsoid_ground import turned_back
from symphys.dynamics.collision.predicted_path import Parabola, PredictedPath
from symphys.dynamics.collision.terrain import ball_on_terrain, surface_of, upwards
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.maths.smoothing import length
from symphys.model.shapes import Cylinder, Plane, Terrain
from symphys.records import dataclass
from symphys.types import Expr

MIN_TILT_SINE = 1e-6
"""Sine of the angle between a face and the ground below which they count as parallel."""
RIM_ANGLES = (2 * pi / 3, -2 * pi / 3)
"""[rad] from the deepest point of a rim to the others."""


@dataclass(frozen=True)
class RimOnPlane:
    """The deepest point of a rim over {x: normal . x = offset}.

    Attributes:
        normal: (3,).
        offset: [m].
        radius: [m].
        centre: path of the rim's centre.
        arm: of that, from the body's centre of mass.
        axis: path of the cylinder's axis.
        side: path of a direction across it that the body carries.
    """

    normal: Expr
    offset: Expr
    radius: Expr
    centre: Parabola
    arm: Parabola
    axis: Parabola
    side: Parabola

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        down = downhill(self.normal, self.axis.at(t), self.side.at(t))
        return ca.dot(self.normal, self.centre.at(t) + self.radius * down) - self.offset

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``."""
        down = downhill(self.normal, self.axis.at(t), self.side.at(t))
        return Frame(self.normal, (self.arm.at(t) + self.radius * down, ca.SX.zeros(3)))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        normal, centre = turned_back(self.normal, first), first.moved(self.centre.start, self.arm.start)
        down = downhill(normal, self.axis.start, self.side.start)
        return ca.dot(self.normal, centre) + self.radius * ca.dot(normal, down) - self.offset


def downhill(normal: Expr, axis: Expr, side: Expr) -> Expr:
    """Return the unit vector across ``axis`` that points most against ``normal`` (3,); ``side`` where that has none."""
    down = axis * ca.dot(axis, normal) - normal
    level = ca.dot(down, down) < MIN_TILT_SINE * MIN_TILT_SINE
    chosen = ca.if_else(level, side, down)
    return chosen / length(chosen)


def rim_point(cylinder: Cylinder, sign: float, down: tuple[Expr, Expr], turn: float) -> Offset:
    """Return a point of a rim, body frame: a turn [rad] from ``down`` (x, y of the cylinder's own axes)."""
    (x, y), c, s = down, cos(turn), sin(turn)
    r = cylinder.radius
    return placed(cylinder, (r * (c * x - s * y), r * (s * x + c * y), sign * cylinder.half_length))


def own_direction(normal: Expr, frame: tuple[Parabola, Parabola, Parabola], t: Expr) -> tuple[Expr, Expr]:
    """Return the x and y, along a cylinder's own axes, of ``downhill``."""
    x, y, z = (axis.at(t) for axis in frame)
    down = downhill(normal, z, x)
    return ca.dot(down, x), ca.dot(down, y)


def without_spin(path: PredictedPath, axis: Expr, normal: Expr) -> PredictedPath:
    """Return the path of a cylinder without its spin about its axis, unless it stands on a face.

    The points of contact of a rolling wheel do not turn with it. If they did, those at the top of a wheel that turns by
    more than 1.2 rad a step would seem to go through the ground. On a face the points turn with the body.
    """
    lies = 1 - ca.dot(axis, normal) ** 2

    def without(rate: Expr) -> Expr:
        return rate - lies * axis * ca.dot(axis, rate)

    turning = without(path.angular_velocity), without(path.angular_acceleration)
    return replace(path, angular_velocity=turning[0], angular_acceleration=turning[1])


def cylinder_plane(cylinder: Cylinder, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return six points."""
    normal, frame = ca.vertcat(*plane.normal), axes(a, cylinder)
    rolling, found = without_spin(a, frame[2].start, normal), []
    for sign in SIGNS:
        centre = placed(cylinder, (0.0, 0.0, sign * cylinder.half_length))
        rim = RimOnPlane(normal, plane.offset, cylinder.radius, a.path(centre), a.arm(centre), frame[2], frame[0])
        deepest = contact_along(rim, a.dt)
        down = own_direction(normal, frame, deepest.time)
        beside = [ball_on_plane(rolling, rim_point(cylinder, sign, down, turn), 0.0, plane) for turn in RIM_ANGLES]
        found += [deepest, *beside]
    return found


def cylinder_terrain(cylinder: Cylinder, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Return six points, which the body carries through the step: chosen by the slope of the ground below each rim."""
    frame, surface, found = axes(a, cylinder), surface_of(terrain), list[Contact]()
    centre = a.centre().start
    rolling = without_spin(a, frame[2].start, upwards(surface(centre[:2])[1]))
    for sign in SIGNS:
        centre = placed(cylinder, (0.0, 0.0, sign * cylinder.half_length))
        place = a.path(centre).start
        for _round in range(2):
            down = own_direction(upwards(surface(place[:2])[1]), frame, ca.SX(0))
            place = a.path(rim_point(cylinder, sign, down, 0.0)).start
        points = [rim_point(cylinder, sign, down, turn) for turn in (0.0, *RIM_ANGLES)]
        found += [ball_on_terrain(point, 0.0, terrain, rolling) for point in points]
    return found
