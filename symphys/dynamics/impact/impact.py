"""An impact between two substeps of a step: no time passes, only velocities change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

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
from symphys.dynamics.impact.restitution import rebound
from symphys.dynamics.joints.assembly import locks_at, momenta_of, prepare_trees
from symphys.dynamics.motion import PredictedMotion, angular_velocity, apply
from symphys.dynamics.prediction import bodies_of, detect_contacts, predicted_motions
from symphys.dynamics.substep import Substep
from symphys.dynamics.tracing.decorator import contiguous, traced
from symphys.dynamics.unknowns import Iterate, Momentum, PlacedConstraint
from symphys.maths import rotation
from symphys.maths.smoothing import either, positive
from symphys.model.world import Law
from symphys.types import Expr

SIMULTANEITY_SHARE = 1e-9
"""Of dt: impacts that are no further apart are one."""
POSE_FIELDS = "position", "orientation"
MAX_TOUCH_GAP = 1e-3
"""Of the distance a_ref dt^2: surfaces that near to each other take part in an impact of their bodies."""


@dataclass(frozen=True)
class StepSplit:
    """Where a step is split in two.

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
    """The first impact within ``duration`` [s], on paths under the persistent forces of the last step.

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
    """1 if a contact is an impact."""
    return ca.SX(0) if law.soft else ca.logic_and(near, closes_fast(settings, contact))


@traced
def _update_earliest(earliest: tuple[Expr, Expr], closes: Expr, hit: Expr, time: Expr, dt: Expr) -> tuple[Expr, Expr]:
    """(whether there is an impact, when), with one more contact looked at; at a tie with the slope of this one."""
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
    """The length of the substep before the split; near an end it is shifted, not clamped, so that its slope stays.

    Surfaces that rounding has put beyond each other meet at a time below 0 (``time_of_impact.falls``).
    """
    least, time = MIN_SUBSTEP_SHARE * duration, earliest[1]
    early = least * (1 + ca.ceil(ca.fmax(-time, 0) / least))
    shift = ca.if_else(time < least, early, ca.if_else(time > duration - least, -least, 0))
    return ca.if_else(earliest[0], time + shift, share * duration)


def resolve_impact(context: StepContext, x: State, split: StepSplit) -> Substep:
    """The state after the impacts at ``split``; leapfrog begins anew there, so ``lag`` is 0. Without one the same x."""
    duration = ca.SX(context.settings.scheme.dt)
    motions = [motion.at_start() for motion in predicted_motions(context, x, duration)]
    contacts = detect_contacts(context, motions, duration)
    momenta = tuple(Momentum(motion.velocity, motion.momentum_k) for motion in motions)
    trees = prepare_trees(context, motions, momenta, ca.SX(0))
    constraints = []
    couple = coupled_pairs(context.world)
    for (pair, near), contact, struck, coupled in zip(
        context.pairs_and_near(), contacts, split.struck, couple, strict=True
    ):
        bodies = bodies_of(pair)
        moving = tuple(trees.motions[i] for i in bodies)
        arguments = pair.law, contact, moving, struck, split.impact, trees.same(bodies), coupled, near
        constraints.append(trees.placed(bodies, _constraint(context.settings, *arguments)))
    locks = locks_at(context, trees)
    n, still = len(locks), (*(nothing for _, nothing in locks), *(ZERO_IMPULSE for _ in constraints))
    every = (*(constraint for constraint, _ in locks), *constraints)
    states = contiguous(trees.states) if context.near else trees.states
    solved = rebound(context, every, Iterate(states, still, still), motions, trees)
    after = _with_velocities(context, x, motions, momenta_of(context, trees, solved.momenta), split.impact)
    _delay(context, after, constraints, solved.impulses[n:], split.late)
    forces = (x[f"{pair.name}.force"] for pair in context.world.pairs)
    ahead = tuple(split.impact * x["lag"] * force for force in forces)
    changes = tuple(zip(solved.impulses, solved.last, strict=True))
    return Substep(after, tuple(constraints), tuple(contacts), solved.impulses[n:], changes, ahead)


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
    """The constraint of a contact at an impact: where ``struck`` it rebounds, where it touches it holds."""
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
    """(velocity, angular velocity): as solved if there is an impact, else as before."""
    spin = angular_velocity(motion.inertia, motion.orientation, momentum.angular)
    return ca.if_else(impact, momentum.velocity, before[0]), ca.if_else(impact, spin, before[1])


@traced
def _restarted_lag(impact: Expr, lag: Expr) -> Expr:
    return ca.if_else(impact, 0, lag)
