"""The broad phase: pairs of surfaces, and points of these, that are too far apart to act within a step.

A pair is far where the spheres around its surfaces are farther apart than its bodies go in the step at their speeds,
one of them struck by the fastest body. Of what is left some shapes are measured themselves (``near_points``), each of
their points by itself. What is far gives no impulse. That is part of the scheme, so every way to compute a step agrees.
A compiled kernel leaves out the calls of what is far (``symphys.dynamics.tracing.guards``).

In steps of many bodies what is near in the step is looked at again in each of its substeps (``approaches_at``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.collision.near_points import Sight, Travel, can_measure, measured, near_points, point_gaps
from symphys.dynamics.context import NEAR, State, StepContext, StepSettings
from symphys.dynamics.motion import inertia_matrix
from symphys.dynamics.tracing.decorator import folded, guard, in_sight, opened, traced
from symphys.maths import rotation
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.scalar import is_number
from symphys.model.shapes import Plane, Surface
from symphys.model.shapes.shape import SolidShape
from symphys.model.world import Side, World

Expr = Any
"""casadi SX"""

FEWEST = 12
"""Pairs of surfaces from which on looking for those that are far costs less than it saves."""


def near_pairs(context: StepContext, x: State) -> tuple[Expr, ...]:
    """For each pair 1 if it may act within the step, 0 if it is far; empty where nothing is looked at.

    Smoothed contacts act from afar, so with smoothing all are near.
    """
    world, settings = context.world, context.settings
    points = Counter((pair.first, pair.second) for pair in world.pairs)
    if len(points) < FEWEST and not context.sample:
        return ()
    held = {index for joint in world.joints for index in joint.bodies}
    bodies, fastest = _sights(context, x)
    dt = settings.scheme.dt
    ends = zip(bodies, world.bodies, strict=True)
    in_sight([(sight.position, _reach(sight, _arm(body), dt)) for sight, body in ends], dt * fastest)
    reach, found = Travel(dt, fastest), dict[tuple[Side, Side], list[Expr]]()
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
                near = guard(_near_plane(a, (plane.normal, plane.offset), radii[0], reach, settings), (first, second))
        else:
            b = bodies[second.body]
            near = guard(_near(a, b, radii[0] + radii[1], reach, settings), (first, second))
        if measured(shapes, (a, b)):
            words = near_points(shapes, (a, b), near, reach, settings.smoothing)
            found[first, second] = [guard(word, (first, second), k) for k, (word,) in enumerate(words)]
        else:
            found[first, second] = [near] * count
    lists = {sides: iter(words) for sides, words in found.items()}
    return tuple(next(lists[pair.first, pair.second]) for pair in world.pairs)


@dataclass(frozen=True)
class Approach:
    """Of a point of a pair at an instant.

    Attributes:
        gap: at least how far the surfaces are apart there [m].
        speed: at most how fast they come together in this step [m/s].
    """

    gap: Expr
    speed: Expr


def approaches_at(context: StepContext, x: State) -> list[Approach]:
    """Of each pair; its bodies are known in numbers, and no joint holds them."""
    (bodies, fastest), found = _sights(context, x), dict[tuple[Side, Side], Iterator[Approach]]()
    for (first, second), count in Counter((pair.first, pair.second) for pair in context.world.pairs).items():
        assert first.body is not None
        shapes = context.world.surface(first), context.world.surface(second)
        sides = bodies[first.body], None if second.body is None else bodies[second.body]
        reach = Travel(ca.SX(1), fastest)
        if measured(shapes, sides):
            gaps, speed = point_gaps(shapes, sides, reach)
            found[first, second] = iter([Approach(gap, speed) for gap in gaps])
        else:
            radii = [_radius(context.world, side, set()) for side in (first, second)]
            apart = _apart(sides, shapes[1], sum(radius or 0.0 for radius in radii), reach)
            found[first, second] = iter([Approach(*apart)] * count)
    return [next(found[pair.first, pair.second]) for pair in context.world.pairs]


def near_within(
    context: StepContext, approaches: Sequence[Approach], near: Sequence[Expr], duration: Expr
) -> tuple[Expr, ...]:
    """Of what is ``near``, for each pair 1 if it may act within ``duration`` [s] from where it is, 0 if it is far."""
    found, counts = list[Expr](), Counter[tuple[Side, Side]]()
    for pair, approach, before in zip(context.world.pairs, approaches, near, strict=True):
        sides = pair.first, pair.second
        found.append(guard(_within(context.settings, approach, before, duration), sides, counts[sides], late=True))
        counts[sides] += 1
    return tuple(found)


def _sights(context: StepContext, x: State) -> tuple[list[Sight], Expr]:
    """Of all bodies, and the greatest speed of a point of any [m/s]."""
    world = context.world
    bodies = [_sight(x, body, context, can_measure(body)) for body in world.bodies]
    fastest: Expr = opened(ca.SX(0))
    for sight, body in zip(bodies, world.bodies, strict=True):
        fastest = _faster(fastest, sight, _arm(body))
    return bodies, fastest


def _sight(x: State, body: Body, context: StepContext, turned: bool) -> Sight:
    """Of a body; a frame without mass counts as one of 1 kg, as in ``PredictedMotion``."""
    position, velocity = x[f"{body.name}.position"], x[f"{body.name}.velocity"]
    forces, torques = (
        (x[f"{body.name}.reaction_{kind}"], ca.SX.zeros(3) if push is None else push)
        for kind in ("force", "torque")
        for push in [context.input(f"{body.name}.{kind}")]
    )
    mass = 1.0 if body.massless else body.mass
    settings = context.settings
    seen = _seen(position, velocity, forces, mass, settings.gravity, settings.scheme.dt)
    if not turned:
        return seen
    least = float(np.linalg.eigvalsh(np.array(ca.DM(inertia_matrix(body.inertia))))[0])
    turning = x[f"{body.name}.orientation"], x[f"{body.name}.angular_velocity"]
    return _turned(seen, turning, torques, least, settings.scheme.dt)


@traced
def _seen(position: Expr, velocity: Expr, forces: tuple[Expr, Expr], mass: Expr, gravity: Expr, dt: Expr) -> Sight:
    gained = dt * (length(forces[0]) + length(forces[1])) / mass
    return Sight(position, velocity, gained, length(velocity) + gained + dt * length(gravity))


@traced
def _turned(
    seen: Sight, turning: tuple[Expr, Expr], torques: tuple[Expr, Expr], least_inertia: float, dt: Expr
) -> Sight:
    spin = length(turning[1]) + dt * (length(torques[0]) + length(torques[1])) / least_inertia
    return Sight(seen.position, seen.velocity, seen.gained, seen.speed, rotation.matrix(turning[0]), spin)


def _radius(world: World, side: Side, held: set[int]) -> float | None:
    """Of the sphere around a surface, about the centre of mass of its body [m]; None: it has none, or may change."""
    surface = world.surface(side)
    if side.body is None:
        return 0.0 if isinstance(surface, Plane) else None
    assert isinstance(surface, SolidShape)
    if side.body in held or not is_number((surface.centre, surface.sizes)):
        return None
    return hypot(*surface.centre) + surface.extent


def _arm(body: Body) -> float:
    """How far from the centre of mass of a body the farthest point of its shapes is [m]."""
    sizes = [(shape.centre, shape.sizes) for shape in body.shapes]
    return max((hypot(*shape.centre) + shape.extent for shape in body.shapes), default=0.0) if is_number(sizes) else 0.0


@folded
def _faster(fastest: Expr, sight: Sight, arm: float) -> Expr:
    """The greatest speed of a point of any body so far [m/s]."""
    return ca.fmax(fastest, sight.speed + sight.swing(arm))


@traced
def _reach(sight: Sight, radius: float, dt: Expr) -> Expr:
    """How far anything of a body comes from where its centre is at the start of a step, if nothing strikes it [m]."""
    return radius + dt * sight.speed


@traced
def _within(settings: StepSettings, approach: Approach, near: Expr, duration: Expr) -> Expr:
    """What carried load goes on touching at a distance that no speed has to close."""
    reach = approach.speed * duration + NEAR * settings.reference * settings.scheme.dt**2
    return ca.logic_and(near, ca.logic_or(approach.gap < reach, settings.smoothing > 0))


@traced
def _apart(bodies: tuple[Sight, Sight | None], surface: Surface, radii: float, reach: Travel) -> tuple[Expr, Expr]:
    """(how far the spheres around two surfaces are apart, how far their centres come within ``reach``) [m]."""
    a, b = bodies
    ahead = reach.of_centres(a, b)
    if b is not None:
        return length(a.position - b.position) - radii, ahead
    assert isinstance(surface, Plane)
    return ca.dot(ca.vertcat(*surface.normal), a.position) - surface.offset - radii, ahead


@traced
def _near(a: Sight, b: Sight, radii: float, reach: Travel, settings: StepSettings) -> Expr:
    ahead = reach.of_centres(a, b)
    return ca.logic_or(length(a.position - b.position) < radii + ahead, settings.smoothing > 0)


@traced
def _near_plane(a: Sight, plane: tuple[Any, Any], radius: float, reach: Travel, settings: StepSettings) -> Expr:
    normal, offset = plane
    height = ca.dot(ca.vertcat(*normal), a.position) - offset
    return ca.logic_or(height < radius + reach.of_centres(a, None), settings.smoothing > 0)
