"""What the sweeps need to know of a contact, worked out once a step.

Formulas: ARCHITECTURE.md, "The time step". Letters: t* instant of touch, s = dt - t* what is left of the step,
n normal, r arms, v* velocity of approach at t*, f* relative acceleration of the touching points there,
u rebound speed, chi in [0, 1]: 1 where the rebound leaves the step, 0 where it falls back (rest).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.collide.contact import Contact, Frame
from symphys.motion import Motion, apply
from symphys.rotation import cross_matrix
from symphys.smooth import TINY_SQUARE, clip, positive
from symphys.world import Law, Scheme

Expr = Any
"""casadi SX, MX or DM"""

MARGIN = 1e-4
"""Width of chi's rise, as a share of the reference acceleration: a rebound that barely leaves is part rest."""


@dataclass(frozen=True)
class Side:
    """One moving side of a row.

    Attributes:
        body: index.
        sign: +1 for the pair's first body, -1 for the second.
        inverse_mass: [1/kg].
        inverse_inertia: at the row's instant: scalar or (3, 3) [1/(kg m^2)].
        arm: (3,) [m] at the row's instant.
        impulse_arm: (3,) [m] where the impulse is applied.
    """

    body: int
    sign: int
    inverse_mass: Expr
    inverse_inertia: Expr
    arm: Expr
    impulse_arm: Expr


@dataclass(frozen=True)
class ContactRow:
    """A contact as the sweeps see it.

    Attributes:
        law: of the pair.
        contact: where it came from.
        sides: one or two moving sides.
        normal: (3,) at the row's instant; the impulse's normal is ``impulse_normal``.
        impulse_normal: (3,).
        normal_mass, tangent_mass: inverse effective masses k [1/kg]; the scalar tangential one is the largest
            eigenvalue, so that sliding friction stays opposite to the slip.
        spin_mass, roll_mass: the same for torques [1/(kg m^2)].
        softness: gamma [1/kg] of a soft contact, 0 if rigid.
        target: normal velocity at the middle of the step [m/s].
        slip_target: (3,) tangential velocity that friction aims at [m/s].
        leaving: hit chi: the share of the contact that is an impact, in [0, 1].
        width: of the smoothed normal projection [m/s]; 0 for fast approach.
        knob: smoothing [m/s].
    """

    law: Law
    contact: Contact
    sides: tuple[Side, ...]
    normal: Expr
    impulse_normal: Expr
    normal_mass: Expr
    tangent_mass: Expr
    spin_mass: Expr
    roll_mass: Expr
    softness: Expr
    target: Expr
    slip_target: Expr
    leaving: Expr
    width: Expr
    knob: Expr


def prepare(contact: Contact, motions: Sequence[Motion], scheme: Scheme, reference: Expr, knob: Expr) -> ContactRow:
    """The row of one contact; ``reference`` is the acceleration [m/s^2] below which nothing counts as fast."""
    moving = _moving(contact, motions)
    time = contact.time if scheme.time_of_impact else ca.SX(0)
    velocity, acceleration, normal = _at_touch(contact, moving, time)
    pull = ca.dot(normal, acceleration)
    rebound = contact.pair.law.restitution * positive(-ca.dot(normal, velocity), knob)
    leaving = contact.hit * _leaves(rebound, pull, scheme.dt - time, reference, scheme.dt, knob)
    half = scheme.dt / 2
    row_time = half + leaving * (time - half)
    frame, applied = contact.frame(row_time), contact.frame(leaving * time)
    sides = tuple(_side(i, k, m, row_time, frame, applied) for k, i, m in moving)
    normal_mass, tangent_mass, spin_mass, roll_mass = _inverse_masses(sides, frame.normal)
    softness, target = _normal_target(contact, scheme, time, rebound, pull, normal_mass, knob)
    slip = contact.hit * leaving * (half - time) * (acceleration - normal * pull)
    return ContactRow(
        law=contact.pair.law,
        contact=contact,
        sides=sides,
        normal=frame.normal,
        impulse_normal=applied.normal,
        normal_mass=normal_mass,
        tangent_mass=tangent_mass,
        spin_mass=spin_mass,
        roll_mass=roll_mass,
        softness=softness,
        target=target,
        slip_target=slip if scheme.impact_friction else ca.SX.zeros(3),
        leaving=leaving,
        width=knob * ca.exp(-((contact.rate / (2 * reference * scheme.dt)) ** 2)),
        knob=knob,
    )


def _moving(contact: Contact, motions: Sequence[Motion]) -> list[tuple[int, int, Motion]]:
    """(side 0 or 1, body index, motion) of the sides that can move."""
    bodies = (contact.pair.first.body, contact.pair.second.body)
    return [(k, i, motions[i]) for k, i in enumerate(bodies) if i is not None]


def _at_touch(contact: Contact, moving: list[tuple[int, int, Motion]], t: Expr) -> tuple[Expr, Expr, Expr]:
    """Relative velocity and acceleration (without the centripetal part) of the touching points at t*; the normal."""
    frame = contact.frame(t)
    velocity, acceleration = ca.SX.zeros(3), ca.SX.zeros(3)
    for k, _, motion in moving:
        sign, arm, inverse = 1 - 2 * k, frame.arms[k], motion.inverse_inertia(t)
        spin = apply(inverse, motion.momentum_k + t * motion.torque)
        velocity += sign * (motion.velocity + t * motion.acceleration + ca.cross(spin, arm))
        acceleration += sign * (motion.acceleration + ca.cross(apply(inverse, motion.torque), arm))
    return velocity, acceleration, frame.normal


def _leaves(rebound: Expr, pull: Expr, left: Expr, reference: Expr, dt: float, knob: Expr) -> Expr:
    """chi: 1 if the rebound is still off the surface when the step ends, 0 if it has fallen back by then."""
    fall = ca.fmax(-pull, reference) * left
    return clip((2 * rebound - fall) / (fall + MARGIN * dt), 0, 1, knob)


def _side(body: int, k: int, motion: Motion, row_time: Expr, frame: Frame, applied: Frame) -> Side:
    return Side(
        body=body,
        sign=1 - 2 * k,
        inverse_mass=1 / motion.body.mass,
        inverse_inertia=motion.inverse_inertia(row_time),
        arm=frame.arms[k],
        impulse_arm=applied.arms[k],
    )


def _inverse_masses(sides: Sequence[Side], n: Expr) -> tuple[Expr, Expr, Expr, Expr]:
    """k along the normal, across it, and for torques about it and across it."""
    push, twist = ca.SX.zeros(3, 3), ca.SX.zeros(3, 3)
    for side in sides:
        inverse = apply(side.inverse_inertia, ca.SX.eye(3))
        arm = cross_matrix(side.arm)
        push += side.inverse_mass * ca.SX.eye(3) - ca.mtimes(arm, ca.mtimes(inverse, arm))
        twist += inverse
    return along(push, n), across(push, n), along(twist, n), across(twist, n)


def along(k: Expr, n: Expr) -> Expr:
    """n . k n."""
    return ca.dot(n, ca.mtimes(k, n))


def across(k: Expr, n: Expr) -> Expr:
    """The largest eigenvalue of the symmetric (3, 3) ``k`` restricted to the plane across the unit vector n."""
    half_trace = (ca.trace(k) - along(k, n)) / 2
    determinant = ca.dot(n, ca.mtimes(ca.adj(k), n))
    return half_trace + ca.sqrt(ca.fmax(half_trace**2 - determinant, 0) + TINY_SQUARE)


def _normal_target(
    contact: Contact, scheme: Scheme, time: Expr, rebound: Expr, pull: Expr, inverse_mass: Expr, knob: Expr
) -> tuple[Expr, Expr]:
    """(softness, target): the velocity that the normal row asks for at the middle of the step.

    Hit: the rebound carried from t* to the middle, b = max(u + n.f* (dt/2 - t*), 0). Not hit: -gap / dt.
    Soft (Catto, GDC 2011), deviation: the spring acts over what is left of the step, so that a contact that
    begins late in the step begins gently.
    """
    law, dt = contact.pair.law, scheme.dt
    away = -ca.fmax(contact.gap, 0) / dt
    if not law.soft:
        return ca.SX(0), ca.if_else(contact.hit, positive(rebound + pull * (dt / 2 - time), knob), away)
    omega = 2 * ca.pi * law.frequency
    stiffness, damper = omega**2 / inverse_mass, 2 * law.damping * omega / inverse_mass
    left = dt - time
    beta = stiffness / (damper + left * stiffness)
    gamma = 1 / (left * (damper + left * stiffness) + 1e-30)
    return gamma, ca.if_else(contact.hit, -beta * ca.fmin(contact.gap, 0), away)
