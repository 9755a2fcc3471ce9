"""Rotations for casadi types (SX, MX, DM): unit quaternions (w, x, y, z) that turn body into world coordinates."""

from __future__ import annotations

from math import factorial

import casadi as ca

from symphys.maths.inlined import inlined
from symphys.maths.smoothing import length
from symphys.types import Expr

SERIES_TERMS = 9
"""Terms of the series of cos and sinc: full double precision up to 2 rad, 1e-12 at half a turn."""
MAX_ANGLE = 1e9
"""[rad] Largest angle from which whole turns are removed; a larger one has no accuracy left."""
UNIT_BAND = 1e-9
"""Largest deviation of a squared length from 1 that counts as rounding."""


def cross_matrix(a: Expr) -> Expr:
    """Return the matrix A (3, 3) with A b = a x b."""
    return ca.skew(a)


@inlined(4, 4)
def multiply(p: Expr, q: Expr) -> Expr:
    """Return the quaternion product p q (4,), which rotates by q first."""
    scalar = p[0] * q[0] - ca.dot(p[1:4], q[1:4])
    return ca.vertcat(scalar, p[0] * q[1:4] + q[0] * p[1:4] + ca.cross(p[1:4], q[1:4]))


@inlined(4)
def matrix(q: Expr) -> Expr:
    """Return the rotation matrix R_wb (3, 3) of a unit quaternion."""
    w, x, y, z = (q[i] for i in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def exponential(r: Expr) -> Expr:
    """Return the quaternion (4,) that rotates by |r| [rad] about ``r``, world frame.

    cos(|r|/2) and sin(|r|/2)/|r| as polynomials in |r|^2, so every derivative is finite at r = 0. Whole turns are taken
    off first: with them the polynomials would not give a rotation. Beyond ``MAX_ANGLE`` no turn is made.
    """
    angle = length(r)
    r = r * ca.if_else(angle < MAX_ANGLE, 1 - 2 * ca.pi * ca.floor(angle / (2 * ca.pi) + 0.5) / angle, 0)
    h2 = ca.dot(r, r) / 4
    cos, sinc = 0.0, 0.0
    for k in reversed(range(SERIES_TERMS)):
        sign = (-1) ** k
        cos = cos * h2 + sign / factorial(2 * k)
        sinc = sinc * h2 + sign / factorial(2 * k + 1)
    return ca.vertcat(cos, sinc * r / 2)


def logarithm(q: Expr) -> Expr:
    """Return the rotation vector (3,) [rad] of a unit quaternion, at most pi long; the inverse of ``exponential``."""
    q = ca.if_else(q[0] < 0, -q, q)
    sine = length(q[1:4])
    return 2 * ca.atan2(sine, q[0]) / sine * q[1:4]


def between(p: Expr, q: Expr) -> Expr:
    """Return the rotation vector (3,) [rad] from orientation ``p`` to ``q``, world frame."""
    return logarithm(multiply(q, ca.vertcat(p[0], -p[1:4])))


def turn(q: Expr, r: Expr) -> Expr:
    """Return orientation ``q`` (4,) rotated by the vector ``r`` [rad], world frame; of length 1 up to rounding."""
    return unit(multiply(exponential(r), q))


def unit(q: Expr) -> Expr:
    """Normalise a quaternion (4,) of almost length 1 by one step of Newton's method."""
    return q * (3 - ca.dot(q, q)) / 2


def normalised(q: Expr) -> Expr:
    """Normalise a quaternion (4,) of any length but 0; within ``UNIT_BAND`` of length 1 it stays as it is."""
    largest = ca.fmax(ca.fmax(ca.fabs(q[0]), ca.fabs(q[1])), ca.fmax(ca.fabs(q[2]), ca.fabs(q[3])))
    scaled = q / largest
    near = ca.fabs(ca.dot(q, q) - 1) <= UNIT_BAND
    return ca.if_else(near, q, scaled / ca.sqrt(ca.dot(scaled, scaled)))


def rotate(q: Expr, a: Expr) -> Expr:
    """Return the body-frame vector ``a`` in world coordinates (3,)."""
    return ca.mtimes(matrix(q), a)
