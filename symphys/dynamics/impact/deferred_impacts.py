"""Which impacts the last substep of a step leaves to the next step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.collision import Contact
from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.impact.impact import TOUCHING, StepSplit, strikes
from symphys.dynamics.impact.restitution import eccentric_bodies
from symphys.dynamics.prediction import bodies_of, detect_contacts, predicted_motions
from symphys.dynamics.tracing.decorator import opened, traced
from symphys.maths.smoothing import either
from symphys.model.scalar import is_zero
from symphys.model.shapes import Sphere
from symphys.model.world import Law, Pair, World

Expr = Any
"""casadi SX, MX or DM"""


@dataclass(frozen=True)
class DeferredImpacts:
    """What the last substep of a step leaves to the next.

    Attributes:
        suppressed: per pair: 1 if it must give no impulse.
        chained: 1 if one of them is an impact that comes late by that.
        plastic: 1 if a hit drives bodies together that have no room to wait: nothing rebounds then, since all at once
            from the velocities before would add energy.
    """

    suppressed: tuple[Expr, ...]
    chained: Expr
    plastic: Expr


def defer_impacts(context: StepContext, x: State, duration: Expr, splits: Sequence[StepSplit]) -> DeferredImpacts:
    """What must give no impulse within ``duration`` [s], the last substep of a step.

    That is what closes at speed but does not meet. And, where surfaces rebound or bodies can be hit off their centres,
    all but the first impact of a body: two at once would be resolved from the velocities before both, which can add
    energy. So a blow that goes through a row of balls takes an impact a substep, as in the row: the next ball is not
    held back before it is hit.
    """
    pairs, world = context.world.pairs, context.world
    contacts = detect_contacts(context, predicted_motions(context, x, duration), duration)
    near = [each for _, each in context.pairs_and_near()]
    looked_at = list(zip(pairs, near, contacts, strict=True))
    hits = [_hit(context.settings, pair.law, contact, each) for pair, each, contact in looked_at]
    eccentric, sides = eccentric_bodies(world), {k for pair in pairs for k in bodies_of(pair)}
    rebounds = {k for pair in pairs if not is_zero(pair.law.restitution) for k in bodies_of(pair)}
    first: dict[int, tuple[Expr, Expr]] = {
        body: opened((duration, ca.SX(0)), body) for body in sorted(sides & (eccentric | rebounds))
    }
    for pair, contact, (_, meets) in zip(pairs, contacts, hits, strict=True):
        for body in first.keys() & set(bodies_of(pair)):
            first[body] = _sooner(first[body], meets, contact.time, contact.rate)
    found, chained, plastic = list[Expr](), opened(ca.SX(0)), opened(ca.SX(0))
    struck = {body: opened(ca.SX(0), body) for body in sorted(first.keys() & eccentric)}
    for j, pair in enumerate(pairs):
        for body in struck.keys() & set(bodies_of(pair)):
            for split in splits:
                struck[body] = _or(struck[body], split.struck[j])
    for (pair, each, contact), (fast, meets) in zip(looked_at, hits, strict=True):
        waits = _passes(fast, meets)
        for body in sorted(first.keys() & set(bodies_of(pair))):
            waits = _later(waits, fast, contact.time, first[body][0], struck.get(body, ca.SX(0)))
            if (room := _room(world, pair, eccentric)) is not None:
                before, sight = ((waits,), (chained,), (plastic,)), (fast, contact, each)
                flags = _driven(context.settings, before, sight, first[body], duration, room)
                (waits,), (chained,), (plastic,) = flags
        found.append(waits)
        chained = _chained(chained, waits, meets)
    return DeferredImpacts(tuple(found), chained, plastic)


def _room(world: World, pair: Pair, eccentric: set[int]) -> Expr | None:
    """How far two balls that rebound may go into each other before they are parted [m]; None for other pairs."""
    if pair.law.soft or is_zero(pair.law.restitution) or eccentric & set(bodies_of(pair)):
        return None
    shapes = [world.surface(side) for side in (pair.first, pair.second) if side.body is not None]
    radii = [shape.radius for shape in shapes if isinstance(shape, Sphere)]
    return radii[0] if len(radii) == 1 else ca.fmin(*radii)


@traced
def _hit(settings: StepSettings, law: Law, contact: Contact, near: Expr) -> tuple[Expr, Expr]:
    """(whether it closes at speed, whether it then meets)."""
    fast = strikes(settings, law, contact, near)
    return fast, ca.logic_and(fast, contact.hit)


@traced
def _sooner(first: tuple[Expr, Expr], meets: Expr, time: Expr, rate: Expr) -> tuple[Expr, Expr]:
    """(when a body is first hit, the greatest speed at which it is), with one more contact looked at."""
    return ca.if_else(meets, ca.fmin(first[0], time), first[0]), ca.if_else(meets, ca.fmax(first[1], -rate), first[1])


@traced
def _driven(
    settings: StepSettings,
    before: tuple[tuple[Expr], ...],
    sight: tuple[Expr, Contact, Expr],
    first: tuple[Expr, Expr],
    duration: Expr,
    room: Expr,
) -> tuple[tuple[Expr], ...]:
    """(whether a pair waits, whether there is a chain, one without room), with a pair that a hit may drive together.

    Its surfaces are apart, and the hit comes before they meet. It waits if they cannot go far into each other. Each
    flag is a tuple of its own, so that it lies by itself and stands for what it was where the pair is far.
    """
    (fast, contact, near), way = sight, 2 * first[1] * duration
    apart = ca.logic_and(contact.gap > TOUCHING * settings.reference * settings.scheme.dt**2, 1 - fast)
    driven = ca.logic_and(near, ca.logic_and(ca.logic_and(apart, first[1] > 0), contact.gap < way))
    waits = ca.logic_and(driven, way < room)
    found = waits, driven, ca.logic_and(driven, 1 - waits)
    return tuple((either(flag, new),) for (flag,), new in zip(before, found, strict=True))


@traced
def _chained(before: Expr, waits: Expr, meets: Expr) -> Expr:
    return either(before, ca.logic_and(waits, meets))


@traced
def _passes(fast: Expr, meets: Expr) -> Expr:
    return ca.logic_and(fast, ca.logic_not(meets))


@traced
def _or(before: Expr, new: Expr) -> Expr:
    return either(before, new)


@traced
def _later(waits: Expr, fast: Expr, time: Expr, first: Expr, before: Expr) -> Expr:
    return either(waits, ca.logic_and(fast, ca.logic_or(time > first, before)))
