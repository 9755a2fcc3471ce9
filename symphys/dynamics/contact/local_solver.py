"""One contact solved to the law where its normal and its friction impulse act strongly on each other.

At the tip of a rod friction changes the normal velocity more than the normal impulse does: mu W_nt > W_nn, with W the
velocity of the touching points for unit impulses. Projections of the two impulses in turn then go round in a cycle.
Here both are found at once: the impulse that stops the slip if it lies in the cone of friction, else one on its edge,
r = l (n + mu d), whose direction d is opposite to the slip that is left. (Acary and Brogliato, Numerical methods for
nonsmooth dynamical systems, 2008, section 13.7, have such local solvers; the search for d by one step of projection and
one of Newton's method in each visit is our own.) Where friction of this direction would pull the surfaces together
(Painleve's paradox) no sliding impulse may exist, and sticking is preferred where it can be. A contact that opens
without an impulse gives none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.maths.smoothing import length, onto_disc, positive
from symphys.model.shapes import Box, Capsule, Shape, Sphere
from symphys.model.world import Body, Pair, World, is_zero

if TYPE_CHECKING:
    from symphys.dynamics.contact.constraint import ContactRow
    from symphys.dynamics.contact.projection import Impulse

Expr = Any
"""casadi SX, MX or DM"""

STRONG = 2.0
"""Bound of mu W_nt / W_nn, which few contacts of a body reach, up to which projections in turn are taken.

The corners of a box at rest converge sooner by those: a block pushed at mu = 1 is off by 1e-6 m, not 3e-5."""
LEAST = 0.01
"""Of W_nn: the least effective inverse mass of a sliding contact."""
FLAT = 1e-12
"""[m/s] below which the slope of the search for a direction says nothing."""
FAR = 0.5
"""[rad] longest step of that search."""


@dataclass(frozen=True)
class Coupling:
    """What impulses do to the velocity of the touching points against each other.

    Attributes:
        mobility: W (3, 3) [1/kg], with the softness of the contact along the normal.
        inverse: its inverse [kg].
        sliding_mass: 1 / (W_nn + mu |W_nt|) [kg], the shortest step along the normal.
    """

    mobility: Expr
    inverse: Expr
    sliding_mass: Expr


def coupling_of(mobility: Expr, n: Expr, friction: Expr, softness: Expr) -> Coupling:
    """The coupling of a contact with normal n (3,)."""
    w = mobility + softness * ca.mtimes(n, n.T)
    along = ca.mtimes(w, n)
    across = along - n * ca.dot(n, along)
    return Coupling(w, ca.inv_minor(w), 1 / (ca.dot(n, along) + friction * length(across)))


def pulls_together(mobility: Expr, n: Expr, friction: Expr, slip: Expr) -> Expr:
    """1 if an impulse on the edge of the cone, against the ``slip`` (3,), brings the surfaces together (Painleve)."""
    across = _across(slip, n)
    return ca.dot(n, ca.mtimes(mobility, n - friction * across / length(across))) <= 0


def solve(row: ContactRow, coupling: Coupling, slip: Expr, old: Impulse) -> tuple[Expr, Expr]:
    """(normal impulse, friction impulse (3,)) after which the contact obeys its law, all else as it is.

    Args:
        row: the contact.
        coupling: of it.
        slip: (3,) velocity of the touching points against each other [m/s].
        old: what it has given so far, with which ``slip`` came about.
    """
    n, mu, w = row.normal, row.law.friction, coupling.mobility
    given = n * old.normal + old.tangent
    error = slip - n * (row.target - row.softness * old.normal) - row.slip_target
    stopping = given - ca.mtimes(coupling.inverse, error)
    press = ca.dot(n, stopping)
    hold = stopping - n * press
    free = error - ca.mtimes(w, given)
    closes = ca.dot(n, free) < 0
    sticks = ca.logic_and(ca.logic_and(closes, press > 0), ca.dot(hold, hold) <= (mu * press) ** 2)

    wanted = old.tangent - row.tangent_mass * _across(error, n)
    direction = _turned(wanted / length(wanted), free, w, n, mu)
    load, _ = _load(direction, free, w, n, mu)
    return ca.if_else(sticks, press, load), ca.if_else(sticks, hold, mu * load * direction)


def _load(direction: Expr, free: Expr, w: Expr, n: Expr, mu: Expr) -> tuple[Expr, Expr]:
    """The normal impulse of a contact that slides against ``direction``, and the velocity (3,) for a unit of it."""
    response = ca.mtimes(w, n + mu * direction)
    least = LEAST * ca.dot(n, ca.mtimes(w, n))
    return ca.fmax(-ca.dot(n, free), 0) / ca.fmax(ca.dot(n, response), least), response


def _turned(direction: Expr, free: Expr, w: Expr, n: Expr, mu: Expr) -> Expr:
    """The direction after a step of Newton's method towards one that is opposite to the slip."""
    load, response = _load(direction, free, w, n, mu)
    aside, slip = ca.cross(n, direction), free + load * response
    turning = ca.mtimes(w, aside)
    lost = ca.dot(n, turning) / ca.fmax(ca.dot(n, response), LEAST * ca.dot(n, ca.mtimes(w, n)))
    slope = mu * load * (ca.dot(aside, turning) - lost * ca.dot(aside, response)) - ca.dot(direction, slip)
    step = ca.if_else(slope > FLAT, -ca.dot(aside, slip) / ca.fmax(slope, FLAT), 0)
    step = ca.fmin(ca.fmax(step, -FAR), FAR)
    found = direction + step * aside
    return found / ca.sqrt(1 + step * step)


def smooth(row: ContactRow, coupling: Coupling, slip: Expr, old: Impulse) -> tuple[Expr, Expr]:
    """The same under the smoothed law: projections in turn, the normal one shortened so that they do not cycle.

    Its width keeps the central path where it is without the shortening.
    """
    n, mass = row.normal, coupling.sliding_mass
    wanted = ca.dot(n, slip) - row.target + row.softness * old.normal
    normal = positive(old.normal - mass * wanted, ca.sqrt(mass * row.normal_mass) * row.width)
    slip = slip + row.answer * (normal - old.normal)
    friction = old.tangent - row.tangent_mass * _across(slip - row.slip_target, n)
    return normal, onto_disc(friction, row.law.friction * normal, row.tangent_mass * row.knob, row.knob)


def _across(a: Expr, n: Expr) -> Expr:
    return a - n * ca.dot(n, a)


def may_couple(world: World, pair: Pair) -> bool:
    """Whether friction at a contact may act strongly on its normal velocity; certain to be so nowhere, if False.

    A body at whose centre of mass impulses through the point act with arm r answers with
    W_nt / W_nn <= |r| / (2 k), k the least radius of gyration. At a ball about its centre r is along the normal.
    Bodies with joints are left to projections in turn: what an impulse does there is not symmetric, since it acts at
    another instant than that at which velocities are asked for, and a robot that stands would not come to rest. So are
    soft contacts, whose softness grows beyond all bounds towards the end of a step.
    """
    sides = [(side.body, side.shape) for side in (pair.first, pair.second) if side.body is not None]
    held = {index for joint in world.joints for index in joint.bodies}
    if is_zero(pair.law.friction) or pair.law.soft or any(body in held for body, _ in sides):
        return False
    return max(_ratio(world.bodies[body], shape, pair.law.friction) for body, shape in sides) > STRONG


def _ratio(body: Body, shape: int, friction: Any) -> float:
    """The largest mu W_nt / W_nn of a body without joints; infinite where symbols decide it."""
    surface = body.shapes[shape]
    if isinstance(surface, Sphere) and all(is_zero(c) for c in surface.centre):
        return 0.0
    numbers = [
        ca.SX(friction),
        ca.SX(body.mass),
        ca.vec(ca.SX(inertia_matrix(body.inertia))),
        *map(ca.SX, sizes(surface)),
    ]
    if not all(number.is_constant() for number in numbers):
        return np.inf
    moments = np.linalg.eigvalsh(np.array(ca.DM(inertia_matrix(body.inertia))))
    reach = np.linalg.norm(np.array(surface.centre, float)) + extent(surface)
    return float(float(friction) * reach / (2 * np.sqrt(moments[0] / float(body.mass))))


def sizes(shape: Shape) -> Sequence[Any]:
    """The numbers that say how large a shape is and where."""
    if isinstance(shape, Box):
        return (*shape.half_sizes, *shape.centre)
    return (shape.radius, *shape.centre, *((shape.half_length,) if isinstance(shape, Capsule) else ()))


def extent(shape: Shape) -> float:
    """The distance of a shape's furthest point from its centre [m]."""
    if isinstance(shape, Box):
        return float(np.linalg.norm(np.array(shape.half_sizes, float)))
    return float(shape.radius) + (float(shape.half_length) if isinstance(shape, Capsule) else 0.0)
