"""The contact constraint: the projection of its impulse onto the law of contact.

A projection takes the normal impulse, then the friction impulse (docs/time_step.md, section 5). At the tip of a rod
friction changes the normal velocity more than the normal impulse does: mu W_nt > W_nn, with W the velocity of the
touching points for unit impulses. Projections of the two impulses in turn then cycle. There both are found at once:
the impulse that stops the slip if it lies in the cone of friction, else one on its edge,
r = l (n + mu d), whose direction d is opposite to the slip that is left. (Acary and Brogliato, Numerical methods for
nonsmooth dynamical systems, 2008, section 13.7, have such local solvers; the search for d by one step of projection and
one of Newton's method in each projection is our own.) Where friction of this direction would pull the surfaces together
(Painleve's paradox) no sliding impulse may exist, and sticking is preferred where it can be. A contact that opens
without an impulse gives none.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.contact import body_term
from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.contact.coupling import Coupling
from symphys.dynamics.contact.friction import Disc, Friction, FrictionStep
from symphys.dynamics.contact.soft import SoftImpulse
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import Linearisation
from symphys.maths.smoothing import positive, positive_slope
from symphys.model.world import Law
from symphys.records import dataclass
from symphys.types import Expr

NEVER, ALWAYS = ca.SX(0), ca.SX(1)
INACTIVE_NORMAL_SPEED = -1e6
"""[m/s] a normal velocity that no constraint reaches: it gives no impulse."""
MIN_SLIDING_SHARE = 0.01
"""Least effective inverse mass of a sliding contact, as a share of W_nn."""
MIN_HEADING_SLOPE = 1e-12
"""[m/s] below which the slope of the search for a direction says nothing."""
MAX_ANGLE_STEP = 0.5
"""[rad] longest step of that search."""


@dataclass(frozen=True)
class ContactImpulse:
    """The accumulated impulse of a contact on the pair's first body, world frame.

    Attributes:
        normal: along the normal [N s], >= 0.
        tangent: (3,) friction [N s].
        spin: torque impulse about the normal [N m s].
        roll: (3,) torque impulse across the normal [N m s].
    """

    normal: Expr
    tangent: Expr
    spin: Expr
    roll: Expr

    @property
    def count(self) -> int:
        """Return the number of components of load and friction."""
        return 4

    @property
    def numbers(self) -> Expr:
        """Return load and friction (4,)."""
        return ca.vertcat(self.normal, self.tangent)

    def like(self, numbers: Expr) -> ContactImpulse:
        """Return an impulse with these numbers: load and friction (4,)."""
        return ContactImpulse(numbers[0], numbers[1:4], ca.SX(0), ca.SX.zeros(3))

    def linear(self, n: Expr) -> Expr:
        """Return the linear impulse (3,) [N s]."""
        return n * self.normal + self.tangent

    def angular(self, n: Expr) -> Expr:
        """Return the torque impulse beside that of the linear one (3,) [N m s]."""
        return n * self.spin + self.roll

    def plus(self, other: ContactImpulse) -> ContactImpulse:
        """Return the sum."""
        return ContactImpulse(
            self.normal + other.normal, self.tangent + other.tangent, self.spin + other.spin, self.roll + other.roll
        )

    def times(self, factor: Expr) -> ContactImpulse:
        """Return the impulse times a factor."""
        return ContactImpulse(factor * self.normal, factor * self.tangent, factor * self.spin, factor * self.roll)

    def minus(self, other: ContactImpulse) -> ContactImpulse:
        """Return the difference."""
        return ContactImpulse(
            self.normal - other.normal, self.tangent - other.tangent, self.spin - other.spin, self.roll - other.roll
        )


ZERO_IMPULSE = ContactImpulse(ca.SX(0), ca.SX.zeros(3), ca.SX(0), ca.SX.zeros(3))


@dataclass(frozen=True)
class Precomputed:
    """Terms of the projections that are computed once, before the sweeps.

    Attributes:
        normal_target: normal impulse for the velocity that is aimed at [N s].
        tangent_target: (3,) the same of friction [N s].
        friction_coupling: (3,) friction that a unit of normal impulse takes off, by the slip that it makes.
    """

    normal_target: Expr
    tangent_target: Expr
    friction_coupling: Expr


@dataclass(frozen=True)
class ContactConstraint:
    """A contact, prepared for the sweeps.

    Attributes:
        law: of the pair.
        friction: its law of friction at this contact.
        terms: one or two bodies.
        normal: (3,) at the constraint's instant; the impulse's normal is ``impulse_normal``.
        impulse_normal: (3,).
        delassus_column: (3,) relative velocity of the touching points for a unit normal impulse [1/kg].
        separates: 1 if such an impulse separates them, else 0: the contact gives none then.
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
        slack: overlap at the end of the substep that counts as rounding [m].
        struck: 1 if the surfaces meet at speed, else 0.
        width: of the smoothed normal projection [m/s]; 0 for fast approach.
        smoothing: s [m/s], see docs/time_step.md.
        same: whether both bodies are of one tree of joints.
        coupling: where friction may act strongly on the normal velocity.
        paradox: 1 if the friction of the free slip would pull the surfaces together.
        near: 0 if the surfaces are too far apart to act: no impulse is given.
        precomputed: where both impulses are found in turn: shortens what a projection waits for.
        soft: of a soft contact.
    """

    law: Law
    friction: Friction
    terms: tuple[BodyTerm, ...]
    normal: Expr
    impulse_normal: Expr
    delassus_column: Expr
    separates: Expr
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
    smoothing: Expr
    same: bool
    coupling: Coupling | None = None
    paradox: Expr = NEVER
    near: Expr = ALWAYS
    precomputed: Precomputed | None = None
    soft: SoftImpulse | None = None

    def slip(self, momenta: tuple[Any, ...]) -> Expr:
        """Return the relative velocity of the touching points (3,) [m/s]."""
        return body_term.slip(self.terms, momenta)

    def apply(self, momenta: tuple[Any, ...], impulse: ContactImpulse) -> tuple[Any, ...]:
        """Return the momenta of the bodies after an impulse."""
        linear, angular = impulse.linear(self.impulse_normal), impulse.angular(self.impulse_normal)
        return body_term.apply_impulse(self.terms, momenta, linear, angular, self.same)

    rates = seen = slip

    def alone(self) -> ContactConstraint:
        """Implement ``VelocityConstraint.alone``."""
        unused = "delay", "leaving", "lasts", "load", "slack", "struck", "paradox", "spin_mass", "roll_mass"
        nothing: dict[str, Any] = dict.fromkeys(unused, NEVER)
        return replace(self, law=Law(), terms=(), soft=None, **nothing)

    def linearised(self, seen: Expr, old: ContactImpulse, by: Linearisation) -> tuple[Expr, Expr]:
        """Implement ``ImpulseLaw.linearised``."""
        return linearised(self, seen, old, by)

    def response(self, seen: Expr, old: ContactImpulse) -> ContactImpulse:
        """Implement ``ImpulseLaw.response``: load and friction; torsion and rolling stay as they are."""
        normal, tangent = (self.near * force for force in _forces(self, seen, old))
        return ContactImpulse(normal, tangent, old.spin, old.roll)

    def project(self, momenta: tuple[Any, ...], old: ContactImpulse) -> tuple[tuple[Any, ...], ContactImpulse]:
        """Project each of its impulses once, one after the other."""
        zero, new = ca.SX.zeros(3), self.response(self.slip(momenta), old)
        change = ContactImpulse(new.normal - old.normal, new.tangent - old.tangent, ca.SX(0), zero)
        momenta = self.apply(momenta, change)
        if not self.law.spins:
            return momenta, new
        spin, roll = (self.near * torque for torque in _torques(self, momenta, old, new.normal))
        momenta = self.apply(momenta, ContactImpulse(ca.SX(0), zero, spin - old.spin, roll - old.roll))
        return momenta, replace(new, spin=spin, roll=roll)


def _forces(contact: ContactConstraint, slip: Expr, old: ContactImpulse) -> tuple[Expr, Expr]:
    """Return the normal impulse and that of friction."""
    if contact.coupling is not None:
        exact = _solve_coupled(contact, contact.coupling, slip, old)
        smoothed = _solve_coupled_smoothed(contact, contact.coupling, slip, old)
        smooth = contact.smoothing > 0
        return ca.if_else(smooth, smoothed[0], exact[0]), ca.if_else(smooth, smoothed[1], exact[1])
    if contact.precomputed is not None:
        return _project_sequentially(contact, contact.precomputed, slip, old)
    normal = _normal(contact, slip, old)
    return normal, _tangent(contact, slip + contact.delassus_column * (normal - old.normal), old, normal)


@traced
def precompute(contact: ContactConstraint) -> Precomputed:
    """Return what a contact's projections need and is known before the sweeps."""
    n, mass = contact.normal, contact.tangent_mass
    friction = (mass * _across(each, n) for each in (contact.slip_target, contact.delassus_column))
    return Precomputed(contact.normal_mass * contact.target, *friction)


def _project_sequentially(
    contact: ContactConstraint, precomputed: Precomputed, slip: Expr, old: ContactImpulse
) -> tuple[Expr, Expr]:
    """Return the normal impulse and that of friction; what is known last, the change of the first, comes in last."""
    n, given = contact.normal, contact.normal_mass * contact.softness * old.normal
    kept = old.normal + precomputed.normal_target - given - contact.normal_mass * ca.dot(n, slip)
    normal = positive(kept, contact.normal_mass * contact.width)
    wanted = old.tangent + precomputed.tangent_target - contact.tangent_mass * _across(slip, n)
    wanted = wanted - precomputed.friction_coupling * (normal - old.normal)
    width = contact.tangent_mass * contact.smoothing
    return normal, contact.friction.nearest(wanted, normal, width, contact.smoothing)


def _normal(contact: ContactConstraint, slip: Expr, old: ContactImpulse) -> Expr:
    """Project the normal impulse: ln <- max(ln - m (n.u - b + gamma ln), 0), m = 1 / (k + gamma)."""
    kept = old.normal + contact.normal_mass * (contact.target - contact.softness * old.normal)
    return positive(kept - contact.normal_mass * ca.dot(contact.normal, slip), contact.normal_mass * contact.width)


def _tangent(contact: ContactConstraint, slip: Expr, old: ContactImpulse, normal: Expr) -> Expr:
    """Return the friction impulse that is nearest to what would stop the slip."""
    kept = old.tangent + contact.tangent_mass * _across(contact.slip_target, contact.normal)
    wanted = kept - contact.tangent_mass * _across(slip, contact.normal)  # what is known last comes in last
    return contact.friction.nearest(wanted, normal, contact.tangent_mass * contact.smoothing, contact.smoothing)


def linearised(contact: ContactConstraint, slip: Expr, old: ContactImpulse, by: Linearisation) -> tuple[Expr, Expr]:
    """Return a (4,) and B (4, 3): load and friction change by a - B du with the slip u.

    Args:
        contact: the contact.
        slip: (3,) u [m/s].
        old: what it has given so far.
        by: what is common to all constraints.
    """
    # load: the slope of its projection by the slip, with compliance (see ``newton_start``)
    mass, width = contact.normal_mass, contact.normal_mass * contact.width
    kept = old.normal + mass * (contact.target - contact.softness * old.normal - ca.dot(contact.normal, slip))
    normal, rise = contact.near * positive(kept, width), contact.near * _slope(kept, width, mass, by)
    gives = 1 - rise + rise * mass * (contact.softness + by.softness)
    press = (normal - old.normal - rise * mass * by.softness * by.centre * old.normal) / gives
    by_slip = rise * mass / gives * contact.normal.T
    # a change of load that its own projection does not make widens the cone of friction
    friction, widens, sliding = _friction(contact, slip, old, normal, by)
    friction += widens * (press - (normal - old.normal))
    sliding += ca.mtimes(widens, by_slip)
    return contact.near * ca.vertcat(press, friction), contact.near * ca.vertcat(by_slip, sliding)


def _slope(x: Expr, width: Expr, mass: Expr, by: Linearisation) -> Expr:
    """Return the slope of ``positive``."""
    return ca.if_else(width > 0, positive_slope(x, width), by.within(x, mass))


def _friction(
    contact: ContactConstraint, slip: Expr, old: ContactImpulse, normal: Expr, by: Linearisation
) -> tuple[Expr, Expr, Expr]:
    """Return a (3,), its slope (3,) by the load and B (3, 3) of friction alone, with the cone of a load ``normal``."""
    n, mass = contact.normal, contact.tangent_mass
    return contact.friction.linearised(
        FrictionStep(
            normal=n,
            old=old.tangent,
            wanted=old.tangent + mass * _across(contact.slip_target - slip, n),
            load=normal,
            mass=mass,
            smoothing=contact.smoothing,
            softness=mass * by.softness,
            centre=by.centre,
            slope=lambda x, width: _slope(x, width, mass, by),
        )
    )


def _torques(
    contact: ContactConstraint, momenta: tuple[Any, ...], old: ContactImpulse, normal: Expr
) -> tuple[Expr, Expr]:
    """Return torsional friction (an interval) and rolling friction (a disc), both limited by the normal impulse."""
    n = contact.normal
    spin_width, roll_width = contact.smoothing * contact.spin_mass, contact.smoothing * contact.roll_mass
    rate = sum(term.sign * term.spin(m) for term, m in zip(contact.terms, momenta, strict=True))
    twist = n * (old.spin - contact.spin_mass * ca.dot(n, rate))
    spin = ca.dot(n, Disc(contact.law.torsion).nearest(twist, normal, spin_width, contact.smoothing))
    wanted = old.roll - contact.roll_mass * _across(rate, n)
    roll = Disc(contact.law.rolling).nearest(wanted, normal, roll_width, contact.smoothing)
    return spin, roll


def _solve_coupled(
    contact: ContactConstraint, coupling: Coupling, slip: Expr, old: ContactImpulse
) -> tuple[Expr, Expr]:
    """Return the normal impulse and the friction impulse (3,) after which the contact obeys its law, all else as it is.

    Args:
        contact: the contact.
        coupling: of it.
        slip: (3,) velocity of the touching points against each other [m/s].
        old: what it has given so far, with which ``slip`` came about.
    """
    n, friction, w = contact.normal, contact.friction, coupling.mobility
    # sticking: the impulse that stops the slip, if it lies in the cone
    given = n * old.normal + old.tangent
    error = slip - n * (contact.target - contact.softness * old.normal) - contact.slip_target
    stopping = given - ca.mtimes(coupling.inverse, error)
    press = ca.dot(n, stopping)
    hold = stopping - n * press
    free = error - ca.mtimes(w, given)
    closes = ca.dot(n, free) < 0
    sticks = ca.logic_and(ca.logic_and(closes, press > 0), friction.admits(hold, press))

    # sliding: a projection, then a Newton step, give the heading of friction on the edge of the cone
    wanted = old.tangent - contact.tangent_mass * _across(error, n)
    heading = _newton_heading(friction.heading(wanted, old.normal), free, w, n, friction)
    load, _ = _sliding_load(heading, free, w, n, friction)
    slides = friction.largest * load * friction.shaped(heading)
    return ca.if_else(sticks, press, load), ca.if_else(sticks, hold, slides)


def _sliding_load(heading: Expr, free: Expr, w: Expr, n: Expr, friction: Friction) -> tuple[Expr, Expr]:
    """Return the normal impulse of a contact that slides against ``heading``, and the velocity (3,) per unit of it."""
    response = ca.mtimes(w, n + friction.largest * friction.shaped(heading))
    least = MIN_SLIDING_SHARE * ca.dot(n, ca.mtimes(w, n))
    return ca.fmax(-ca.dot(n, free), 0) / ca.fmax(ca.dot(n, response), least), response


def _newton_heading(heading: Expr, free: Expr, w: Expr, n: Expr, friction: Friction) -> Expr:
    """Return the heading after a Newton step towards the one that is opposite to the slip, as friction sees it."""
    load, response = _sliding_load(heading, free, w, n, friction)
    # residual: the slip across the heading; slope: its derivative by the angle of the heading
    aside, slip = ca.cross(n, heading), free + load * response
    seen = friction.shaped(aside)
    turning = ca.mtimes(w, seen)
    lost = ca.dot(n, turning) / ca.fmax(ca.dot(n, response), MIN_SLIDING_SHARE * ca.dot(n, ca.mtimes(w, n)))
    slope = friction.largest * load * (ca.dot(seen, turning) - lost * ca.dot(seen, response))
    slope = slope - ca.dot(friction.shaped(heading), slip)
    # a bounded step of the angle
    step = ca.if_else(slope > MIN_HEADING_SLOPE, -ca.dot(seen, slip) / ca.fmax(slope, MIN_HEADING_SLOPE), 0)
    step = ca.fmin(ca.fmax(step, -MAX_ANGLE_STEP), MAX_ANGLE_STEP)
    found = heading + step * aside
    return found / ca.sqrt(1 + step * step)


def _solve_coupled_smoothed(
    contact: ContactConstraint, coupling: Coupling, slip: Expr, old: ContactImpulse
) -> tuple[Expr, Expr]:
    """Solve under the smoothed law: projections in turn, the normal one damped against cycling.

    Its width keeps the central path where it is without the shortening.
    """
    n, mass = contact.normal, coupling.sliding_mass
    wanted = ca.dot(n, slip) - contact.target + contact.softness * old.normal
    normal = positive(old.normal - mass * wanted, ca.sqrt(mass * contact.normal_mass) * contact.width)
    slip = slip + contact.delassus_column * (normal - old.normal)
    wanted = old.tangent - contact.tangent_mass * _across(slip - contact.slip_target, n)
    width = contact.tangent_mass * contact.smoothing
    return normal, contact.friction.nearest(wanted, normal, width, contact.smoothing)


def _across(a: Expr, n: Expr) -> Expr:
    return a - n * ca.dot(n, a)
