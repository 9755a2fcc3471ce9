"""How points that lie in a plane share a load.

Rigid bodies do not say how four corners of a box share its weight: sweeps stop at one of many answers, which depends on
where they began, with warm start on all that was before. Yet friction depends on it, as soon as the box turns while it
slides. So loads are made linear across the face, a + b . r, as under a rigid plate on an elastic foundation (Winkler,
1867): of all the loads with one resultant those with the least sum of squares. The sweeps begin with them, and leave
them as they are where they fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.context import StepContext
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import PlacedConstraint
from symphys.model.shapes import Plane, Terrain
from symphys.model.world import Pair, World
from symphys.types import Expr

MAX_DETERMINED_POINTS = 3
"""Points whose loads follow from the resultant."""
MIN_SPREAD_SHARE = 1e-12
"""Of the points' spread: directions in which they spread less share no torque."""


def distribute_loads(
    context: StepContext, constraints: Sequence[PlacedConstraint], impulses: Sequence[ContactImpulse]
) -> list[ContactImpulse]:
    """The impulses with normal parts that are linear across each face; what carries no load takes no part."""
    found = list(impulses)
    if not context.settings.scheme.load_sharing:
        return found
    for group in faces(context.world):
        loads = _linear(tuple(constraints[k].constraint for k in group), tuple(found[k].normal for k in group))
        for k, load in zip(group, loads, strict=True):
            found[k] = replace(found[k], normal=load)
    return found


def faces(world: World) -> list[tuple[int, ...]]:
    """Pairs, by index, whose points lie in a plane: of one body on a plane, or of two flat shapes."""
    groups: dict[Any, list[int]] = {}
    for k, pair in enumerate(world.pairs):
        if not pair.law.soft:
            groups.setdefault(_face(world, pair), []).append(k)
    return [tuple(group) for face, group in groups.items() if face is not None and len(group) > MAX_DETERMINED_POINTS]


def _face(world: World, pair: Pair) -> Any:
    static = world.statics[pair.second.shape] if pair.second.body is None else None
    if isinstance(static, Terrain):
        return None
    return (pair.first.body if isinstance(static, Plane) else pair.first), pair.second


@traced
def _linear(constraints: tuple[ContactConstraint, ...], loads: tuple[Expr, ...]) -> tuple[Expr, ...]:
    parts = [_share(constraint, load) for constraint, load in zip(constraints, loads, strict=True)]
    total = sum(parts) + MIN_SPREAD_SHARE
    arms = [ca.cross(constraint.terms[0].impulse_arm, constraint.impulse_normal) for constraint in constraints]
    middle = sum(part * arm for part, arm in zip(parts, arms, strict=True)) / total
    mean = sum(part * load for part, load in zip(parts, loads, strict=True)) / total
    torque, spread = ca.SX.zeros(3), ca.SX.zeros(3, 3)
    arms = [arm - middle for arm in arms]
    for part, arm, load in zip(parts, arms, loads, strict=True):
        torque += part * load * arm
        spread += part * ca.mtimes(arm, arm.T)
    slope = ca.mtimes(
        ca.inv(spread + (MIN_SPREAD_SHARE * ca.trace(spread) + MIN_SPREAD_SHARE**2) * ca.SX.eye(3)), torque
    )
    return tuple(
        constraint.near * ca.fmax(load + part * (mean + ca.dot(slope, arm) - load), 0)
        for constraint, part, arm, load in zip(constraints, parts, arms, loads, strict=True)
    )


def _share(constraint: ContactConstraint, load: Expr) -> Expr:
    """Return the weight of a point, from 0 to 1: 0 for a far one, whatever its numbers are."""
    near = constraint.near
    return near * ca.fmax(load - constraint.load, 0) / (ca.fmax(load, constraint.load) + (1 - near))
