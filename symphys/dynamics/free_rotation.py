"""Free rotation of a body without torque: it conserves angular momentum at any inertia and any angle in a step.

The rotational energy l . J l / 2, with l the angular momentum in the body's frame and J the inverse inertia, is split
into c l . l / 2, a rotation about the constant momentum that commutes with all else, and two terms b (u . l)^2 / 2,
each a rotation about an axis u that the body carries (Touma and Wisdom, Lie-Poisson integrators for rigid body dynamics
in the solar system, Astron. J. 107, 1994). A symmetric body is turned exactly, however slender it is; for others the
rotations are composed to fourth order (Yoshida, Construction of higher order symplectic integrators, Phys. Lett. A 150,
1990), and energy stays within bounds.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from symphys.maths import rotation
from symphys.records import dataclass
from symphys.types import Expr

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
    """Return the orientation ``q`` after the time ``t`` [s] in free rotation (4,).

    Args:
        inertia: see ``world.Body``; no scalar.
        q: (4,) w x y z, body to world.
        momentum: (3,) angular momentum [N m s], world frame.
        t: how long [s].
        shares: of the time in each step of the composition.
    """
    split = splitting(inertia)
    own = ca.mtimes(rotation.matrix(q).T, momentum)
    for k, share in _composition(len(split.terms), shares):
        strength, axis = split.terms[k]
        turn = rotation.exponential(share * t * strength * ca.dot(axis, own) * axis)
        own, q = ca.mtimes(rotation.matrix(turn).T, own), rotation.multiply(q, turn)
    return rotation.turn(q, split.sphere * t * momentum)


def _composition(terms: int, shares: Sequence[float]) -> list[tuple[int, float]]:
    """Return the rotations in their order: (which term, share of the time); symmetric, those that meet as one."""
    if terms < 2:
        return [(k, 1.0) for k in range(terms)]
    ways = list(range(terms - 1, 0, -1))
    found: list[tuple[int, float]] = []
    for share in shares:
        for k, part in [*((k, share / 2) for k in ways), (0, share), *((k, share / 2) for k in reversed(ways))]:
            before = found.pop()[1] if found and found[-1][0] == k else 0.0
            found.append((k, before + part))
    return found


def splitting(inertia: Expr) -> Splitting:
    """Return the terms; of principal moments the two that are nearest to each other share the sphere."""
    rows = [ca.vertcat(*row) if isinstance(row, (tuple, list)) else ca.SX(row) for row in inertia]
    if rows[0].is_scalar():
        return _principal(rows, ca.SX.eye(3))
    tensor = ca.horzcat(*rows)
    if tensor.is_constant():
        moments, axes = np.linalg.eigh(np.array(ca.DM(tensor)))
        return _principal([ca.SX(m) for m in moments], ca.SX(axes))
    return _factors(tensor)


def _principal(moments: Sequence[Expr], axes: Expr) -> Splitting:
    """Return the inertia of principal moments about the columns of ``axes``."""
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
    """Factor a tensor of symbols without known axes: J = L D L', one rotation for each column of L."""
    inverse, columns = ca.inv_minor(tensor), list[tuple[Expr, Expr]]()
    for k in range(3):
        column = inverse[:, k] / inverse[k, k]
        columns.append((inverse[k, k], column))
        inverse = inverse - inverse[k, k] * ca.mtimes(column, column.T)
    return Splitting(ca.SX(0), tuple(columns))
