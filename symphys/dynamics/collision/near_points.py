"""Which points of two surfaces are too far apart to act within a step: what spheres around them leave is measured.

A point is far where what may touch there is farther from the other surface than both go in the step, with how they
turn. The order of points is that of the rule of the pair.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot

import casadi as ca

from symphys.dynamics.collision.body_points import corners, ends, turned_by
from symphys.dynamics.collision.pairs.capsule_capsule import PARALLEL, nearest
from symphys.dynamics.collision.pairs.sphere_box import BoxField
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.scalar import is_number, is_zero
from symphys.model.shapes import Box, Capsule, Plane, Sphere, Surface
from symphys.model.shapes.shape import SolidShape
from symphys.types import Expr

UNIT_VECTORS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FACE_CORNERS = 4
"""Of a face."""


@dataclass(frozen=True)
class MotionBound:
    """What the broad phase needs of a body.

    Attributes:
        position, velocity: (3,) [m], [m/s].
        gained: of speed within the step, without gravity and blows [m/s].
        speed: the largest of its centre within the step [m/s].
        rotation: (3, 3) R_wb; None: its points are not measured.
        spin: the largest within the step, without blows [rad/s].
    """

    position: Expr
    velocity: Expr
    speed_gain: Expr
    speed: Expr
    rotation: Expr | None = None
    spin: Expr | None = None

    def swing_speed(self, arm: float) -> Expr:
        """The speed that turning gives to a point that far from the centre of mass [m/s]."""
        return 0 if self.spin is None else arm * self.spin

    def point(self, offset: Sequence[float]) -> Expr:
        """(3,) [m], of a point in the body's frame."""
        return self.position if all(is_zero(c) for c in offset) else self.position + self.turned(offset)

    def turned(self, vector: Sequence[float]) -> Expr:
        """(3,): a vector of the body's frame in the world's."""
        assert self.rotation is not None
        return ca.mtimes(self.rotation, ca.vertcat(*vector))

    def axes(self, shape: SolidShape) -> list[Expr]:
        """(3,) each: a shape's own axes."""
        return [self.turned(turned_by(shape.orientation, unit)) for unit in UNIT_VECTORS]


@dataclass(frozen=True)
class SweptBound:
    """How far surfaces come towards each other within a step of ``dt`` [s]; ``fastest``: what may strike them [m/s]."""

    dt: Expr
    fastest: Expr

    def of_centres(self, a: MotionBound, b: MotionBound | None) -> Expr:
        """Return the distance of two centres of mass, or of one from a plane [m]."""
        if b is None:
            return self.dt * (a.speed + self.fastest)
        return self.dt * (length(a.velocity - b.velocity) + a.speed_gain + b.speed_gain + self.fastest)

    def of_points(self, a: MotionBound, b: MotionBound | None, arms: tuple[float, float]) -> Expr:
        """Bound the distance of points that are up to ``arms`` from the centres [m]."""
        turning = a.swing_speed(arms[0]) + (0 if b is None else b.swing_speed(arms[1]))
        return self.of_centres(a, b) + self.dt * turning


def can_measure(body: Body) -> bool:
    """Whether points of a body are measured: its numbers are known, and it is no ball about its centre."""
    sizes = [(shape.centre, shape.sizes, shape.orientation) for shape in body.shapes]
    if body.massless or all(shape.central for shape in body.shapes):
        return False
    return is_number((body.inertia, sizes))


def measured(shapes: tuple[Surface, Surface], bodies: tuple[MotionBound, MotionBound | None]) -> bool:
    """Whether the points of two surfaces are measured."""
    known = all(
        body is None or body.rotation is not None or (isinstance(shape, Sphere) and is_zero(hypot(*shape.centre)))
        for shape, body in zip(shapes, bodies, strict=True)
    )
    return known and not {tuple(map(type, shapes)), tuple(map(type, reversed(shapes)))}.isdisjoint(RULES)


@traced
def near_points(
    shapes: tuple[Surface, Surface],
    bodies: tuple[MotionBound, MotionBound | None],
    near: Expr,
    reach: SweptBound,
    smoothing: Expr,
) -> tuple[tuple[Expr], ...]:
    """Return for each point of a pair 1 if it may act within the step, each as a vector of its own.

    Args:
        shapes: which are ``measured``.
        bodies: that carry them; None: a static plane.
        near: 0 where all are known to be far.
        reach: of the step.
        smoothing: all are near where it is above 0.
    """
    gaps, ahead = _measured_gaps(shapes, bodies, reach)
    return tuple((ca.logic_and(near, ca.logic_or(gap < ahead, smoothing > 0)),) for gap in gaps)


def _measured_gaps(
    shapes: tuple[Surface, Surface], bodies: tuple[MotionBound, MotionBound | None], reach: SweptBound
) -> tuple[list[Expr], Expr]:
    (one, other), (a, b) = shapes, bodies
    assert a is not None
    rule = RULES.get((type(one), type(other)))
    gaps = rule(one, other, a, b) if rule else RULES[type(other), type(one)](other, one, b, a)
    return gaps, reach.of_points(a, b, (_arm(one), _arm(other)))


def _arm(shape: Surface) -> float:
    """Return the distance from the centre of mass within which rotation moves a shape's surface [m]."""
    if not isinstance(shape, SolidShape):
        return 0.0
    return hypot(*shape.centre) + shape.extent - (float(shape.radius) if isinstance(shape, Sphere | Capsule) else 0.0)


def _on_plane(shape: Capsule | Box, plane: Plane, a: MotionBound, _: None) -> list[Expr]:
    """Heights of a capsule's ends, or of a box's corners."""
    radius, points = (shape.radius, ends(shape)) if isinstance(shape, Capsule) else (shape.edge, corners(shape))
    normal = ca.vertcat(*plane.normal)
    return [ca.dot(normal, a.point(point)) - plane.offset - radius for point in points]


def _ball_on_plane(ball: Sphere, plane: Plane, a: MotionBound, _: None) -> list[Expr]:
    return [ca.dot(ca.vertcat(*plane.normal), a.point(ball.centre)) - plane.offset - ball.radius]


def _capsules(first: Capsule, second: Capsule, a: MotionBound, b: MotionBound) -> list[Expr]:
    """The ends of the first, of the second, and between: there what is nearest at all."""
    reach = first.radius + second.radius
    sides = [(first, a), (second, b)]
    found = []
    for (one, own), (other, its) in (sides, reversed(sides)):
        found += [_distance_to_segment(own.point(end), other, its) - reach for end in ends(one)]
    apart, lines = a.point(first.centre) - b.point(second.centre), (a.axes(first)[2], b.axes(second)[2])
    s, u = nearest(apart, *lines)
    across = ca.cross(*lines)
    square = ca.dot(across, across)
    inside = ca.logic_and(ca.fabs(s) <= first.half_length, ca.fabs(u) <= second.half_length)
    between = ca.fabs(ca.dot(apart, across)) / ca.sqrt(ca.fmax(square, PARALLEL)) - reach
    least = ca.mmin(ca.vertcat(*found))
    return [*found, ca.if_else(ca.logic_and(inside, square > PARALLEL), ca.fmin(between, least), least)]


def _distance_to_segment(point: Expr, capsule: Capsule, b: MotionBound) -> Expr:
    """Return the distance of a point from the axis of a capsule [m]."""
    away, axis = point - b.point(capsule.centre), b.axes(capsule)[2]
    along = ca.fmin(ca.fmax(ca.dot(away, axis), -capsule.half_length), capsule.half_length)
    return length(away - along * axis)


def _ball_and_capsule(ball: Sphere, capsule: Capsule, a: MotionBound, b: MotionBound) -> list[Expr]:
    return [_distance_to_segment(a.point(ball.centre), capsule, b) - ball.radius - capsule.radius]


def _ball_and_box(ball: Sphere, box: Box, a: MotionBound, b: MotionBound) -> list[Expr]:
    return [_distance_to_box(a.point(ball.centre), box, b) - ball.radius]


def _distance_to_box(point: Expr, box: Box, b: MotionBound) -> Expr:
    """Return the signed distance of a point from a box [m], negative inside."""
    away = point - b.point(box.centre)
    return BoxField(box.half_sizes).distance(ca.vertcat(*(ca.dot(axis, away) for axis in b.axes(box))))


def _capsule_and_box(capsule: Capsule, box: Box, a: MotionBound, b: MotionBound) -> list[Expr]:
    """The round ends; then what is not measured by itself: how far they are apart along the faces of the box."""
    tips = [_distance_to_box(a.point(end), box, b) - capsule.radius for end in ends(capsule)]
    rod = [capsule.half_length * a.axes(capsule)[2]]
    least = ca.fmin(ca.mmin(ca.vertcat(*tips)), _box_separation(a, capsule, rod, b, box) - capsule.radius)
    return [*tips, *[least] * (2 + FACE_CORNERS)]


def _box_separation(a: MotionBound, shape: SolidShape, halves: Sequence[Expr], b: MotionBound, box: Box) -> Expr:
    """Bound from below the distance of the sum of segments ``halves`` from a box, along its faces [m]."""
    away = a.point(shape.centre) - b.point(box.centre)
    found = [
        ca.fabs(ca.dot(away, axis)) - half - sum(ca.fabs(ca.dot(each, axis)) for each in halves)
        for axis, half in zip(b.axes(box), box.half_sizes, strict=True)
    ]
    return ca.mmax(ca.vertcat(*found))


def _boxes(first: Box, second: Box, a: MotionBound, b: MotionBound) -> list[Expr]:
    """All points are as far as the boxes are along their faces."""
    halves = [
        [h * axis for h, axis in zip(box.half_sizes, own.axes(box), strict=True)]
        for box, own in ((first, a), (second, b))
    ]
    far = ca.fmax(_box_separation(a, first, halves[0], b, second), _box_separation(b, second, halves[1], a, first))
    return [far] * (4 * FACE_CORNERS)


RULES: dict[tuple[type, type], Callable[..., list[Expr]]] = {
    (Sphere, Plane): _ball_on_plane,
    (Capsule, Plane): _on_plane,
    (Box, Plane): _on_plane,
    (Sphere, Capsule): _ball_and_capsule,
    (Sphere, Box): _ball_and_box,
    (Capsule, Capsule): _capsules,
    (Capsule, Box): _capsule_and_box,
    (Box, Box): _boxes,
}
"""How far the points of two shapes are apart [m], in the order of the rule in ``collision.RULES``."""
