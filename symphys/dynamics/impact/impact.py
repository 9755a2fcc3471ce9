"""Impacts between two substeps of a step, and those that a step defers to the next one.

No time passes in an impact, only velocities change. ``find_split`` finds the first impact, ``resolve_impact`` applies
it, and ``defer_impacts`` selects the contacts that must give no impulse in the last substep.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.arguments import law_as_arguments
from symphys.dynamics.collision import Contact
from symphys.dynamics.contact.body_term import Motions, at_touch, body_terms
from symphys.dynamics.contact.constraint import INACTIVE_NORMAL_SPEED, ZERO_IMPULSE, ContactConstraint, ContactImpulse
from symphys.dynamics.contact.coupling import coupled_pairs, coupling_of
from symphys.dynamics.contact.effective_mass import (
    delassus_column,
    effective_masses,
    inverse_masses,
    symmetric_mobilities,
)
from symphys.dynamics.contact.friction import friction_at
from symphys.dynamics.contact.preparation import MIN_SUBSTEP_SHARE, closes_fast, width_of
from symphys.dynamics.context import State, StepContext, StepSettings
from symphys.dynamics.impact.restitution import eccentric_bodies, rebound
from symphys.dynamics.joints.assembly import locks_at, momenta_of, prepare_trees
from symphys.dynamics.motion import PredictedMotion, angular_velocity, apply
from symphys.dynamics.prediction import bodies_of, detect_contacts, predicted_motions
from symphys.dynamics.substep import Substep
from symphys.dynamics.tracing.decorator import contiguous, traced
from symphys.dynamics.unknowns import Iterate, Momentum, PlacedConstraint
from symphys.maths import rotation
from symphys.maths.smoothing import either, positive
from symphys.model.scalar import is_zero
from symphys.model.shapes import Sphere
from symphys.model.state_layout import force_names
from symphys.model.world import Law, Pair, World
from symphys.records import dataclass
from symphys.types import Expr

SIMULTANEITY_SHARE = 1e-9
"""Largest time between simultaneous impacts, as a share of dt."""
POSE_FIELDS = "position", "orientation"
MAX_TOUCH_GAP = 1e-3
"""Largest gap of surfaces that take part in an impact of their bodies, as a share of the distance a_ref dt^2."""


@dataclass(frozen=True)
class StepSplit:
    """The split of a step at its first impact.

    Attributes:
        impact: 1 if the split is an impact, 0 if there is none.
        first: length of the first substep [s].
        fast: per pair: 1 if it closes at speed.
        struck: per pair: 1 if it meets at speed then.
        late: per pair: how much later than the first a struck pair meets [s]: rounding, but with a slope.
    """

    impact: Expr
    first: Expr
    fast: tuple[Expr, ...]
    struck: tuple[Expr, ...]
    late: tuple[Expr, ...]


def find_split(context: StepContext, x: State, duration: Expr, share: float) -> StepSplit:
    """Return the first impact within ``duration`` [s], on paths under the persistent forces of the last step.

    Without an impact the split is at ``share`` of the duration.
    """
    contacts = detect_contacts(context, predicted_motions(context, x, duration), duration)
    fast = [
        strikes(context.settings, pair.law, contact, near)
        for (pair, near), contact in zip(context.pairs_and_near(), contacts, strict=True)
    ]
    earliest = (ca.SX(0), duration)
    for contact, closes in zip(contacts, fast, strict=True):
        earliest = _update_earliest(earliest, closes, contact.hit, contact.time, context.settings.scheme.dt)
    first = _substep_length(earliest, duration, share)
    until = _latest_shared_time(earliest[1], first, context.settings.scheme.dt)
    struck = [_is_struck(c, contact.hit, contact.time, until) for contact, c in zip(contacts, fast, strict=True)]
    late = [_time_after_split(earliest, s, contact.time) for contact, s in zip(contacts, struck, strict=True)]
    return StepSplit(earliest[0], first, tuple(fast), tuple(struck), tuple(late))


@traced
def strikes(settings: StepSettings, law: Law, contact: Contact, near: Expr) -> Expr:
    """Return 1 if a contact is an impact."""
    return ca.SX(0) if law.soft else ca.logic_and(near, closes_fast(settings, contact))


@traced
def _update_earliest(earliest: tuple[Expr, Expr], closes: Expr, hit: Expr, time: Expr, dt: Expr) -> tuple[Expr, Expr]:
    """Update whether there is an impact, and when, by one more contact; a tie has the slope of this one."""
    meets = ca.logic_and(closes, hit)
    sooner = ca.logic_and(meets, time < earliest[1] + SIMULTANEITY_SHARE * dt)
    return either(earliest[0], meets), ca.if_else(sooner, time, earliest[1])


@traced
def _latest_shared_time(earliest: Expr, first: Expr, dt: Expr) -> Expr:
    """Return the latest instant of impacts that share the split; none may lie between it and the split."""
    return ca.fmax(earliest, first) + SIMULTANEITY_SHARE * dt


@traced
def _is_struck(closes: Expr, hit: Expr, time: Expr, until: Expr) -> Expr:
    return ca.logic_and(ca.logic_and(closes, hit), time <= until)


@traced
def _time_after_split(earliest: tuple[Expr, Expr], struck: Expr, time: Expr) -> Expr:
    impact, first = earliest
    return ca.if_else(ca.logic_and(impact, struck), time - first, 0)


@traced
def _substep_length(earliest: tuple[Expr, Expr], duration: Expr, share: float) -> Expr:
    """Return the length of the substep before the split; near an end it is shifted, which keeps its slope.

    Surfaces that rounding has put beyond each other meet at a time below 0 (``time_of_impact.falls``).
    """
    least, time = MIN_SUBSTEP_SHARE * duration, earliest[1]
    early = least * (1 + ca.ceil(ca.fmax(-time, 0) / least))
    shift = ca.if_else(time < least, early, ca.if_else(time > duration - least, -least, 0))
    return ca.if_else(earliest[0], time + shift, share * duration)


def resolve_impact(context: StepContext, x: State, split: StepSplit) -> Substep:
    """Return the state after the impacts at ``split``.

    Leapfrog begins anew there, so ``lag`` is 0. Without one the same x.
    """
    duration = ca.SX(context.settings.scheme.dt)
    # motions and velocities at the instant of the impact
    motions = [motion.at_start() for motion in predicted_motions(context, x, duration)]
    contacts = detect_contacts(context, motions, duration)
    momenta = tuple(Momentum(motion.velocity, motion.momentum_k) for motion in motions)
    trees = prepare_trees(context, motions, momenta, ca.SX(0))
    # contacts that are struck rebound, those that touch hold
    constraints = []
    couple = coupled_pairs(context.world)
    for (pair, near), contact, struck, coupled in zip(
        context.pairs_and_near(), contacts, split.struck, couple, strict=True
    ):
        bodies = bodies_of(pair)
        moving = tuple(trees.motions[i] for i in bodies)
        arguments = law_as_arguments(pair.law), contact, moving, struck, split.impact, trees.same(bodies), coupled, near
        constraints.append(trees.placed(bodies, _constraint(context.settings, *arguments)))
    # sweeps over contacts and the locks of loops, with restitution that adds no energy (23)
    locks = locks_at(context, trees)
    n, still = len(locks), (*(nothing for _, nothing in locks), *(ZERO_IMPULSE for _ in constraints))
    every = (*(constraint for constraint, _ in locks), *constraints)
    states = contiguous(trees.states) if context.near else trees.states
    solved = rebound(context, every, Iterate(states, still, still), motions, trees)
    # velocities change, positions only by impulses that act after their split
    after = _with_velocities(context, x, motions, momenta_of(context, trees, solved.momenta), split.impact)
    _delay(context, after, constraints, solved.impulses[n:], split.late)
    forces = (x[f"{pair.name}.force"] for pair in context.world.pairs)
    ahead = tuple(split.impact * x["lag"] * force for force in forces)
    changes = tuple(zip(solved.impulses, solved.last, strict=True))
    along = {name: _while_lagging(split.impact, x["lag"], x[name]) for name, _ in force_names(context.world)}
    return Substep(after, tuple(constraints), tuple(contacts), solved.impulses[n:], changes, along, along, ahead)


@traced
def _while_lagging(impact: Expr, lag: Expr, force: Expr) -> Expr:
    return impact * lag * force


@traced
def _constraint(
    settings: StepSettings,
    law: Law,
    contact: Contact,
    motions: Motions,
    struck: Expr,
    impact: Expr,
    same: bool,
    coupled: bool,
    near: Expr,
) -> ContactConstraint:
    """Return the constraint of a contact at an impact: where ``struck`` it rebounds, where it touches it holds."""
    now, scheme = ca.SX(0), settings.scheme
    touching = ca.logic_and(impact, contact.gap < MAX_TOUCH_GAP * settings.reference * scheme.dt**2)
    velocity, _, normal = at_touch(contact, motions, now)
    speed = law.restitution * positive(-ca.dot(normal, velocity), settings.smoothing)
    frame = contact.geometry.frame(now)
    terms, friction = body_terms(motions, now, frame, frame), friction_at(law, frame.normal, motions, now)
    resting = ca.if_else(touching, 0, INACTIVE_NORMAL_SPEED)
    push, twist = symmetric_mobilities(terms, same)
    masses = inverse_masses(terms, frame.normal, push, twist)
    return ContactConstraint(
        law,
        friction,
        terms,
        frame.normal,
        frame.normal,
        delassus_column(terms, frame.normal, same),
        separates=ca.SX(1),
        **effective_masses(*masses),
        softness=ca.SX(0),
        target=ca.SX(INACTIVE_NORMAL_SPEED) if law.soft else ca.if_else(struck, speed, resting),
        slip_target=ca.SX.zeros(3),
        delay=ca.SX(0),
        leaving=struck,
        lasts=ca.SX(0),
        load=ca.SX(0),
        slack=ca.SX(0),
        struck=struck,
        width=struck * width_of(settings, contact),
        smoothing=settings.smoothing,
        same=same,
        coupling=coupling_of(push, frame.normal, friction, ca.SX(0)) if coupled else None,
        near=near,
    )


def _with_velocities(
    context: StepContext, x: State, motions: Sequence[PredictedMotion], momenta: Sequence[Momentum], impact: Expr
) -> State:
    values = dict(x)
    for body, motion, momentum in zip(context.world.bodies, motions, momenta, strict=True):
        names = f"{body.name}.velocity", f"{body.name}.angular_velocity"
        before = tuple(x[name] for name in names)
        values |= zip(names, _velocities_after(motion, momentum, before, impact), strict=True)
    values["lag"] = _restarted_lag(impact, x["lag"])
    return values


def _delay(
    context: StepContext,
    x: State,
    constraints: Sequence[PlacedConstraint],
    impulses: Sequence[ContactImpulse],
    late: Sequence[Expr],
) -> None:
    """Take back what each impulse does to positions before its own instant, on bodies without joints.

    Impacts of several bodies at one instant share a split, but each has an instant with a slope of its own.
    """
    held = {index for joint in context.world.joints for index in joint.bodies}
    for each, impulse, time in zip(constraints, impulses, late, strict=True):
        free = [(k, index) for k, index in enumerate(each.bodies) if index not in held]
        if not free:
            continue
        names = [tuple(f"{context.world.bodies[index].name}.{part}" for part in POSE_FIELDS) for _, index in free]
        poses, terms = tuple(tuple(x[name] for name in own) for own in names), tuple(k for k, _ in free)
        for own, pose in zip(names, _delayed(poses, each.constraint, terms, impulse, time), strict=True):
            x |= zip(own, pose, strict=True)


@traced
def _delayed(
    poses: tuple[tuple[Expr, ...], ...],
    constraint: ContactConstraint,
    terms: tuple[int, ...],
    impulse: ContactImpulse,
    time: Expr,
) -> tuple[tuple[Expr, Expr], ...]:
    push, twist = impulse.linear(constraint.impulse_normal), impulse.angular(constraint.impulse_normal)
    found = []
    for k, (position, q) in zip(terms, poses, strict=True):
        term = constraint.terms[k]
        early = -time * term.sign
        turn = early * apply(term.inverse_inertia, ca.cross(term.impulse_arm, push) + twist)
        moved = position + early * term.inverse_mass * push
        found.append((moved, q + rotation.multiply(ca.vertcat(0, turn / 2), q)))
    return tuple(found)


@traced
def _velocities_after(
    motion: PredictedMotion, momentum: Momentum, before: tuple[Expr, ...], impact: Expr
) -> tuple[Expr, Expr]:
    """Return velocity and angular velocity: those of the solution if there is an impact, else those before."""
    spin = angular_velocity(motion.inertia, motion.orientation, momentum.angular)
    return ca.if_else(impact, momentum.velocity, before[0]), ca.if_else(impact, spin, before[1])


@traced
def _restarted_lag(impact: Expr, lag: Expr) -> Expr:
    return ca.if_else(impact, 0, lag)


@dataclass(frozen=True)
class DeferredImpacts:
    """Impacts that the last substep of a step leaves to the next step.

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
    # contacts that close at speed within the rest of the step, and whether they meet
    pairs, world = context.world.pairs, context.world
    motions = predicted_motions(context, x, duration)
    contacts = detect_contacts(context, motions, duration)
    near = [each for _, each in context.pairs_and_near()]
    looked_at = list(zip(pairs, near, contacts, strict=True))
    hits = [_closing_contact(context.settings, pair.law, contact, each) for pair, each, contact in looked_at]
    # instant of the first hit of each body that may be hit twice
    eccentric, sides = eccentric_bodies(world), {k for pair in pairs for k in bodies_of(pair)}
    rebounds = {k for pair in pairs if not is_zero(pair.law.restitution) for k in bodies_of(pair)}
    first: dict[int, Expr] = dict.fromkeys(sorted(sides & (eccentric | rebounds)), duration)
    for pair, contact, (_, meets) in zip(pairs, contacts, hits, strict=True):
        for body in first.keys() & set(bodies_of(pair)):
            first[body] = _update_first_hit(first[body], meets, contact.time)
    # bodies that an earlier impact of this step has struck already
    struck = {body: ca.SX(0) for body in sorted(first.keys() & eccentric)}
    for j, pair in enumerate(pairs):
        for body in struck.keys() & set(bodies_of(pair)):
            for split in splits:
                struck[body] = _either(struck[body], split.struck[j])
    # velocity changes of balls at their first hits
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
    # contacts that give no impulse: they close without touch, or their body is hit before
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
    """Return whether a contact closes at speed, and whether it then meets."""
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
    """Update whether a pair waits, a chain exists, one lacks room, by a pair that hits may drive together.

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
