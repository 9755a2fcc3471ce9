"""A contact as the sweeps see it, and the geometry that every kind of row needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Frame
from symphys.dynamics.contact import projection as impulse
from symphys.dynamics.contact.local_solver import Coupling
from symphys.dynamics.momentum import Momentum, Rates
from symphys.dynamics.motion import Motion, apply
from symphys.maths.rotation import cross_matrix
from symphys.model.world import Law

Expr = Any
"""casadi SX, MX or DM"""

Moving = tuple[Motion, ...]
"""The motions of the sides that can move: of the first, or of both."""

NEVER = ca.SX(0)
UNREACHED = -1e6
"""[m/s] a normal velocity that no row reaches: it gives no impulse."""


@dataclass(frozen=True)
class Reach:
    """One side of a row on a tree of joints with n coordinates.

    Attributes:
        see, spin: (3, n) velocity of the touching point and angular velocity for unit rates.
        push, twist: (n, 3) what unit impulses at the point, and unit torque impulses, do to the rates.
    """

    see: Expr
    spin: Expr
    push: Expr
    twist: Expr


@dataclass(frozen=True)
class Side:
    """One moving side of a row.

    Attributes:
        sign: +1 for the pair's first body, -1 for the second.
        inverse_mass: [1/kg].
        inverse_inertia: at the row's instant: scalar or (3, 3) [1/(kg m^2)].
        arm: (3,) [m] at the row's instant.
        impulse_arm: (3,) [m] where the impulse is applied.
        reach: if the body is part of a tree of joints.
    """

    sign: int
    inverse_mass: Expr
    inverse_inertia: Expr
    arm: Expr
    impulse_arm: Expr
    reach: Reach | None = None

    def spin(self, m: Any) -> Expr:
        """(3,) [rad/s], from what the sweeps know of the body."""
        if self.reach is not None:
            return m.along(self.reach.spin)
        return apply(self.inverse_inertia, m.angular)

    def speed(self, m: Any) -> Expr:
        """(3,) [m/s] of the touching point."""
        if self.reach is not None:
            return m.along(self.reach.see)
        return m.velocity + ca.cross(self.spin(m), self.arm)

    def kicked(self, m: Any, linear: Expr, angular: Expr) -> Any:
        """What the sweeps know of the body after impulses on the first side."""
        linear, angular = self.sign * linear, self.sign * angular
        if self.reach is not None:
            return Rates(m.numbers + ca.mtimes(self.reach.push, linear) + ca.mtimes(self.reach.twist, angular))
        return Momentum(
            m.velocity + self.inverse_mass * linear, m.angular + ca.cross(self.impulse_arm, linear) + angular
        )


def kicked(sides: Sequence[Side], momenta: Sequence[Any], linear: Expr, angular: Expr, same: bool) -> tuple[Any, ...]:
    """Both sides after impulses on the first; ``same``: both are of one tree."""
    if not same:
        return tuple(side.kicked(m, linear, angular) for side, m in zip(sides, momenta, strict=True))
    after = momenta[0]
    for side in sides:
        after = side.kicked(after, linear, angular)
    return tuple(after for _ in sides)


def slip(sides: Sequence[Side], momenta: Sequence[Any]) -> Expr:
    """(3,) [m/s]: relative velocity of the touching points."""
    total = ca.SX.zeros(3)
    for side, m in zip(sides, momenta, strict=True):
        total += side.sign * side.speed(m)
    return total


def still(sides: Sequence[Side]) -> tuple[Any, ...]:
    """What sweeps know of sides that do not move."""
    zero = ca.SX.zeros(3)
    return tuple(
        Momentum(zero, zero) if side.reach is None else Rates(ca.SX(side.reach.push.size1(), 1)) for side in sides
    )


def reach_of(motion: Motion, t: Expr, arm: Expr, impulse_arm: Expr) -> Reach | None:
    """The reach of a side at a row's instant."""
    held = motion.held
    if held is None:
        return None
    turning = apply(motion.inverse_inertia(t), held.inertia)
    spin = ca.mtimes(turning, held.see[3:, :])
    see = held.see[:3, :] - ca.mtimes(cross_matrix(arm), spin)
    return Reach(see, spin, held.push + ca.mtimes(held.twist, cross_matrix(impulse_arm)), held.twist)


@dataclass(frozen=True)
class ContactRow:
    """A contact as the sweeps see it.

    Attributes:
        law: of the pair.
        sides: one or two moving sides.
        normal: (3,) at the row's instant; the impulse's normal is ``impulse_normal``.
        impulse_normal: (3,).
        answer: (3,) velocity of the touching points against each other for a unit normal impulse [1/kg].
        yields: 1 if such an impulse parts them, else 0: the contact gives none then.
        normal_mass, tangent_mass: effective masses [kg], 1 / (k + gamma) and 1 / k; across the normal k is the
            largest eigenvalue, one number, so that sliding friction stays opposite to the slip.
        spin_mass, roll_mass: the same for torques [kg m^2].
        softness: gamma [1/kg] of a soft contact, 0 if rigid.
        target: normal velocity at the middle of the step [m/s].
        slip_target: (3,) tangential velocity that friction aims at [m/s].
        delay: [s] the impulse acts on positions from then on; 0 for a contact that is not hit.
        leaving: hit chi: the share of the contact that is an impact, in [0, 1].
        lasts: 1 if the contact carried load and goes on.
        load: the least normal impulse that counts as load [N s].
        slack: overlap at the end of the stretch that counts as rounding [m].
        struck: 1 if the surfaces meet at speed, else 0.
        width: of the smoothed normal projection [m/s]; 0 for fast approach.
        knob: smoothing [m/s].
        same: whether both sides are of one tree of joints.
        coupling: where friction may act strongly on the normal velocity.
        paradox: 1 if the friction of the free slip would pull the surfaces together.
    """

    law: Law
    sides: tuple[Side, ...]
    normal: Expr
    impulse_normal: Expr
    answer: Expr
    yields: Expr
    normal_mass: Expr
    tangent_mass: Expr
    spin_mass: Expr
    roll_mass: Expr
    softness: Expr
    target: Expr
    slip_target: Expr
    delay: Expr
    leaving: Expr
    lasts: Expr
    load: Expr
    slack: Expr
    struck: Expr
    width: Expr
    knob: Expr
    same: bool
    coupling: Coupling | None = None
    paradox: Expr = NEVER

    def slip(self, momenta: tuple[Any, ...]) -> Expr:
        """(3,) [m/s]: relative velocity of the touching points."""
        return slip(self.sides, momenta)

    def kicked(self, momenta: tuple[Any, ...], linear: Expr, angular: Expr) -> tuple[Any, ...]:
        """The momenta of the row's bodies after impulses on the first side."""
        return kicked(self.sides, momenta, linear, angular, self.same)

    def visit(self, momenta: tuple[Any, ...], old: impulse.Impulse) -> tuple[tuple[Any, ...], impulse.Impulse]:
        """See ``pgs.Solvable``."""
        return impulse.visit(self, momenta, old)

    def given(self, momenta: tuple[Any, ...], given: impulse.Impulse) -> tuple[Any, ...]:
        """See ``pgs.Solvable``."""
        return impulse.give(self, momenta, given)


def at_touch(contact: Contact, motions: Moving, t: Expr) -> tuple[Expr, Expr, Expr]:
    """Relative velocity and acceleration (without the centripetal part) of the touching points at t*; the normal."""
    frame = contact.meeting.frame(t)
    velocity, acceleration = ca.SX.zeros(3), ca.SX.zeros(3)
    for k, motion in enumerate(motions):
        sign, arm, inverse = 1 - 2 * k, frame.arms[k], motion.inverse_inertia(t)
        spin = apply(inverse, motion.momentum_k + t * motion.torque)
        velocity += sign * (motion.velocity + t * motion.acceleration + ca.cross(spin, arm))
        acceleration += sign * (motion.acceleration + ca.cross(apply(inverse, motion.torque), arm))
    return velocity, acceleration, frame.normal


def make_sides(motions: Moving, row_time: Expr, frame: Frame, applied: Frame) -> tuple[Side, ...]:
    """The sides of a row that is evaluated at ``row_time`` in ``frame`` and whose impulse acts in ``applied``."""
    return tuple(
        Side(
            sign=1 - 2 * k,
            inverse_mass=1 / motion.mass,
            inverse_inertia=motion.inverse_inertia(row_time),
            arm=frame.arms[k],
            impulse_arm=applied.arms[k],
            reach=reach_of(motion, row_time, frame.arms[k], applied.arms[k]),
        )
        for k, motion in enumerate(motions)
    )


def free_slip(sides: Sequence[Side], motions: Moving) -> Expr:
    """(3,) [m/s]: relative velocity of the touching points at mid-step, before any impulse."""
    total = ca.SX.zeros(3)
    for side, motion in zip(sides, motions, strict=True):
        spin = apply(side.inverse_inertia, motion.mid_momentum)
        total += side.sign * (motion.mid_velocity + ca.cross(spin, side.arm))
    return total
