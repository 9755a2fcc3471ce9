"""A soft contact over a substep: a spring and damper along the normal that pushes only; see ``oscillator``.

A substep in which the surfaces meet or part is put together from free flight, the exact motion in contact and free
flight again, along the predicted path. The contact then gives all of its impulse in that substep, and nothing lasts:
leapfrog begins anew. Letters as there; f is the force over stiffness, -(e + 2 z / w e') [m].
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.dynamics.collision.time_of_impact import MAX_TOUCH_GAP
from symphys.dynamics.contact.oscillator import MIN_B, response, spring_law
from symphys.maths.smoothing import clip
from symphys.model.world import Law
from symphys.records import dataclass
from symphys.types import Expr

NEWTON_STEPS = 4
"""Newton steps towards the instant at which surfaces part."""
NO_FORCE = 1e-30
"""[m] Force over stiffness that stands for none where it divides."""
MIN_CONTACT_SHARE = 1e-9
"""Shortest contact as a share of a substep, since mean velocities divide by it."""


@dataclass(frozen=True)
class SoftApproach:
    """State of a soft contact along the normal, before its impulse.

    Attributes:
        active: 1 if the surfaces overlap or meet in the substep.
        gap, rate: at its start [m], [m/s].
        time: at which they touch; 0 if they overlap [s].
        acceleration: along the path by all that acts but the contact itself [m/s^2].
        force: with which the contact acted at the end of the last substep [N].
        inverse_mass: [1/kg].
        duration, lag: see ``substep`` [s].
    """

    active: Expr
    gap: Expr
    rate: Expr
    time: Expr
    acceleration: Expr
    force: Expr
    inverse_mass: Expr
    duration: Expr
    lag: Expr


@dataclass(frozen=True)
class SoftImpulse:
    """Coefficients of the impulse of a soft contact in a substep.

    Attributes:
        softness: gamma [1/kg].
        target: the velocity that its projection aims at [m/s].
        lasts: 1 if a force goes on acting.
        kick: [s]; slope, constant: that force is impulse / kick + slope u + constant [N], with u the velocity in the
            middle of the substep.
        late: what surfaces that meet or part have got by the end of the substep beside its impulse [N s].
    """

    softness: Expr
    target: Expr
    lasts: Expr
    kick: Expr
    slope: Expr
    constant: Expr
    late: Expr

    def lasting(self, velocity: Expr, normal: Expr) -> Expr:
        """Return the persistent normal force [N] from the velocity and the normal impulse after the sweeps."""
        force = normal / self.kick + self.slope * velocity + self.constant
        return ca.if_else(normal > 0, self.lasts * ca.fmax(force, 0), 0)


def soft_impulse(law: Law, at: SoftApproach) -> SoftImpulse:
    """Return the law of a soft contact over a substep; where it is not active it does nothing."""
    omega, ratio, d, mass = 2 * ca.pi * law.frequency, law.damping, at.duration, 1 / at.inverse_mass
    lasted = at.force > 0
    before = ca.if_else(lasted, 2 * ca.fmax(at.lag, 0), 0)
    kick, a = (d + before) / 2, at.acceleration
    backward = response(omega, -ratio, before)
    flight = ca.if_else(at.active, at.time, d)
    e = ca.if_else(at.gap < -MAX_TOUCH_GAP, at.gap, 0)
    push = a - omega**2 * e

    # the velocity at the start of the substep, without what the contact gave for the time before it, and with it
    base = at.rate - ca.if_else(lasted, at.lag * (a + at.force * at.inverse_mass), 0)
    start = (base + before * backward.p / 2 * push) / backward.sigma
    meeting = start + a * flight

    # how long the surfaces push
    whole = response(omega, ratio, d - flight)
    touching = _time_in_contact(omega, ratio, whole, meeting, (e, a))
    held = response(omega, ratio, ca.fmax(touching, MIN_CONTACT_SHARE * d))
    meets = ca.logic_and(at.time > 0, e >= 0)
    event = ca.logic_and(at.active, ca.logic_or(meets, touching < whole.time))

    # flight, contact, flight: mean velocity over the substep and velocity at its end
    left, parting = whole.time - touching, held.end_velocity(meeting, push)
    moved = flight * (start + meeting) / 2 + touching * held.mean_velocity(meeting, push)
    mean = (moved + left * (parting + a * left / 2)) / d
    given = mean - base - kick * a
    late = parting + a * left - mean - d / 2 * a

    whole_law = spring_law(held, backward)
    b = ca.if_else(event, ca.fmax(whole_law.b * touching / d, MIN_B), whole_law.b)
    wanted = ca.if_else(event, given + b * mean, -(whole_law.stiff * e + whole_law.c * base))
    lasts = ca.logic_and(at.active, ca.logic_not(event))
    return SoftImpulse(
        softness=at.inverse_mass / b,
        target=wanted / b,
        lasts=lasts,
        kick=kick,
        slope=ca.if_else(lasts, -mass * whole_law.end, 0),
        constant=ca.if_else(lasts, -mass * whole_law.end_before * base, 0),
        late=ca.if_else(event, mass * late, 0),
    )


def _time_in_contact(omega: Expr, ratio: Expr, whole: Any, velocity: Expr, place: tuple[Expr, Expr]) -> Expr:
    """Return how long surfaces at ``velocity`` push, at most the whole time: until f of a cubic along it is 0."""
    (e, a), time, share = place, whole.time, 2 * ratio / omega
    push = a - omega**2 * e
    moved, end = time * whole.mean_velocity(velocity, push), whole.end_velocity(velocity, push)

    def force(e: Expr, v: Expr) -> tuple[Expr, Expr]:
        return -(e + share * v), -time * (v + share * (a - omega**2 * e - 2 * ratio * omega * v))

    (first, rise), (last, fall) = force(e, velocity), force(e + moved, end)
    square, cube = 3 * (last - first) - 2 * rise - fall, rise + fall - 2 * (last - first)
    y, scale = ca.SX(1), ca.fabs(first) + ca.fabs(last) + NO_FORCE
    for _ in range(NEWTON_STEPS):
        value, slope = first + y * (rise + y * (square + y * cube)), rise + y * (2 * square + 3 * y * cube)
        y = clip(y - value / ca.fmin(slope, -1e-6 * scale), 0, 1, 0)
    return ca.if_else(last < 0, y * time, time)
