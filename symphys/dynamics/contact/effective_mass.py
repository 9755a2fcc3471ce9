"""Effective masses of a contact: mobilities, their inverses, and the largest eigenvalue across the normal."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.contact.body_term import BodyTerm, apply_impulse, slip, still
from symphys.dynamics.motion import apply
from symphys.maths.rotation import cross_matrix
from symphys.maths.smoothing import TINY_SQUARE
from symphys.types import Expr

LOCKED_MOBILITY_SHARE = 1e-9
"""Share of a body's own mobility that it keeps in directions in which joints do not let it move.

Impulses act at another instant than that at which velocities are asked for: a rod on a hinge that passes the upright
between the two has a mobility below 0 along it.
"""

MIN_POINT_MOBILITY = 0.5
"""Least mobility of free bodies at a point, as a share of the sum of their inverse masses, which bounds it by 1."""
MIN_TURN_MOBILITY = 1e-6
"""Least mobility of free bodies against torques, as a share of the trace of their inverse inertia."""


def mobilities(terms: Sequence[BodyTerm], same: bool) -> tuple[Expr, Expr]:
    """Return the relative velocity (3, 3) for unit impulses at the point, the spin (3, 3) for unit torque impulses."""
    push, twist = ca.SX.zeros(3, 3), ca.SX.zeros(3, 3)
    for i, term in enumerate(terms):
        inverse = apply(term.inverse_inertia, ca.SX.eye(3))
        if term.jacobian is None:
            arm = cross_matrix(term.arm)
            push += term.inverse_mass * ca.SX.eye(3) - ca.mtimes(arm, ca.mtimes(inverse, arm))
            twist += inverse
            continue
        push += LOCKED_MOBILITY_SHARE * term.inverse_mass * ca.SX.eye(3)
        twist += LOCKED_MOBILITY_SHARE * inverse
        for j, other in enumerate(terms):
            if other.jacobian is not None and (same or i == j):
                sign = term.sign * other.sign
                push += sign * apply(term.jacobian.linear, other.jacobian.impulse_response)
                twist += sign * apply(term.jacobian.angular, other.jacobian.torque_response)
    return push, twist


def delassus_column(terms: Sequence[BodyTerm], n: Expr, same: bool) -> Expr:
    """Return the velocity of the touching points against each other for a unit impulse along n (3,) [1/kg]."""
    return slip(terms, apply_impulse(terms, still(terms), n, ca.SX.zeros(3), same))


def separates(terms: Sequence[BodyTerm], n: Expr, column: Expr) -> Expr:
    """Return 1 if an impulse parts the surfaces: on trees it may pull if joints turn far between the two instants.

    Sweeps would answer each pull by a stronger one: a shin that was struck, at 90 rad/s at 10 ms a step, sent its robot
    to 1e19 m/s within a step.
    """
    if all(term.jacobian is None for term in terms):
        return ca.SX(1)
    return ca.dot(n, column) > LOCKED_MOBILITY_SHARE * sum(term.inverse_mass for term in terms)


def no_less_than_response(terms: Sequence[BodyTerm], n: Expr, column: Expr, normal: Expr) -> Expr:
    """Return k along the normal, on trees at least half of the response: with less, sweeps overshoot."""
    if all(term.jacobian is None for term in terms):
        return normal
    least = ca.dot(n, column) / 2
    return ca.if_else(normal < least, least, normal)


def symmetric_mobilities(terms: Sequence[BodyTerm], same: bool) -> tuple[Expr, Expr]:
    """Return ``mobilities``, on trees their symmetric parts."""
    push, twist = mobilities(terms, same)
    if all(term.jacobian is None for term in terms):
        return push, twist
    return (push + push.T) / 2, (twist + twist.T) / 2


def inverse_masses(terms: Sequence[BodyTerm], n: Expr, push: Expr, twist: Expr) -> tuple[Expr, Expr, Expr, Expr]:
    """Return k along the normal, across it, and for torques about it and across it; from ``symmetric_mobilities``.

    On free bodies at least shares of what their masses and moments of inertia give: the inverse inertia at an instant
    of the step is extrapolated, which at a spin of about a radian a step need not leave it positive definite.
    """
    jointed = any(term.jacobian is not None for term in terms)
    least = (LOCKED_MOBILITY_SHARE if jointed else MIN_POINT_MOBILITY) * sum(term.inverse_mass for term in terms)
    slow = (LOCKED_MOBILITY_SHARE if jointed else MIN_TURN_MOBILITY) * sum(
        _trace(term.inverse_inertia) for term in terms
    )
    found = along(push, n), across(push, n), along(twist, n), across(twist, n)
    floors = least, least, slow, slow
    return tuple(ca.if_else(k < floor, floor, k) for k, floor in zip(found, floors, strict=True))


def _trace(inverse_inertia: Expr) -> Expr:
    return ca.trace(apply(inverse_inertia, ca.SX.eye(3)))


def effective_masses(normal: Expr, tangent: Expr, spin: Expr, roll: Expr, separates: Expr = 1) -> dict[str, Expr]:
    """Return the fields of a constraint from the inverse effective masses k, inverted once, not in each sweep.

    A contact that does not separate its surfaces has none, so that no sweep answers to it.
    """
    return {
        "normal_mass": separates / normal,
        "tangent_mass": separates / tangent,
        "spin_mass": 1 / spin,
        "roll_mass": 1 / roll,
    }


def along(k: Expr, n: Expr) -> Expr:
    """Return n . k n."""
    return ca.dot(n, ca.mtimes(k, n))


def across(k: Expr, n: Expr) -> Expr:
    """Return the largest eigenvalue of the symmetric (3, 3) ``k`` restricted to the plane across the unit vector n."""
    half_trace = (ca.trace(k) - along(k, n)) / 2
    determinant = ca.dot(n, ca.mtimes(ca.adj(k), n))
    return half_trace + ca.sqrt(ca.fmax(half_trace**2 - determinant, 0) + TINY_SQUARE)
