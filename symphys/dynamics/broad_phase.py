"""The broad phase: pairs of surfaces that are too far apart to act within a step.

A pair is far where the spheres around its surfaces are farther apart than its bodies go in the step at their speeds, one
of them struck by the fastest body. A far pair gives no impulse. That is part of the scheme, so every way to compute a
step agrees. A compiled kernel leaves out the calls of pairs that are far (``symphys.dynamics.tracing.guards``).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import casadi as ca

from symphys.dynamics.context import State, StepContext
from symphys.dynamics.tracing.decorator import guard, traced
from symphys.maths.smoothing import length
from symphys.model.scalar import is_number
from symphys.model.shapes import Plane
from symphys.model.world import Side, World

Expr = Any
"""casadi SX"""

FEWEST = 12
"""Pairs of surfaces from which on looking for those that are far costs less than it saves."""


def near_pairs(context: StepContext, x: State) -> tuple[Expr, ...]:
    """For each pair 1 if it may act within the step, 0 if it is far; empty where nothing is looked at.

    Smoothed contacts act from afar, so with smoothing all are near.
    """
    world = context.world
    sides = [(pair.first, pair.second) for pair in world.pairs]
    held = {index for joint in world.joints for index in joint.bodies}
    if len(set(sides)) < FEWEST:
        return ()
    dt, gravity, smoothing = context.settings.scheme.dt, context.settings.gravity, context.settings.smoothing
    speeds = tuple(
        _speed(x[f"{body.name}.velocity"], x[f"{body.name}.reaction_force"], _push(context, body.name), body.mass, gravity, dt)
        for body in world.bodies
    )
    fastest = _fastest(speeds)
    found = dict[tuple[Side, Side], Expr]()
    for first, second in dict.fromkeys(sides):
        radii = _radius(world, first, held), _radius(world, second, held)
        if None in radii:
            found[first, second] = ca.SX(1)
            continue
        position = x[f"{world.bodies[first.body or 0].name}.position"]
        if second.body is None:
            plane = world.surface(second)
            assert isinstance(plane, Plane)
            speed = speeds[first.body], ca.SX(0), fastest
            near = _near_plane(position, (plane.normal, plane.offset), radii[0], dt, speed, smoothing)
        else:
            speed = speeds[first.body], speeds[second.body], fastest
            other = x[f"{world.bodies[second.body].name}.position"]
            near = _near(position, other, sum(radii), dt, speed, smoothing)
        found[first, second] = guard(near)
    return tuple(found[each] for each in sides)


def _push(context: StepContext, name: str) -> Expr:
    given = context.input(f"{name}.force")
    return ca.SX.zeros(3) if given is None else given


def _radius(world: World, side: Side, held: set[int]) -> float | None:
    """Of the sphere around a surface, about the centre of mass of its body [m]; None if it has none or it may change."""
    surface = world.surface(side)
    if side.body is None:
        return 0.0 if isinstance(surface, Plane) else None
    if side.body in held or not is_number((surface.centre, surface.sizes)):
        return None
    return hypot(*surface.centre) + surface.extent


@traced
def _speed(velocity: Expr, reaction: Expr, push: Expr, mass: Expr, gravity: Expr, dt: Expr) -> Expr:
    """The largest speed of a body within the step before anything hits it [m/s]."""
    return length(velocity) + dt * (length(gravity) + (length(reaction) + length(push)) / mass)


@traced
def _fastest(speeds: Sequence[Expr]) -> Expr:
    return ca.mmax(ca.vertcat(*speeds))


@traced
def _near(a: Expr, b: Expr, radii: float, dt: Expr, speeds: tuple[Expr, ...], smoothing: Expr) -> Expr:
    return ca.logic_or(length(a - b) < radii + dt * sum(speeds), smoothing > 0)


@traced
def _near_plane(
    position: Expr, plane: tuple[Any, Any], radius: float, dt: Expr, speeds: tuple[Expr, ...], smoothing: Expr
) -> Expr:
    normal, offset = plane
    return ca.logic_or(ca.dot(ca.vertcat(*normal), position) - offset < radius + dt * sum(speeds), smoothing > 0)
