"""The term of a body in a constraint: effective mass, lever arms, Jacobian on a kinematic tree."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Frame
from symphys.dynamics.motion import PredictedMotion, apply
from symphys.dynamics.unknowns import GeneralizedVelocities, Momentum
from symphys.maths.rotation import cross_matrix
from symphys.records import dataclass
from symphys.types import Expr

Motions = tuple[PredictedMotion, ...]
"""The motions of the bodies that a constraint acts on: of the first, or of both."""


@dataclass(frozen=True)
class PointJacobian:
    """The Jacobian of a point on a body of a kinematic tree with n coordinates.

    Attributes:
        linear, angular: (3, n) velocity of the point and angular velocity for unit generalized velocities.
        impulse_response, torque_response: (n, 3) changes of the generalized velocities by unit impulses at the point,
            and by unit torque impulses.
    """

    linear: Expr
    angular: Expr
    impulse_response: Expr
    torque_response: Expr


@dataclass(frozen=True)
class BodyTerm:
    """A body that a constraint acts on.

    Attributes:
        sign: +1 for the pair's first body, -1 for the second.
        inverse_mass: [1/kg].
        inverse_inertia: at the constraint's instant: scalar or (3, 3) [1/(kg m^2)].
        arm: (3,) [m] at the constraint's instant.
        impulse_arm: (3,) [m] where the impulse is applied.
        jacobian: if the body is part of a tree of joints.
    """

    sign: int
    inverse_mass: Expr
    inverse_inertia: Expr
    arm: Expr
    impulse_arm: Expr
    jacobian: PointJacobian | None = None

    def spin(self, m: Any) -> Expr:
        """Return the angular velocity (3,) [rad/s] from the velocities."""
        if self.jacobian is not None:
            return m.along(self.jacobian.angular)
        return apply(self.inverse_inertia, m.angular)

    def speed(self, m: Any) -> Expr:
        """Return the velocity (3,) [m/s] of the touching point."""
        if self.jacobian is not None:
            return m.along(self.jacobian.linear)
        return m.velocity + ca.cross(self.spin(m), self.arm)

    def apply(self, m: Any, linear: Expr, angular: Expr) -> Any:
        """Return the velocities of the body after impulses on the constraint's first body."""
        linear, angular = self.sign * linear, self.sign * angular
        if self.jacobian is not None:
            return GeneralizedVelocities(
                m.numbers
                + ca.mtimes(self.jacobian.impulse_response, linear)
                + ca.mtimes(self.jacobian.torque_response, angular)
            )
        return Momentum(
            m.velocity + self.inverse_mass * linear, m.angular + ca.cross(self.impulse_arm, linear) + angular
        )


def apply_impulse(
    terms: Sequence[BodyTerm], momenta: Sequence[Any], linear: Expr, angular: Expr, same: bool
) -> tuple[Any, ...]:
    """Return both bodies after impulses on the first; ``same``: both are of one tree."""
    if not same:
        return tuple(term.apply(m, linear, angular) for term, m in zip(terms, momenta, strict=True))
    after = momenta[0]
    for term in terms:
        after = term.apply(after, linear, angular)
    return tuple(after for _ in terms)


def slip(terms: Sequence[BodyTerm], momenta: Sequence[Any]) -> Expr:
    """Return the relative velocity of the touching points (3,) [m/s]."""
    total = ca.SX.zeros(3)
    for term, m in zip(terms, momenta, strict=True):
        total += term.sign * term.speed(m)
    return total


def still(terms: Sequence[BodyTerm]) -> tuple[Any, ...]:
    """Return velocities of bodies at rest."""
    zero = ca.SX.zeros(3)
    return tuple(
        Momentum(zero, zero)
        if term.jacobian is None
        else GeneralizedVelocities(ca.SX(term.jacobian.impulse_response.size1(), 1))
        for term in terms
    )


def point_jacobian(motion: PredictedMotion, t: Expr, arm: Expr, impulse_arm: Expr) -> PointJacobian | None:
    """Return the Jacobian of a term at a constraint's instant."""
    jacobian = motion.jacobian
    if jacobian is None:
        return None
    turning = apply(motion.inverse_inertia(t), jacobian.inertia)
    spin = ca.mtimes(turning, jacobian.matrix[3:, :])
    see = jacobian.matrix[:3, :] - ca.mtimes(cross_matrix(arm), spin)
    return PointJacobian(
        see,
        spin,
        jacobian.impulse_response + ca.mtimes(jacobian.torque_response, cross_matrix(impulse_arm)),
        jacobian.torque_response,
    )


def at_touch(contact: Contact, motions: Motions, t: Expr) -> tuple[Expr, Expr, Expr]:
    """Return relative velocity and acceleration (without the centripetal part) of the touching points at t*.

    The normal.
    """
    frame = contact.geometry.frame(t)
    velocity, acceleration = ca.SX.zeros(3), ca.SX.zeros(3)
    for k, motion in enumerate(motions):
        sign, arm, inverse = 1 - 2 * k, frame.arms[k], motion.inverse_inertia(t)
        spin = apply(inverse, motion.momentum_k + t * motion.torque)
        velocity += sign * (motion.velocity + t * motion.acceleration + ca.cross(spin, arm))
        acceleration += sign * (motion.acceleration + ca.cross(apply(inverse, motion.torque), arm))
    return velocity, acceleration, frame.normal


def body_terms(motions: Motions, instant: Expr, frame: Frame, applied: Frame) -> tuple[BodyTerm, ...]:
    """Return the terms of a constraint evaluated at ``instant`` in ``frame``, whose impulse acts in ``applied``."""
    return tuple(
        BodyTerm(
            sign=1 - 2 * k,
            inverse_mass=1 / motion.mass,
            inverse_inertia=motion.inverse_inertia(instant),
            arm=frame.arms[k],
            impulse_arm=applied.arms[k],
            jacobian=point_jacobian(motion, instant, frame.arms[k], applied.arms[k]),
        )
        for k, motion in enumerate(motions)
    )


def free_slip(terms: Sequence[BodyTerm], motions: Motions) -> Expr:
    """Return the relative velocity of the touching points at mid-step (3,) [m/s], before any impulse."""
    total = ca.SX.zeros(3)
    for term, motion in zip(terms, motions, strict=True):
        spin = apply(term.inverse_inertia, motion.mid_momentum)
        total += term.sign * (motion.mid_velocity + ca.cross(spin, term.arm))
    return total
