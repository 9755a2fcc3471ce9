"""The impulses that the sweeps of a substep start from: the persistent forces of the last one, made fit for it.

Loads are spread over faces, and shortened where they would add energy: the points of two faces change places from one
substep to the next, and what one of them carried pushes elsewhere.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.contact.constraint import ZERO_IMPULSE, ContactConstraint, ContactImpulse
from symphys.dynamics.contact.newton_start import open_groups
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import AllVelocities, AnyImpulse, Iterate, PlacedConstraint, VelocityConstraint
from symphys.model.shapes import Plane, Terrain
from symphys.model.world import Pair, World
from symphys.types import Expr

MAX_DETERMINED_POINTS = 3
"""Points whose loads follow from the resultant."""
MIN_SPREAD_SHARE = 1e-12
"""Least spread of the points along a direction that shares a torque, as a share of their largest."""
MIN_WORK = 1e-30
"""[J] so that nothing is divided by 0."""


def warm_impulses(
    context: StepContext, constraints: Sequence[PlacedConstraint], x: State, kick: Expr
) -> list[ContactImpulse]:
    """Return the last step's persistent forces, over this step's kick, in this step's frames."""
    if not context.settings.scheme.warm_start:
        return [ZERO_IMPULSE for _ in constraints]
    impulses = []
    for pair, each in zip(context.world.pairs, constraints, strict=True):
        force = x[f"{pair.name}.force"]
        torque = x[f"{pair.name}.torque"] if pair.law.spins else None
        impulses.append(_warm_impulse(each.constraint, kick, force, torque))
    return impulses


@traced
def _warm_impulse(constraint: ContactConstraint, kick: Expr, force: Expr, torque: Expr | None) -> ContactImpulse:
    n = constraint.impulse_normal
    normal, tangent = _split(kick * force, n)
    turning = (ZERO_IMPULSE.spin, ZERO_IMPULSE.roll) if torque is None else _split(kick * torque, n)
    return ContactImpulse(ca.fmax(normal, 0), tangent, *turning).times(constraint.near * constraint.separates)


def _split(impulse: Expr, n: Expr) -> tuple[Expr, Expr]:
    """Split an impulse into its part along n and the rest."""
    along = ca.dot(n, impulse)
    return along, impulse - n * along


def distribute_loads(
    context: StepContext, constraints: Sequence[PlacedConstraint], impulses: Sequence[ContactImpulse]
) -> list[ContactImpulse]:
    """Make normal impulses linear across each face; points that carry no load take no part.

    Rigid bodies leave open how four corners of a box share its weight: sweeps stop at one of many answers, which
    depends on where they began, with warm start on all steps before. Friction depends on it once the box turns while
    it slides. So loads are linear across the face, a + b . r, as under a rigid plate on an elastic foundation (Winkler,
    1867): of all loads with one resultant those with the least sum of squares. The sweeps start from them.
    """
    found = list(impulses)
    if not context.settings.scheme.load_sharing:
        return found
    for group in faces(context.world):
        loads = _linear(tuple(constraints[k].constraint for k in group), tuple(found[k].normal for k in group))
        for k, load in zip(group, loads, strict=True):
            found[k] = replace(found[k], normal=load)
    return found


def faces(world: World) -> list[tuple[int, ...]]:
    """Return pairs, by index, whose points lie in a plane: of one body on a plane, or of two flat shapes."""
    groups: dict[Any, list[int]] = {}
    for k, pair in enumerate(world.pairs):
        if not pair.law.soft:
            groups.setdefault(_face(world, pair), []).append(k)
    return [tuple(group) for face, group in groups.items() if face is not None and len(group) > MAX_DETERMINED_POINTS]


def _face(world: World, pair: Pair) -> Any:
    static = _static_of(world, pair)
    if isinstance(static, Terrain):
        return None
    return (pair.first.body if isinstance(static, Plane) else pair.first), pair.second


def _static_of(world: World, pair: Pair) -> object:
    """Return the static shape of a pair; None where its second body moves."""
    return world.statics[pair.second.shape] if pair.second.body is None else None


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


def within_energy(
    context: StepContext, constraints: Sequence[PlacedConstraint], before: AllVelocities, impulses: list[ContactImpulse]
) -> list[ContactImpulse]:
    """Shorten impulses that the sweeps start from where those of a group of bodies would raise its energy.

    Sweeps lower the energy, less the work that targets ask for, but do not get far in a heap. Impulses of which s times
    them changes it by s W + s^2 C / 2 are taken -2 W / C times, at most once. What carries a load at rest has W = -C.

    Args:
        context: of the step.
        constraints: of all pairs.
        before: velocities with all else that the sweeps start from.
        impulses: of all pairs.
    """
    found, shifting = list(impulses), shifting_points(context.world)
    if not (shifting and context.settings.scheme.warm_start):
        return found
    for group in open_groups(context, constraints, before):
        if shifting.isdisjoint(group.constraints):
            continue
        own = [k for k in group.constraints if not constraints[k].constraint.law.soft]
        after = apply_start([constraints[k] for k in own], before, [impulses[k] for k in own]).momenta
        work: tuple[Expr, Expr] = (ca.SX(0), ca.SX(0))
        for k in own:
            states = (tuple(each[i] for i in constraints[k].carriers) for each in (before, after))
            work = _add_work(work, constraints[k].constraint, impulses[k], *states)
        share = _share_within(work)
        for k in own:
            found[k] = _shortened(impulses[k], share)
    return found


def shifting_points(world: World) -> set[int]:
    """Return pairs, by index, of shapes that touch in several points, which are chosen anew in each substep."""
    counts = Counter((pair.first, pair.second) for pair in world.pairs)
    level = {
        k for k, pair in enumerate(world.pairs) if isinstance(_static_of(world, pair), Plane | Terrain) or pair.law.soft
    }
    return {k for k, pair in enumerate(world.pairs) if counts[pair.first, pair.second] > 1} - level


@traced
def _add_work(
    work: tuple[Expr, Expr],
    contact: ContactConstraint,
    impulse: ContactImpulse,
    before: AllVelocities,
    after: AllVelocities,
) -> tuple[Expr, Expr]:
    """Add what load and friction do at the velocities before all impulses, and at what these change."""
    given, slip = impulse.linear(contact.impulse_normal), contact.slip(before)
    wanted = contact.normal * contact.target + contact.slip_target
    return work[0] + ca.dot(given, slip - wanted), work[1] + ca.dot(given, contact.slip(after) - slip)


@traced
def _share_within(work: tuple[Expr, Expr]) -> Expr:
    return ca.fmin(ca.fmax(-2 * work[0], 0) / ca.fmax(work[1], MIN_WORK), 1)


@traced
def _shortened(impulse: ContactImpulse, share: Expr) -> ContactImpulse:
    return impulse.times(share)


def apply_start(
    constraints: Sequence[PlacedConstraint], momenta: AllVelocities, impulses: Sequence[AnyImpulse]
) -> Iterate:
    """Apply the impulses that the sweeps start from."""
    started = list(momenta)
    for each, impulse in zip(constraints, impulses, strict=True):
        after = _apply(each.constraint, tuple(started[i] for i in each.carriers), impulse)
        for i, momentum in zip(each.carriers, after, strict=True):
            started[i] = momentum
    return Iterate(tuple(started), tuple(impulses), tuple(impulses))


@traced
def _apply(constraint: VelocityConstraint, momenta: AllVelocities, impulse: AnyImpulse) -> AllVelocities:
    return constraint.apply(momenta, impulse)
