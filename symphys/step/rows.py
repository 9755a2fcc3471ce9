"""What the sweeps need to know of a contact over a stretch of time, worked out once.

Formulas: ARCHITECTURE.md, "The time step". Letters: t* instant of touch, s = dt - t* what is left of the step,
n normal, r arms, v* velocity of approach at t*, f* relative acceleration of the touching points there,
u rebound speed, chi in [0, 1]: 1 where the rebound leaves the step, 0 where it falls back (rest).
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.collide.contact import Contact
from symphys.collide.touch import TINY_RATE
from symphys.smooth import clip, positive
from symphys.step.masses import answer_of, effective_masses, inverse_masses
from symphys.step.row import UNREACHED, ContactRow, Moving, at_touch, free_slip, make_sides
from symphys.step.scene import Setting
from symphys.world import Law

Expr = Any
"""casadi SX, MX or DM"""

MARGIN = 1e-4
"""Width of chi's rise, as a share of the reference acceleration: a rebound that barely leaves is part rest."""


NEAR = 0.1
"""Of the distance a_ref dt^2: surfaces that carried load and are that near to each other go on touching."""
LOADED = 1e-3
"""Of the weight of the effective mass: what counts as load. A smooth contact always carries a little."""


def prepare(
    setting: Setting, law: Law, contact: Contact, motions: Moving, duration: Expr, spared: Expr, force: Expr, same: bool
) -> ContactRow:
    """The row of one contact over a stretch of time.

    Args:
        setting: what holds over the step.
        law: of the pair.
        contact: along the free motion.
        motions: of the sides that can move.
        duration: of the stretch [s].
        spared: 1 for a contact that gives no impulse.
        force: (3,) with which the contact acted at the end of the last step [N].
        same: whether both sides are of one tree of joints.
    """
    scheme, knob = setting.scheme, setting.knob
    time = contact.time if scheme.time_of_impact else ca.SX(0)
    velocity, acceleration, normal = at_touch(contact, motions, time)
    pull = ca.dot(normal, acceleration)
    rebound = law.restitution * positive(-ca.dot(normal, velocity), knob)
    hit = ca.if_else(spared, 0, contact.hit)  # at the end of a stretch rounding decides whether a spared one meets
    leaving = hit * _leaves(rebound, pull, duration - time, setting.reference, scheme.dt, knob)
    half = duration / 2
    row_time = half + leaving * (time - half)
    frame, applied = contact.meeting.frame(row_time), contact.meeting.frame(leaving * time)
    sides = make_sides(motions, row_time, frame, applied)
    k_normal, *k_others = inverse_masses(sides, frame.normal, same)
    softness, target = _normal_target(law, contact, duration, time, rebound, pull, k_normal, knob)
    landing = _landing(contact, duration, time, target, ca.dot(frame.normal, free_slip(sides, motions)))
    quick = contact.rate < -setting.fast
    weight = LOADED * setting.reference / k_normal
    load, width = ca.dot(applied.normal, force), width_of(setting, contact)
    lasts = _lasts(setting, law, contact, leaving, load > weight)
    # on the central path a load keeps surfaces parting at w^2 / (4 k load): less that, what lasts is at rest
    parting = width**2 / (4 * k_normal * ca.fmax(load, weight) * duration)
    target = ca.if_else(lasts, -parting, target)
    delay = hit * (time + (1 - leaving) * (landing - time))
    if any(side.reach is not None for side in sides):  # of a tree: see ARCHITECTURE, "Feet that stand"
        delay = ca.if_else(lasts, half, delay)
    slip = hit * leaving * (half - time) * (acceleration - normal * pull)
    return ContactRow(
        law=law,
        sides=sides,
        normal=frame.normal,
        impulse_normal=applied.normal,
        answer=answer_of(sides, applied.normal, same),
        **effective_masses(k_normal + softness, *k_others),
        softness=softness,
        target=ca.if_else(spared, UNREACHED, target),
        slip_target=slip if scheme.impact_friction else ca.SX.zeros(3),
        delay=delay if scheme.time_of_impact else ca.SX(0),
        leaving=leaving,
        lasts=lasts,
        load=weight * duration,
        struck=ca.SX(0) if law.soft else ca.logic_and(hit, quick),
        width=width,
        knob=knob,
        same=same,
    )


def width_of(setting: Setting, contact: Contact) -> Expr:
    """Of the smoothed projection [m/s]: the knob at rest, nothing for an impact."""
    return setting.knob * ca.exp(-((contact.rate / setting.fast) ** 2))


def _leaves(rebound: Expr, pull: Expr, left: Expr, reference: Expr, dt: float, knob: Expr) -> Expr:
    """chi: 1 if the rebound is still off the surface when the step ends, 0 if it has fallen back by then."""
    fall = ca.fmax(-pull, reference) * left
    return clip((2 * rebound - fall) / (fall + MARGIN * dt), 0, 1, knob)


def _lasts(setting: Setting, law: Law, contact: Contact, leaving: Expr, loaded: Expr) -> Expr:
    """1 if the surfaces carried load, are near each other and do not part. Smoothed contacts hover, up to a height."""
    if law.soft:
        return ca.SX(0)
    dt = setting.scheme.dt
    near = contact.gap < (NEAR * setting.reference * dt + setting.knob) * dt
    return ca.logic_and(ca.logic_and(near, loaded), leaving < 0.5)


def _landing(contact: Contact, duration: Expr, time: Expr, target: Expr, free: Expr) -> Expr:
    """The delay of an impulse after which the surfaces just touch at the end of the stretch.

    What holds a body that lands and stays acts from the touch on, not at it: with all of it at t* the body would end
    below the surface by a (t* - dt) t*/2, which for small gaps is large beside the gap. ``free`` is the normal velocity
    at mid-step without the impulse.
    """
    share = (contact.gap + duration * target) / ca.fmax(target - free, TINY_RATE)
    return ca.fmin(ca.fmax(share, 0), time)


def _normal_target(
    law: Law, contact: Contact, duration: Expr, time: Expr, rebound: Expr, pull: Expr, inverse_mass: Expr, knob: Expr
) -> tuple[Expr, Expr]:
    """(softness, target): the velocity that the normal row asks for at the middle of the step.

    Hit: the rebound carried from t* to the middle, b = max(u + n.f* (dt/2 - t*), 0). Not hit: -gap / dt.
    Soft (Catto, GDC 2011), deviation: the spring acts over what is left of the step, so that a contact that
    begins late in the step begins gently.
    """
    away = -ca.fmax(contact.gap, 0) / duration
    if not law.soft:
        return ca.SX(0), ca.if_else(contact.hit, positive(rebound + pull * (duration / 2 - time), knob), away)
    omega = 2 * ca.pi * law.frequency
    stiffness, damper = omega**2 / inverse_mass, 2 * law.damping * omega / inverse_mass
    left = duration - time
    beta = stiffness / (damper + left * stiffness)
    gamma = 1 / (left * (damper + left * stiffness) + 1e-30)
    return gamma, ca.if_else(contact.hit, -beta * ca.fmin(contact.gap, 0), away)
