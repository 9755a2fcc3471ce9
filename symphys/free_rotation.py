"""How a body without torque turns: its angular momentum stays, for any inertia and any angle in a step.

The rotational energy l . J l / 2, with l the angular momentum in the body's frame and J the inverse inertia, is split
into c l . l / 2, a rotation about the constant momentum that commutes with all else, and two terms b (u . l)^2 / 2,
each a rotation about an axis u that the body carries (Touma and Wisdom, Lie-Poisson integrators for rigid body dynamics
in the solar system, Astron. J. 107, 1994). A symmetric body is turned exactly, however slender it is; for others the
rotations are composed to fourth order (Yoshida, Construction of higher order symplectic integrators, Phys. Lett. A 150,
1990), and energy stays within bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from symphys import rotation

Expr = Any
"""casadi SX, MX or DM"""

OUTER = 1 / (2 - 2 ** (1 / 3))
FOURTH_ORDER = (OUTER, 1 - 2 * OUTER, OUTER)
"""Shares of the time in three steps of second order that make one of fourth (Yoshida 1990, eq. 2.11)."""
SECOND_ORDER = (1.0,)


@dataclass(frozen=True)
class Splitting:
    """The inverse inertia as a sum c 1 + sum of b u u'.

    Attributes:
        sphere: c [1/(kg m^2)].
        terms: b [1/(kg m^2)] and u (3,), body frame.
    """

    sphere: Expr
    terms: tuple[tuple[Expr, Expr], ...]


def turned(inertia: Expr, q: Expr, momentum: Expr, t: Expr, shares: Sequence[float] = FOURTH_ORDER) -> Expr:
    """(4,): orientation ``q`` after the time ``t`` [s] in free rotation.

    Args:
        inertia: see ``world.Body``; no scalar.
        q: (4,) w x y z, body to world.
        momentum: (3,) angular momentum [N m s], world frame.
        t: how long [s].
        shares: of the time in each step of the composition.
    """
    split = splitting(inertia)
    shares = shares if len(split.terms) > 1 else SECOND_ORDER
    own = ca.mtimes(rotation.matrix(q).T, momentum)
    for first, share, last in _halves(shares):
        own, q = _spin(split.terms[1:], own, q, first * t)
        own, q = _spin(split.terms[:1], own, q, share * t)
        own, q = _spin(split.terms[:0:-1], own, q, last * t)
    return rotation.turn(q, split.sphere * t * momentum)


def _halves(shares: Sequence[float]) -> list[tuple[float, float, float]]:
    """Of each step of second order the times of its three parts; half steps that meet are one."""
    before = [shares[0] / 2] + [(a + b) / 2 for a, b in pairwise(shares)]
    after = [0.0] * (len(shares) - 1) + [shares[-1] / 2]
    return list(zip(before, shares, after, strict=True))


def _spin(terms: Sequence[tuple[Expr, Expr]], own: Expr, q: Expr, t: Expr) -> tuple[Expr, Expr]:
    """(momentum in the body's frame, orientation) after a rotation about each of the axes."""
    if isinstance(t, ca.SX) and t.is_zero():
        return own, q
    for strength, axis in terms:
        turn = rotation.exponential(t * strength * ca.dot(axis, own) * axis)
        own, q = ca.mtimes(rotation.matrix(turn).T, own), rotation.multiply(q, turn)
    return own, q


def splitting(inertia: Expr) -> Splitting:
    """The terms; of principal moments the two that are nearest to each other share the sphere."""
    rows = [ca.vertcat(*row) if isinstance(row, (tuple, list)) else ca.SX(row) for row in inertia]
    if rows[0].is_scalar():
        return _principal(rows, ca.SX.eye(3))
    tensor = ca.horzcat(*rows)
    if tensor.is_constant():
        moments, axes = np.linalg.eigh(np.array(ca.DM(tensor)))
        return _principal([ca.SX(m) for m in moments], ca.SX(axes))
    return _factors(tensor)


def _principal(moments: Sequence[Expr], axes: Expr) -> Splitting:
    """Of principal moments about the columns of ``axes``."""
    inverse = [1 / moment for moment in moments]
    near = [ca.fabs(inverse[k - 2] - inverse[k - 1]) for k in range(3)]
    odd_0 = ca.logic_and(near[0] <= near[1], near[0] <= near[2])
    odd_1 = ca.logic_and(ca.logic_not(odd_0), near[1] <= near[2])

    def chosen(of: Sequence[Expr]) -> Expr:
        return ca.if_else(odd_0, of[0], ca.if_else(odd_1, of[1], of[2]))

    columns = [axes[:, k] for k in range(3)]
    sphere = chosen([inverse[k - 1] for k in range(3)])
    odd = chosen(inverse) - sphere, chosen(columns)
    other = chosen([inverse[k - 2] for k in range(3)]) - sphere, chosen([columns[k - 2] for k in range(3)])
    return Splitting(sphere, tuple(term for term in (odd, other) if not term[0].is_zero()))


def _factors(tensor: Expr) -> Splitting:
    """Of a tensor of symbols, whose axes are not known: J = L D L', a rotation for each column of L."""
    inverse, columns = ca.inv_minor(tensor), list[tuple[Expr, Expr]]()
    for k in range(3):
        column = inverse[:, k] / inverse[k, k]
        columns.append((inverse[k, k], column))
        inverse = inverse - inverse[k, k] * ca.mtimes(column, column.T)
    return Splitting(ca.SX(0), tuple(columns))
