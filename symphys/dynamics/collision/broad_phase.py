"""The broad phase: pairs of surfaces, and points of these, that are too far apart to act within a step.

A pair is far where the spheres around its surfaces are farther apart than its bodies go in the step at their speeds,
one of them struck by the fastest body. Of what is left some shapes are measured themselves (``near_points``), each of
their points by itself. What is far gives no impulse. That is part of the scheme, so every way to compute a step agrees.
A compiled kernel leaves out the calls of what is far (``symphys.dynamics.tracing.guards``).
"""

from __future__ import annotations

from collections import Counter
from math import hypot
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.collision.near_points import MotionBound, SweptBound, can_measure, measured, near_points
from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.motion import inertia_matrix
from symphys.dynamics.tracing.decorator import guard, traced
from symphys.maths import rotation
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.scalar import is_number
from symphys.model.shapes import Plane
from symphys.model.shapes.shape import SolidShape
from symphys.model.world import Side, World
from symphys.types import Expr

MIN_PAIRS = 12
"""Pairs of surfaces from which on looking for those that are far costs less than it saves."""


def near_pairs(context: StepContext, x: State) -> tuple[Expr, ...]:
    """Return for each pair 1 if it may act within the step, else 0; empty without a broad phase.

    Smoothed contacts act from afar, so with smoothing all are near.
    """
    world, settings = context.world, context.settings
    points = Counter((pair.first, pair.second) for pair in world.pairs)
    if len(points) < MIN_PAIRS:
        return ()
    held = {index for joint in world.joints for index in joint.bodies}
    bodies, fastest = _motion_bounds(context, x)
    dt = settings.scheme.dt
    reach, found = SweptBound(dt, fastest), dict[tuple[Side, Side], list[Expr]]()
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
                near = guard(_near_plane(a, (plane.normal, plane.offset), radii[0], reach, settings))
        else:
            b = bodies[second.body]
            near = guard(_near_pair(a, b, radii[0] + radii[1], reach, settings))
        if measured(shapes, (a, b)):
            words = near_points(shapes, (a, b), near, reach, settings.smoothing)
            found[first, second] = [guard(word) for (word,) in words]
        else:
            found[first, second] = [near] * count
    lists = {sides: iter(words) for sides, words in found.items()}
    return tuple(next(lists[pair.first, pair.second]) for pair in world.pairs)


def _motion_bounds(context: StepContext, x: State) -> tuple[list[MotionBound], Expr]:
    """Return the bounds of all bodies, and the greatest speed of a point of any [m/s]."""
    world = context.world
    bodies = [_motion_bound(x, body, context, can_measure(body)) for body in world.bodies]
    fastest: Expr = ca.SX(0)
    for bound, body in zip(bodies, world.bodies, strict=True):
        fastest = _max_speed(fastest, bound, _body_arm(body))
    return bodies, fastest


def _motion_bound(x: State, body: Body, context: StepContext, turned: bool) -> MotionBound:
    """Bound the motion of a body; a frame without mass counts as 1 kg, as in ``PredictedMotion``."""
    position, velocity = x[f"{body.name}.position"], x[f"{body.name}.velocity"]
    forces, torques = (
        (x[f"{body.name}.reaction_{kind}"], ca.SX.zeros(3) if push is None else push)
        for kind in ("force", "torque")
        for push in [context.input(f"{body.name}.{kind}")]
    )
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
    """The greatest speed of a point of any body so far [m/s]."""
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
