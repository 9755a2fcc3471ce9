"""The broad phase: pairs of surfaces that are too far apart to act within a step.

A pair is far where the spheres around its surfaces are farther apart than its bodies go in the step at their speeds,
one of them struck by the fastest body. A far pair gives no impulse. That is part of the scheme, so every way to compute
a step agrees. A compiled kernel leaves out the calls of pairs that are far (``symphys.dynamics.tracing.guards``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import casadi as ca

from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.tracing.decorator import guard, traced
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.scalar import is_number
from symphys.model.shapes import Plane
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
    sides = [(pair.first, pair.second) for pair in world.pairs]
    if len(set(sides)) < FEWEST:
        return ()
    held = {index for joint in world.joints for index in joint.bodies}
    bodies = [_sight(x, body, context.input(f"{body.name}.force"), settings) for body in world.bodies]
    fastest = _fastest(tuple(body.speed for body in bodies))
    found = dict[tuple[Side, Side], Expr]()
    for first, second in dict.fromkeys(sides):
        radii = _radius(world, first, held), _radius(world, second, held)
        if first.body is None or radii[0] is None or radii[1] is None:
            found[first, second] = ca.SX(1)
        elif second.body is None:
            plane = world.surface(second)
            assert isinstance(plane, Plane)
            place = plane.normal, plane.offset
            found[first, second] = guard(_near_plane(bodies[first.body], place, radii[0], fastest, settings))
        else:
            both = bodies[first.body], bodies[second.body]
            found[first, second] = guard(_near(*both, radii[0] + radii[1], fastest, settings))
    return tuple(found[each] for each in sides)


@dataclass(frozen=True)
class _Sight:
    """What the broad phase needs of a body.

    Attributes:
        position, velocity: (3,) [m], [m/s].
        gained: of speed within the step, without gravity and blows [m/s].
        speed: the largest within the step [m/s].
    """

    position: Expr
    velocity: Expr
    gained: Expr
    speed: Expr


def _sight(x: State, body: Body, push: Expr | None, settings: StepSettings) -> _Sight:
    """Of a body; a frame without mass counts as one of 1 kg, as in ``PredictedMotion``."""
    position, velocity, reaction = (x[f"{body.name}.{field}"] for field in ("position", "velocity", "reaction_force"))
    force = reaction, ca.SX.zeros(3) if push is None else push
    mass = 1.0 if body.massless else body.mass
    return _seen(position, velocity, force, mass, settings.gravity, settings.scheme.dt)


@traced
def _seen(position: Expr, velocity: Expr, forces: tuple[Expr, Expr], mass: Expr, gravity: Expr, dt: Expr) -> _Sight:
    gained = dt * (length(forces[0]) + length(forces[1])) / mass
    return _Sight(position, velocity, gained, length(velocity) + gained + dt * length(gravity))


def _radius(world: World, side: Side, held: set[int]) -> float | None:
    """Of the sphere around a surface, about the centre of mass of its body [m]; None: it has none, or may change."""
    surface = world.surface(side)
    if side.body is None:
        return 0.0 if isinstance(surface, Plane) else None
    assert isinstance(surface, SolidShape)
    if side.body in held or not is_number((surface.centre, surface.sizes)):
        return None
    return hypot(*surface.centre) + surface.extent


@traced
def _fastest(speeds: Sequence[Expr]) -> Expr:
    return ca.mmax(ca.vertcat(*speeds))


@traced
def _near(a: _Sight, b: _Sight, radii: float, fastest: Expr, settings: StepSettings) -> Expr:
    reach = settings.scheme.dt * (length(a.velocity - b.velocity) + a.gained + b.gained + fastest)
    return ca.logic_or(length(a.position - b.position) < radii + reach, settings.smoothing > 0)


@traced
def _near_plane(a: _Sight, plane: tuple[Any, Any], radius: float, fastest: Expr, settings: StepSettings) -> Expr:
    normal, offset = plane
    reach = settings.scheme.dt * (a.speed + fastest)
    height = ca.dot(ca.vertcat(*normal), a.position) - offset
    return ca.logic_or(height < radius + reach, settings.smoothing > 0)
