"""Which impacts the last substep of a step leaves to the next step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.collision import Contact
from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.impact.impact import MAX_TOUCH_GAP, SIMULTANEITY_SHARE, StepSplit, strikes
from symphys.dynamics.impact.restitution import eccentric_bodies
from symphys.dynamics.prediction import bodies_of, detect_contacts, predicted_motions
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import either
from symphys.model.scalar import is_zero
from symphys.model.shapes import Sphere
from symphys.model.world import Law, Pair, World
from symphys.types import Expr


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
    """Return the contacts that must give no impulse within ``duration`` [s], the last substep of a step.

    That is what closes at speed but does not meet. And, where surfaces rebound or bodies can be hit off their centres,
    all but the first impact of a body: two at once would be resolved from the velocities before both, which can add
    energy. So a blow that goes through a row of balls takes an impact a substep, as in the row: the next ball is not
    held back before it is hit.
    """
    pairs, world = context.world.pairs, context.world
    motions = predicted_motions(context, x, duration)
    contacts = detect_contacts(context, motions, duration)
    near = [each for _, each in context.pairs_and_near()]
    looked_at = list(zip(pairs, near, contacts, strict=True))
    hits = [_closing_contact(context.settings, pair.law, contact, each) for pair, each, contact in looked_at]
    eccentric, sides = eccentric_bodies(world), {k for pair in pairs for k in bodies_of(pair)}
    rebounds = {k for pair in pairs if not is_zero(pair.law.restitution) for k in bodies_of(pair)}
    first: dict[int, Expr] = dict.fromkeys(sorted(sides & (eccentric | rebounds)), duration)
    for pair, contact, (_, meets) in zip(pairs, contacts, hits, strict=True):
        for body in first.keys() & set(bodies_of(pair)):
            first[body] = _update_first_hit(first[body], meets, contact.time)
    struck = {body: ca.SX(0) for body in sorted(first.keys() & eccentric)}
    for j, pair in enumerate(pairs):
        for body in struck.keys() & set(bodies_of(pair)):
            for split in splits:
                struck[body] = _either(struck[body], split.struck[j])
    rooms = [_max_overlap(world, pair, eccentric) for pair in pairs]
    central = {k for pair, room in zip(pairs, rooms, strict=True) if room is not None for k in bodies_of(pair)}
    blows = {body: ca.SX.zeros(3) for body in sorted(central)}
    for pair, contact, (_, meets) in zip(pairs, contacts, hits, strict=True):
        bodies = bodies_of(pair)
        masses = tuple(motions[i].mass for i in bodies)
        for side, body in enumerate(bodies):
            if body in blows:
                so_far = blows[body], first[body]
                blows[body] = _add_blow(context.settings, pair.law, side, masses, so_far, meets, contact)
    found, chained, plastic = list[Expr](), ca.SX(0), ca.SX(0)
    for (pair, each, contact), (fast, meets), room in zip(looked_at, hits, rooms, strict=True):
        waits, bodies = _closes_without_touch(fast, meets), bodies_of(pair)
        for body in sorted(first.keys() & set(bodies)):
            waits = _defer_later_hit(waits, fast, contact.time, first[body], struck.get(body, ca.SX(0)))
        if room is not None:
            before, sight = ((waits,), (chained,), (plastic,)), (fast, contact, each)
            own = tuple((first[body], blows[body]) for body in bodies)
            (waits,), (chained,), (plastic,) = _driven_pair(context.settings, before, sight, own, duration, room)
        found.append(waits)
        chained = _update_chained(chained, waits, meets)
    return DeferredImpacts(tuple(found), chained, plastic)


def _max_overlap(world: World, pair: Pair, eccentric: set[int]) -> Expr | None:
    """Return how deep two rebounding balls may overlap before they are parted [m]; None for other pairs."""
    if pair.law.soft or is_zero(pair.law.restitution) or eccentric & set(bodies_of(pair)):
        return None
    shapes = [world.surface(side) for side in (pair.first, pair.second) if side.body is not None]
    radii = [shape.radius for shape in shapes if isinstance(shape, Sphere)]
    return (radii[0] if len(radii) == 1 else ca.fmin(*radii)) / 2


@traced
def _closing_contact(settings: StepSettings, law: Law, contact: Contact, near: Expr) -> tuple[Expr, Expr]:
    """(whether it closes at speed, whether it then meets)."""
    fast = strikes(settings, law, contact, near)
    return fast, ca.logic_and(fast, contact.hit)


@traced
def _update_first_hit(first: Expr, meets: Expr, time: Expr) -> Expr:
    """Update the instant at which a body is first hit by one more contact."""
    return ca.if_else(meets, ca.fmin(first, time), first)


@traced
def _add_blow(
    settings: StepSettings,
    law: Law,
    side: int,
    masses: tuple[Expr, ...],
    before: tuple[Expr, Expr],
    meets: Expr,
    contact: Contact,
) -> Expr:
    """Update the velocity change of a ball at its first hit [m/s] by one more contact; simultaneous hits add."""
    blow, first = before
    share = 1 / masses[side] / sum(1 / mass for mass in masses)
    kick = (1 + law.restitution) * share * ca.fmax(-contact.rate, 0) * (1 - 2 * side)
    counts = ca.logic_and(meets, contact.time < first + SIMULTANEITY_SHARE * settings.scheme.dt)
    return blow + ca.if_else(counts, kick, 0) * contact.geometry.frame(contact.time).normal


@traced
def _driven_pair(
    settings: StepSettings,
    before: tuple[tuple[Expr], ...],
    sight: tuple[Expr, Contact, Expr],
    blows: tuple[tuple[Expr, Expr], ...],
    duration: Expr,
    room: Expr,
) -> tuple[tuple[Expr], ...]:
    """(whether a pair waits, whether there is a chain, one without room), with a pair that hits may drive together.

    Its surfaces are apart, or part at speed as after an impact, and its bodies are hit before they meet. It waits if
    they do not go far into each other by that. Each flag is a tuple of its own, so that it lies by itself and stands
    for what it was where the pair is far.
    """
    fast, contact, near = sight
    normal, touch = contact.geometry.frame(duration).normal, MAX_TOUCH_GAP * settings.reference * settings.scheme.dt**2
    speeds = [-(1 - 2 * side) * ca.dot(normal, blow) for side, (_, blow) in enumerate(blows)]
    way = duration * sum(ca.fmax(speed, 0) for speed in speeds)
    depth = sum((duration - time) * speed for (time, _), speed in zip(blows, speeds, strict=True)) - contact.end
    parts = ca.logic_and(contact.rate > settings.fast, contact.end > touch)
    apart = ca.logic_and(either(contact.gap > touch, parts), 1 - fast)
    driven = ca.logic_and(near, ca.logic_and(ca.logic_and(apart, way > 0), contact.end < way))
    waits = ca.logic_and(driven, depth < room)
    found = waits, driven, ca.logic_and(driven, 1 - waits)
    return tuple((either(flag, new),) for (flag,), new in zip(before, found, strict=True))


@traced
def _update_chained(before: Expr, waits: Expr, meets: Expr) -> Expr:
    return either(before, ca.logic_and(waits, meets))


@traced
def _closes_without_touch(fast: Expr, meets: Expr) -> Expr:
    return ca.logic_and(fast, ca.logic_not(meets))


@traced
def _either(before: Expr, new: Expr) -> Expr:
    return either(before, new)


@traced
def _defer_later_hit(waits: Expr, fast: Expr, time: Expr, first: Expr, before: Expr) -> Expr:
    return either(waits, ca.logic_and(fast, ca.logic_or(time > first, before)))
