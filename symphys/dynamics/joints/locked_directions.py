"""The constraint of what a joint locks: all of its directions at once, by the inverse of their effective mass."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.factorisation import factorise
from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.joints.joint_impulse import NO_DIRECTIONS, Directions, JointImpulse, apply_impulse, speeds
from symphys.dynamics.unknowns import COMPLIANCE, Linearisation
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class LastingForce:
    """The forces (n,) impulse / kick + slope u + constant of springs and dampers at the end of a substep.

    They follow from the impulses and the velocities u (n,) after the sweeps.
    """

    kick: Expr
    slope: Expr
    constant: Expr


@dataclass(frozen=True)
class LockConstraint:
    """The locked directions of a joint, prepared for the sweeps.

    Attributes:
        terms: arms at the constraint's instant, and to the common point for impulses.
        velocity_directions, impulse_directions: directions at the constraint's instant, and of impulses.
        mass: (n, n) inverse of mobility and softness.
        softness: (n,) gamma of a joint that is soft, 0 if rigid.
        target: (n,) velocities that the constraint asks for [m/s], [rad/s].
        error: (n,) [m], [rad] at the start of the substep.
        axes: (3, 3) of the first frame at the start. Forces on a point are stored along these, so that they turn with
            the body: a rod's pull stays along the rod.
        same: whether both bodies are of one tree of joints.
        lasting: of a joint that is soft: the force that goes on acting at the end of the substep.
    """

    terms: tuple[BodyTerm, ...]
    velocity_directions: Directions
    impulse_directions: Directions
    mass: Expr
    softness: Expr
    target: Expr
    error: Expr
    axes: Expr
    same: bool
    lasting: LastingForce | None = None

    def position_impulse(self, moved: Expr) -> Expr:
        """Return impulses times a time (n,) that close what is left open after displacements along the directions."""
        return -ca.mtimes(self.mass, self.error + moved)

    def at_end(self, momenta: tuple[Any, ...], impulse: JointImpulse) -> JointImpulse:
        """Return the force of a soft joint at the end of the substep, from momenta and impulse after the sweeps."""
        assert self.lasting is not None
        moving = self.lasting.slope * speeds(self.terms, self.velocity_directions, momenta)
        return JointImpulse(impulse.numbers / self.lasting.kick + moving + self.lasting.constant)

    def stored_form(self, impulse: JointImpulse) -> Expr:
        """Return the stored form (n,) of an impulse or of a force."""
        if self.impulse_directions.slides is not None:
            return impulse.numbers
        return ca.vertcat(ca.mtimes(self.axes.T, impulse.numbers[:3, 0]), impulse.numbers[3:, 0])

    def from_stored(self, stored: Expr) -> JointImpulse:
        """Return the impulse that has this stored form."""
        return JointImpulse(stored if self.impulse_directions.slides is not None else in_world(self.axes, stored))

    def project(self, momenta: tuple[Any, ...], old: JointImpulse) -> tuple[tuple[Any, ...], JointImpulse]:
        """Implement ``VelocityConstraint.project``."""
        change = self._change(self.rates(momenta), old)
        return self.apply(momenta, change), old.plus(change)

    def _change(self, rates: Expr, old: JointImpulse) -> JointImpulse:
        return JointImpulse(-ca.mtimes(self.mass, rates - self.target + self.softness * old.numbers))

    def rates(self, momenta: tuple[Any, ...]) -> Expr:
        """Return the velocities along the directions (n,)."""
        return speeds(self.terms, self.velocity_directions, momenta)

    seen = rates

    def alone(self) -> LockConstraint:
        """Implement ``VelocityConstraint.alone``."""
        law = replace(self, terms=(), velocity_directions=NO_DIRECTIONS, impulse_directions=NO_DIRECTIONS)
        return replace(law, error=ca.SX(0), axes=ca.SX(0), lasting=None)

    def response(self, seen: Expr, old: JointImpulse) -> JointImpulse:
        """Implement ``ImpulseLaw.response``."""
        return old.plus(self._change(seen, old))

    def linearised(self, seen: Expr, old: JointImpulse, by: Linearisation) -> tuple[Expr, Expr]:
        """Implement ``ImpulseLaw.linearised``: a (n,) and B (n, n)."""
        soft = COMPLIANCE / ca.diag(self.mass)
        miss = seen - self.target + (self.softness + by.centre * soft) * old.numbers
        stiff = ca.diag(1 / (self.softness + soft))
        return -ca.mtimes(stiff, miss), stiff

    def apply(self, momenta: tuple[Any, ...], impulse: JointImpulse) -> tuple[Any, ...]:
        """Implement ``VelocityConstraint.apply``."""
        return apply_impulse(self.terms, self.impulse_directions, momenta, impulse.numbers, self.same)


def in_world(axes: Expr, stored: Expr) -> Expr:
    """Return numbers (n,) whose first three, given along axes (3, 3), are along the world's axes."""
    return ca.vertcat(ca.mtimes(axes, stored[:3, 0]), stored[3:, 0])


def inverse(k: Expr) -> Expr:
    """Return the inverse (n, n) of a mobility, which is not symmetric where arms of impulses and velocities differ."""
    n = k.size1()
    matrix = factorise([{j: k[i, j] for j in range(n)} for i in range(n)])
    columns = (matrix.solve({j: ca.SX(1)}) for j in range(n))
    return ca.horzcat(*(ca.vertcat(*(column[i] for i in range(n))) for column in columns))
