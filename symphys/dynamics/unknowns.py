"""Unknowns of the sweeps: velocities of bodies and kinematic trees, and impulses of constraints."""

from __future__ import annotations

from typing import Any, Protocol

import casadi as ca

from symphys.maths.smoothing import ramp
from symphys.records import dataclass
from symphys.types import Expr

COMPLIANCE = 1e-6
"""Compliance of rigid constraints in ``newton_start``, as a share of their inverse effective masses."""

NO_MASS = 1e-30
"""[kg] added under the root of effective masses, so that its slope is finite where a constraint acts on nothing."""


@dataclass(frozen=True)
class Momentum:
    """The sweeps' unknowns of one body at mid-step: velocity (3,) [m/s], angular momentum (3,) [N m s]."""

    velocity: Expr
    angular: Expr


@dataclass(frozen=True)
class GeneralizedVelocities:
    """The sweeps' unknowns of a tree of bodies at mid-step: rates (n,) of its coordinates [m/s], [rad/s]."""

    numbers: Expr

    def along(self, matrix: Expr) -> Expr:
        """Return ``matrix`` (m, n) times the rates, summed in pairs, so that no term waits for all others."""
        rows = []
        for i in range(matrix.size1()):
            terms = [matrix[i, j] * self.numbers[j] for j in range(matrix.size2()) if matrix.has_nz(i, j)]
            while len(terms) > 1:
                terms = [sum(terms[k + 1 : k + 2], terms[k]) for k in range(0, len(terms), 2)]
            rows.append(terms[0] if terms else ca.SX(0))
        return ca.vertcat(*rows)


Velocities = Momentum | GeneralizedVelocities | None
"""Velocities of a body, or of a tree, at its root; None for the other bodies of a tree."""
Momenta = tuple[Momentum, ...]
AllVelocities = tuple[Velocities, ...]


AnyImpulse = Any
"""``ContactImpulse`` of a contact, ``JointImpulse`` of a joint."""


@dataclass(frozen=True)
class Linearisation:
    """Parameters of the linearisation of a group's constraints; see ``newton_start``.

    Attributes:
        softness: which rigid contacts get [1/kg]; other rigid constraints ``COMPLIANCE``.
        centre: 1 if what is given at that softness counts from 0, 0 if from what was given so far.
        blur: [J^0.5] by how much an impulse over the root of its effective mass has to lie beyond a bound before the
            bound counts in full; below it a part of it counts. 0 where the group is solved.
    """

    softness: Expr
    centre: Expr
    blur: Expr

    def within(self, distance: Expr, mass: Expr) -> Expr:
        """Return 1 if an impulse is inside a bound by ``distance`` [N s], 0 if beyond it, and between near it."""
        return ramp(distance, ca.sqrt(ca.fmax(mass, 0) + NO_MASS) * self.blur)


class ImpulseLaw(Protocol):
    """The law of a constraint apart from its bodies: the impulse that it gives for what it looks at."""

    def response(self, seen: Expr, old: AnyImpulse) -> AnyImpulse:
        """Return the accumulated impulse after a projection; ``old``: before it."""
        ...

    def linearised(self, seen: Expr, old: AnyImpulse, by: Linearisation) -> tuple[Expr, Expr]:
        """Return a (k,) and B (k, m): the k numbers of its impulse change by a - B d rates.

        Args:
            seen: what the constraint looks at.
            old: the accumulated impulse.
            by: what is common to all constraints.
        """
        ...


class VelocityConstraint(Protocol):
    """A constraint that a sweep projects. Implementations are frozen dataclasses."""

    def project(self, momenta: AllVelocities, old: AnyImpulse) -> tuple[AllVelocities, AnyImpulse]:
        """Project once; return the momenta of the bodies and the accumulated impulse."""
        ...

    def apply(self, momenta: AllVelocities, impulse: AnyImpulse) -> AllVelocities:
        """Return the momenta after an impulse."""
        ...

    def rates(self, momenta: AllVelocities) -> Expr:
        """Return the velocities along the constraint (m,)."""
        ...

    def seen(self, momenta: AllVelocities) -> Expr:
        """Return what the projection looks at: its rates, or the gap after displacements."""
        ...

    def alone(self) -> ImpulseLaw:
        """Return the constraint without its bodies, and without what its law does not need."""
        ...


@dataclass(frozen=True)
class Iterate:
    """Momenta of all bodies, accumulated impulses of all constraints, and these before the last sweep."""

    momenta: AllVelocities
    impulses: tuple[AnyImpulse, ...]
    last: tuple[AnyImpulse, ...]


@dataclass(frozen=True)
class PlacedConstraint:
    """A constraint and the bodies that it acts on.

    Attributes:
        bodies: indices of those that can move.
        constraint: see ``Constraint``.
        carriers: where the velocities of these bodies are stored: at themselves, or at the root of their tree.
    """

    bodies: tuple[int, ...]
    constraint: Any
    carriers: tuple[int, ...]
