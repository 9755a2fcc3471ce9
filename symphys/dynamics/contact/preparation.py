"""Preparation of a contact constraint: all terms over a substep that the sweeps need, computed once.

Formulas: docs/time_step.md, "4. Contact constraint". Letters: t* instant of touch, s = dt - t* what is left of the
step, n normal, r arms, v* velocity of approach at t*, f* relative acceleration of the touching points there,
u rebound speed, chi in [0, 1]: 1 where the rebound leaves the step, 0 where it falls back (rest).
"""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Frame
from symphys.dynamics.collision.time_of_impact import MAX_REST_SPEED, MAX_TOUCH_GAP, MIN_CLOSING_SPEED
from symphys.dynamics.contact.body_term import BodyTerm, Motions, at_touch, body_terms, free_slip
from symphys.dynamics.contact.constraint import INACTIVE_NORMAL_SPEED, ContactConstraint
from symphys.dynamics.contact.coupling import coupling_of, pulls_together
from symphys.dynamics.contact.effective_mass import (
    delassus_column,
    effective_masses,
    inverse_masses,
    no_less_than_response,
    separates,
    symmetric_mobilities,
)
from symphys.dynamics.contact.friction import friction_at
from symphys.dynamics.contact.soft import SoftApproach, SoftImpulse, soft_impulse
from symphys.dynamics.context import MAX_REST_GAP, StepSettings
from symphys.dynamics.motion import apply
from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import clip, positive
from symphys.model.world import Law
from symphys.records import dataclass
from symphys.types import Expr

REBOUND_MARGIN = 1e-4
"""Width of chi's rise, as a share of the reference acceleration: a rebound that barely leaves is part rest."""

TIE_DISTANCE = 1e-11
"""[m] surfaces that move at speed and are that near at the end of a substep do not touch then; see ``_slack``."""
NO_CORRECTION_SLOP = 1e6
"""[m] more than any overlap: what gives no impulse is not pushed out either."""
MIN_SUBSTEP_SHARE = 1e-6
"""Shortest substep before or after an impact, as a share of dt."""
MIN_LOAD_SHARE = 1e-3
"""Least load, as a share of the weight of the effective mass. A smoothed contact always carries a little."""


@dataclass(frozen=True)
class SubstepFlags:
    """State of a contact within a substep.

    Attributes:
        suppressed: 1 for a contact that gives no impulse.
        plastic: 1 where it does not rebound.
        force: (3,) with which the contact acted at the end of the last step [N].
        same: whether both bodies are of one tree of joints.
        coupled: whether friction may act strongly on the normal velocity.
        near: 0 if the surfaces are too far apart to act.
        lagging: force and torque on each body that lasted from the last step, where the motions are without them.
        lag: over how much time these have acted already [s].
    """

    suppressed: Expr
    plastic: Expr
    force: Expr
    same: bool
    coupled: bool
    near: Expr
    lagging: tuple[tuple[Expr, Expr], ...]
    lag: Expr


@traced
def prepare(
    settings: StepSettings, law: Law, contact: Contact, motions: Motions, duration: Expr, conditions: SubstepFlags
) -> ContactConstraint:
    """Return the constraint of a contact along the free motions of its bodies, over a substep of ``duration`` [s]."""
    scheme, smoothing, half = settings.scheme, settings.smoothing, duration / 2
    suppressed, same, coupled = conditions.suppressed, conditions.same, conditions.coupled
    # instant and frames of touch (7, 8), and of the impulse
    touch = _touch(settings, law, contact, motions, duration, conditions)
    instant = half + touch.leaving * (touch.time - half)
    acting = touch.hit * contact.time if law.soft else touch.leaving * touch.time
    frame, applied = contact.geometry.frame(instant), contact.geometry.frame(acting)
    terms, friction = body_terms(motions, instant, frame, applied), friction_at(law, frame.normal, motions, instant)
    # effective inverse masses (12)
    push, twist = symmetric_mobilities(terms, same)
    k_normal, k_tangent, k_spin, k_roll = inverse_masses(terms, frame.normal, push, twist)
    # normal target: the rebound carried to mid-step (9), or the velocity that just closes the gap; soft contacts (10)
    slack = ca.if_else(suppressed, NO_CORRECTION_SLOP, _slack(settings, contact, touch, duration))
    slip = free_slip(terms, motions)
    free = ca.dot(frame.normal, slip)
    away = ca.fmin(free - (contact.end + slack) / duration, 0)
    soft = _soft_impulse(law, contact, motions, duration, conditions, (free, applied, acting)) if law.soft else None
    softness = ca.SX(0) if soft is None else soft.softness
    target = _normal_target(contact, duration, touch, away, smoothing) if soft is None else soft.target
    # delay of the impulse (13), and its response
    landing = _landing(contact, duration, touch.time, target, free)
    column = delassus_column(terms, applied.normal, same)
    parts = separates(terms, frame.normal, column)
    k_normal = no_less_than_response(terms, frame.normal, column, k_normal)
    # contacts that last: they carried load, are near and do not part
    weight, load = MIN_LOAD_SHARE * settings.reference / k_normal, ca.dot(applied.normal, conditions.force)
    loaded = ca.logic_and(load > weight, ca.logic_not(suppressed))
    lasts = _lasts(settings, law, contact, touch.leaving, loaded)
    target = ca.if_else(lasts, -_separating_speed(settings, contact, k_normal, ca.fmax(load, weight), duration), target)
    return ContactConstraint(
        law=law,
        friction=friction,
        terms=terms,
        normal=frame.normal,
        impulse_normal=applied.normal,
        delassus_column=column,
        **effective_masses(k_normal + softness, k_tangent, k_spin, k_roll, parts),
        softness=softness,
        separates=parts,
        target=ca.if_else(ca.logic_or(suppressed, 1 - parts), INACTIVE_NORMAL_SPEED, target),
        slip_target=touch.slip(half) if scheme.impact_friction else ca.SX.zeros(3),
        delay=_delay(touch, landing, lasts, half, terms) if scheme.time_of_impact and not law.soft else ca.SX(0),
        leaving=touch.leaving,
        lasts=lasts,
        load=weight * duration,
        slack=slack,
        struck=ca.SX(0) if law.soft else ca.logic_and(touch.hit, closes_fast(settings, contact)),
        width=width_of(settings, contact),
        smoothing=smoothing,
        same=same,
        coupling=coupling_of(push, frame.normal, friction, softness) if coupled else None,
        paradox=pulls_together(push, frame.normal, friction, slip) if coupled else ca.SX(0),
        near=conditions.near,
        soft=soft,
    )


@dataclass(frozen=True)
class _FreeTouch:
    """Touch and rebound of a contact under free motion within a substep.

    Attributes:
        time: at which the surfaces meet [s]; 0 without time of impact.
        acceleration: (3,) of the free motion there, between the surfaces [m/s^2].
        normal: (3,) there.
        pull: the acceleration along it [m/s^2].
        rebound: at which they would part [m/s].
        hit: 1 if they meet within the substep.
        leaving: chi: 1 if they are still apart when it ends, 0 if they have fallen back by then.
    """

    time: Expr
    acceleration: Expr
    normal: Expr
    pull: Expr
    rebound: Expr
    hit: Expr
    leaving: Expr

    def slip(self, half: Expr) -> Expr:
        """Return the slip (3,) [m/s] at mid-substep that arises after the impact, at whose instant friction acts."""
        return self.hit * self.leaving * (half - self.time) * (self.acceleration - self.normal * self.pull)


def _touch(
    settings: StepSettings, law: Law, contact: Contact, motions: Motions, duration: Expr, conditions: SubstepFlags
) -> _FreeTouch:
    time = contact.time if settings.scheme.time_of_impact else ca.SX(0)
    velocity, acceleration, normal = at_touch(contact, motions, time)
    pull = ca.dot(normal, acceleration)
    rebound = law.restitution * (1 - conditions.plastic) * positive(-ca.dot(normal, velocity), settings.smoothing)
    hit = ca.if_else(
        conditions.suppressed, 0, contact.hit
    )  # at the end of a substep rounding decides whether a suppressed one meets
    chi = _leaves(rebound, pull, duration - time, settings.reference, settings.scheme.dt, settings.smoothing)
    return _FreeTouch(time, acceleration, normal, pull, rebound, hit, hit * chi)


def _delay(touch: _FreeTouch, landing: Expr, lasts: Expr, half: Expr, terms: tuple[BodyTerm, ...]) -> Expr:
    """Return how late the contact acts [s]; for lasting ones on trees see docs/joints.md, "Feet that stand"."""
    delay = touch.hit * (touch.time + (1 - touch.leaving) * (landing - touch.time))
    return ca.if_else(lasts, half, delay) if any(term.jacobian is not None for term in terms) else delay


def _separating_speed(settings: StepSettings, contact: Contact, k_normal: Expr, load: Expr, duration: Expr) -> Expr:
    """Return the speed w^2 / (4 k load) [m/s] at which a load keeps surfaces parting on the central path."""
    return width_of(settings, contact) ** 2 / (4 * k_normal * load * duration)


def closes_fast(settings: StepSettings, contact: Contact) -> Expr:
    """Return 1 if a contact closes at a speed that makes it an impact: now, or as a tip that swings round."""
    swings = contact.gap > settings.fast * contact.time + MAX_REST_GAP * settings.reference * settings.scheme.dt**2
    return ca.logic_or(contact.rate < -settings.fast, ca.logic_and(contact.hit, swings))


def width_of(settings: StepSettings, contact: Contact) -> Expr:
    """Return the width of the smoothed projection [m/s]: the smoothing at rest, 0 for an impact."""
    return settings.smoothing * ca.exp(-((contact.rate / settings.fast) ** 2))


def _leaves(rebound: Expr, pull: Expr, left: Expr, reference: Expr, dt: Expr, smoothing: Expr) -> Expr:
    """Return chi: 1 if the rebound is still off the surface when the step ends, 0 if it has fallen back by then."""
    fall = ca.fmax(-pull, reference) * left
    return clip((2 * rebound - fall) / (fall + REBOUND_MARGIN * dt), 0, 1, smoothing)


def _lasts(settings: StepSettings, law: Law, contact: Contact, leaving: Expr, loaded: Expr) -> Expr:
    """Return 1 if the surfaces carried load, are near and do not part. Smoothed contacts hover, up to a height."""
    if law.soft:
        return ca.SX(0)
    dt = settings.scheme.dt
    near = contact.gap < (MAX_REST_GAP * settings.reference * dt + settings.smoothing) * dt
    return ca.logic_and(ca.logic_and(near, loaded), leaving < 0.5)


def _landing(contact: Contact, duration: Expr, time: Expr, target: Expr, free: Expr) -> Expr:
    """Return the delay of an impulse after which the surfaces just touch at the end of the substep.

    What holds a body that lands and stays acts from the touch on, not at it: with all of it at t* the body would end
    below the surface by a (t* - dt) t*/2, which for small gaps is large beside the gap. ``free`` is the normal velocity
    at mid-step without the impulse.
    """
    share = (contact.gap + duration * target) / ca.fmax(target - free, MIN_CLOSING_SPEED)
    return ca.fmin(ca.fmax(share, 0), time)


def _slack(settings: StepSettings, contact: Contact, touch: _FreeTouch, duration: Expr) -> Expr:
    """Return the overlap [m] at the end of the substep that is rounding: that of an impact on its very end.

    Whether such an impact belongs to this substep or to the next is rounding's choice. Either way nothing but the
    impact may act: a constraint that holds the surfaces where they just touch would have half of its slope there.
    Splits are off the impact by the shortest substep at most. What closes slowly meets there if it begins apart and
    is not slower at the end than on average.
    """
    fast, speed = closes_fast(settings, contact), ca.fabs(contact.rate)
    lands = ca.logic_and(touch.hit, ca.logic_and(touch.leaving < 0.5, fast))
    passes = ca.logic_and(ca.logic_or(fast, speed > settings.fast), ca.logic_not(lands))
    meets = ca.logic_and(ca.fabs(contact.end) < TIE_DISTANCE, contact.gap - contact.end > MAX_REST_SPEED * duration)
    return ca.if_else(ca.logic_or(passes, meets), TIE_DISTANCE + 2 * MIN_SUBSTEP_SHARE * settings.scheme.dt * speed, 0)


def _normal_target(contact: Contact, duration: Expr, touch: _FreeTouch, away: Expr, smoothing: Expr) -> Expr:
    """Return the velocity that the normal constraint of a rigid contact asks for at the middle of the step.

    Hit: the rebound carried from t* to the middle, b = max(u + n.f* (dt/2 - t*), 0). Not hit: ``away``, that of the
    free motion less what would close the gap that this leaves at the end.
    """
    carried = positive(touch.rebound + touch.pull * (duration / 2 - touch.time), smoothing)
    return ca.if_else(contact.hit, carried, away)


def _soft_impulse(
    law: Law,
    contact: Contact,
    motions: Motions,
    duration: Expr,
    conditions: SubstepFlags,
    seen: tuple[Expr, Frame, Expr],
) -> SoftImpulse:
    """Return the impulse of a soft contact; ``seen``: its velocity at mid-substep; where and when it begins.

    What lasts from the last step goes on acting in the prediction, but for the contact's own force.
    """
    free, applied, acting = seen
    terms = body_terms(motions, acting, applied, applied)
    inverse_mass, *_ = inverse_masses(terms, applied.normal, *symmetric_mobilities(terms, conditions.same))
    # velocity and acceleration along the normal at the start, with the lasting forces of the last step
    velocity, _, normal = at_touch(contact, motions, ca.SX(0))
    rate = ca.dot(normal, velocity)
    acceleration, arms = (free - rate) * 2 / duration, contact.geometry.frame(ca.SX(0)).arms
    for k, (motion, (force, torque)) in enumerate(zip(motions, conditions.lagging, strict=False)):
        turning = apply(motion.inverse_inertia(ca.SX(0)), torque)
        gained = (1 - 2 * k) * ca.dot(normal, force / motion.mass + ca.cross(turning, arms[k]))
        rate, acceleration = rate + conditions.lag * gained, acceleration + gained
    load = ca.fmax(ca.dot(normal, conditions.force), 0)
    return soft_impulse(
        law,
        SoftApproach(
            active=ca.logic_and(
                ca.logic_or(contact.hit, contact.gap < -MAX_TOUCH_GAP), ca.logic_not(conditions.suppressed)
            ),
            gap=contact.gap,
            rate=rate,
            time=contact.time,
            acceleration=acceleration - inverse_mass * load,
            force=load,
            inverse_mass=inverse_mass,
            duration=duration,
            lag=conditions.lag,
        ),
    )
