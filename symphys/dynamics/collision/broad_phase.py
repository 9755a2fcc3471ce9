"""The broad phase: pairs of surfaces, and points of these, that are too far apart to act within a step.

A pair is far where the spheres around its surfaces are farther apart than its bodies go in the step at their speeds,
one of them struck by the fastest body. Of what is left some shapes are measured themselves (``near_points``), each of
their points by itself. What is far gives no impulse. That is part of the scheme, so every way to compute a step agrees.
A compiled kernel leaves out the calls of what is far (``symphys.dynamics.tracing.guards``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from math import hypot
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.applied import applied_wrench
from symphys.dynamics.collision.body_points import corners, ends, turned_by
from symphys.dynamics.collision.pairs.capsule_capsule import PARALLEL, nearest
from symphys.dynamics.collision.pairs.sphere_box import BoxField
from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.motion import inertia_matrix
from symphys.dynamics.tracing.decorator import guard, traced
from symphys.maths import rotation
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.scalar import is_number, is_zero
from symphys.model.shapes import Box, Capsule, Plane, Sphere, Surface
from symphys.model.shapes.shape import SolidShape
from symphys.model.world import Side, World
from symphys.records import dataclass
from symphys.types import Expr

MIN_PAIRS = 12
"""Pairs of surfaces from which on looking for those that are far costs less than it saves."""
UNIT_VECTORS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FACE_CORNERS = 4
"""Corners of a face of a box."""


@dataclass(frozen=True)
class MotionBound:
    """Bounds of a body's motion within a step, for the broad phase.

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
        """Return the speed that turning gives to a point that far from the centre of mass [m/s]."""
        return 0 if self.spin is None else arm * self.spin

    def point(self, offset: Sequence[float]) -> Expr:
        """Return the position (3,) [m] of a point of the body's frame."""
        return self.position if all(is_zero(c) for c in offset) else self.position + self.turned(offset)

    def turned(self, vector: Sequence[float]) -> Expr:
        """Return a vector of the body's frame in the world's (3,)."""
        assert self.rotation is not None
        return ca.mtimes(self.rotation, ca.vertcat(*vector))

    def axes(self, shape: SolidShape) -> list[Expr]:
        """Return a shape's own axes (3,) each."""
        return [self.turned(turned_by(shape.orientation, unit)) for unit in UNIT_VECTORS]


@dataclass(frozen=True)
class SweptBound:
    """Bound of the approach of surfaces in a step of ``dt`` [s]; ``fastest``: speed of a body that may strike them."""

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
    """Return heights of a capsule's ends, or of a box's corners."""
    radius, points = (shape.radius, ends(shape)) if isinstance(shape, Capsule) else (shape.edge, corners(shape))
    normal = ca.vertcat(*plane.normal)
    return [ca.dot(normal, a.point(point)) - plane.offset - radius for point in points]


def _ball_on_plane(ball: Sphere, plane: Plane, a: MotionBound, _: None) -> list[Expr]:
    return [ca.dot(ca.vertcat(*plane.normal), a.point(ball.centre)) - plane.offset - ball.radius]


def _capsules(first: Capsule, second: Capsule, a: MotionBound, b: MotionBound) -> list[Expr]:
    """Return the ends of the first, of the second, and between: there what is nearest at all."""
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
    """Return the round ends; then what is not measured by itself: how far they are apart along the faces of the box."""
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
    """Return for all points the distance of the boxes along their faces."""
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
"""Distances of the points of two shapes [m], in the order of the rule in ``collision.RULES``."""


def near_pairs(context: StepContext, x: State) -> tuple[Expr, ...]:
    """Return for each pair 1 if it may act within the step, else 0; empty without a broad phase.

    Smoothed contacts act from afar, so with smoothing all are near.
    """
    world, settings = context.world, context.settings
    points = Counter((pair.first, pair.second) for pair in world.pairs)
    if len(points) < MIN_PAIRS:
        return ()
    # bounds of all bodies, and the speed of the fastest
    held = {index for joint in world.joints for index in joint.bodies}
    bodies, fastest = _motion_bounds(context, x)
    dt = settings.scheme.dt
    reach, found = SweptBound(dt, fastest), dict[tuple[Side, Side], list[Expr]]()
    # spheres around the surfaces of a pair (6b), then its points by themselves
    for (first, second), count in points.items():
        radii = _radius(world, first, held), _radius(world, second, held)
        if first.body is None or radii[0] is None or radii[1] is None:
            found[first, second] = [ca.SX(1)] * count
            continue
        shapes, a = (world.surface(first), world.surface(second)), bodies[first.body]
        if second.body is None:
            plane, b, near = shapes[1], None, ca.SX(1)
            assert isinstance(plane, Plane)
            if not measured(shapes, (a, b)):
                near = _near_plane(a, (plane.normal, plane.offset), radii[0], reach, settings)
        else:
            b = bodies[second.body]
            near = _near_pair(a, b, radii[0] + radii[1], reach, settings)
        if measured(shapes, (a, b)):
            words = near_points(shapes, (a, b), near, reach, settings.smoothing)
            found[first, second] = [guard(word) for (word,) in words]
        else:
            found[first, second] = [guard(near)] * count
    lists = {sides: iter(words) for sides, words in found.items()}
    return tuple(next(lists[pair.first, pair.second]) for pair in world.pairs)


def _motion_bounds(context: StepContext, x: State) -> tuple[list[MotionBound], Expr]:
    """Return the bounds of all bodies, and the greatest speed of a point of any [m/s]."""
    world = context.world
    bodies = [_motion_bound(x, index, context, can_measure(body)) for index, body in enumerate(world.bodies)]
    fastest: Expr = ca.SX(0)
    for bound, body in zip(bodies, world.bodies, strict=True):
        fastest = _max_speed(fastest, bound, _body_arm(body))
    return bodies, fastest


def _motion_bound(x: State, index: int, context: StepContext, turned: bool) -> MotionBound:
    """Bound the motion of a body; a frame without mass counts as 1 kg, as in ``PredictedMotion``."""
    body = context.world.bodies[index]
    position, velocity = x[f"{body.name}.position"], x[f"{body.name}.velocity"]
    reaction = (x[f"{body.name}.reaction_{kind}"] for kind in ("force", "torque"))
    given = applied_wrench(context, x, index, context.settings.scheme.dt)
    forces, torques = zip(reaction, given, strict=True)
    mass = 1.0 if body.massless else body.mass
    settings = context.settings
    seen = _linear_bound(position, velocity, forces, mass, settings.gravity, settings.scheme.dt)
    if not turned:
        return seen
    least = float(np.linalg.eigvalsh(np.array(ca.DM(inertia_matrix(body.inertia))))[0])
    turning = x[f"{body.name}.orientation"], x[f"{body.name}.angular_velocity"]
    return _angular_bound(seen, turning, torques, least, settings.scheme.dt)


@traced
def _linear_bound(
    position: Expr, velocity: Expr, forces: tuple[Expr, Expr], mass: Expr, gravity: Expr, dt: Expr
) -> MotionBound:
    speed_gain = dt * (length(forces[0]) + length(forces[1])) / mass
    return MotionBound(position, velocity, speed_gain, length(velocity) + speed_gain + dt * length(gravity))


@traced
def _angular_bound(
    seen: MotionBound, turning: tuple[Expr, Expr], torques: tuple[Expr, Expr], least_inertia: float, dt: Expr
) -> MotionBound:
    spin = length(turning[1]) + dt * (length(torques[0]) + length(torques[1])) / least_inertia
    return MotionBound(seen.position, seen.velocity, seen.speed_gain, seen.speed, rotation.matrix(turning[0]), spin)


def _radius(world: World, side: Side, held: set[int]) -> float | None:
    """Return the radius of a surface about its body's centre of mass [m]; None if unbounded or variable."""
    surface = world.surface(side)
    if side.body is None:
        return 0.0 if isinstance(surface, Plane) else None
    assert isinstance(surface, SolidShape)
    if side.body in held or not is_number((surface.centre, surface.sizes)):
        return None
    return hypot(*surface.centre) + surface.extent


def _body_arm(body: Body) -> float:
    """Return the distance from a body's centre of mass to the farthest point of its shapes [m]."""
    sizes = [(shape.centre, shape.sizes) for shape in body.shapes]
    return max((hypot(*shape.centre) + shape.extent for shape in body.shapes), default=0.0) if is_number(sizes) else 0.0


@traced
def _max_speed(fastest: Expr, bound: MotionBound, arm: float) -> Expr:
    """Return the greatest speed of a point of any body so far [m/s]."""
    return ca.fmax(fastest, bound.speed + bound.swing_speed(arm))


@traced
def _near_pair(a: MotionBound, b: MotionBound, radii: float, reach: SweptBound, settings: StepSettings) -> Expr:
    ahead = reach.of_centres(a, b)
    return ca.logic_or(length(a.position - b.position) < radii + ahead, settings.smoothing > 0)


@traced
def _near_plane(
    a: MotionBound, plane: tuple[Any, Any], radius: float, reach: SweptBound, settings: StepSettings
) -> Expr:
    normal, offset = plane
    height = ca.dot(ca.vertcat(*normal), a.position) - offset
    return ca.logic_or(height < radius + reach.of_centres(a, None), settings.smoothing > 0)
