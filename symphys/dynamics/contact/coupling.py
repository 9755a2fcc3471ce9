"""Contacts at which friction acts strongly on the normal velocity: which these are, and how strongly."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.contact.friction import Friction
from symphys.dynamics.motion import inertia_matrix
from symphys.maths.smoothing import length
from symphys.model.body import Body
from symphys.model.world import Pair, World
from symphys.records import dataclass
from symphys.types import Expr

MAX_SEQUENTIAL_COUPLING = 2.0
"""Bound of mu W_nt / W_nn, which few contacts of a body reach, up to which projections in turn are taken.

The corners of a box at rest converge sooner by those: a block pushed at mu = 1 is off by 1e-6 m, not 3e-5."""


@dataclass(frozen=True)
class Coupling:
    """Response of the relative velocity of the touching points to impulses.

    Attributes:
        mobility: W (3, 3) [1/kg], with the softness of the contact along the normal.
        inverse: its inverse [kg].
        sliding_mass: 1 / (W_nn + mu |W_nt|) [kg], the shortest step along the normal.
    """

    mobility: Expr
    inverse: Expr
    sliding_mass: Expr


def coupling_of(mobility: Expr, n: Expr, friction: Friction, softness: Expr) -> Coupling:
    """Return the coupling of a contact with normal n (3,)."""
    w = mobility + softness * ca.mtimes(n, n.T)
    along = ca.mtimes(w, n)
    across = along - n * ca.dot(n, along)
    return Coupling(w, ca.inv_minor(w), 1 / (ca.dot(n, along) + friction.largest * length(across)))


def pulls_together(mobility: Expr, n: Expr, friction: Friction, slip: Expr) -> Expr:
    """Return 1 if an impulse on the edge of the cone, against the ``slip`` (3,), closes the surfaces (Painleve)."""
    return ca.dot(n, ca.mtimes(mobility, n - friction.against(_across(slip, n)))) <= 0


def _across(a: Expr, n: Expr) -> Expr:
    return a - n * ca.dot(n, a)


def coupled_pairs(world: World) -> list[bool]:
    """Return ``may_couple`` of all pairs, evaluated once for equal ones."""
    known: dict[Any, bool] = {}
    found = []
    for pair in world.pairs:
        sides = tuple((side.body, side.shape) for side in (pair.first, pair.second))
        key = id(pair.law), sides
        if key not in known:
            known[key] = may_couple(world, pair)
        found.append(known[key])
    return found


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
    if not pair.law.rubs or pair.law.soft or any(body in held for body, _ in sides):
        return False
    return (
        max(_ratio(world.bodies[body], shape, pair.law.largest_friction) for body, shape in sides)
        > MAX_SEQUENTIAL_COUPLING
    )


def _ratio(body: Body, shape: int, friction: Any) -> float:
    """Return the largest mu W_nt / W_nn of a body without joints; infinite where symbols decide it."""
    surface = body.shapes[shape]
    if surface.central:
        return 0.0
    sizes = (
        ca.vertcat(*size) if isinstance(size, tuple) else size
        for size in (*surface.parameters.values(), surface.centre)
    )
    numbers = [*map(ca.SX, (friction, body.mass, *sizes)), ca.SX(inertia_matrix(body.inertia))]
    if not all(number.is_constant() for number in numbers):
        return np.inf
    moments = np.linalg.eigvalsh(np.array(ca.DM(inertia_matrix(body.inertia))))
    reach = np.linalg.norm(np.array(surface.centre, float)) + surface.extent
    return float(float(friction) * reach / (2 * np.sqrt(moments[0] / float(body.mass))))
