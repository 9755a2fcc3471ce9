"""Joints that close loops, and limits of joints that are no tree's, in the position pass: along trees' coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Displacement
from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint
from symphys.dynamics.joints.locked_directions import LockConstraint
from symphys.dynamics.motion import BodyJacobian, PredictedMotion, apply
from symphys.dynamics.tracing.decorator import repeat, traced
from symphys.dynamics.unknowns import GeneralizedVelocities, PlacedConstraint
from symphys.records import dataclass
from symphys.types import Expr

Displacements = tuple[Displacement, ...]
TreeDisplacement = Displacement | GeneralizedVelocities | None
"""Displacement of a body, or of a tree along its coordinates, at its root; None for other bodies of a tree."""
ClosedLoops = tuple[tuple[TreeDisplacement, ...], tuple[GeneralizedVelocities | None, ...]]
"""Displacements, and of each tree with loops what their locks did to them."""


@dataclass(frozen=True)
class LoopPass:
    """Motions and constraints, constant over the sweeps of the pass."""

    motions: tuple[PredictedMotion, ...]
    constraints: tuple[PlacedConstraint, ...]


def close_loops(
    sweeps: int,
    motions: tuple[PredictedMotion, ...],
    constraints: tuple[PlacedConstraint, ...],
    along: Sequence[TreeDisplacement],
) -> ClosedLoops:
    """Apply Gauss-Seidel to displacements, over constraints of locks and limits."""
    looped = {each.carriers[0] for each in constraints if isinstance(each.constraint, LockConstraint)}
    still = tuple(_still(each) if i in looped else None for i, each in enumerate(along))
    return repeat(sweeps, _fit_all, LoopPass(motions, constraints), (tuple(along), still))


@traced
def _still(along: TreeDisplacement) -> GeneralizedVelocities:
    assert isinstance(along, GeneralizedVelocities)
    return GeneralizedVelocities(ca.SX(along.numbers.size1(), 1))


@traced
def displaced(jacobian: BodyJacobian | None, along: TreeDisplacement) -> Displacement:
    """Return a body's displacement."""
    if jacobian is not None and isinstance(along, GeneralizedVelocities):
        more = apply(jacobian.matrix, along.numbers)
        return Displacement(more[:3], more[3:])
    assert isinstance(along, Displacement)
    return along


def _fit_all(fixed: LoopPass, state: ClosedLoops) -> ClosedLoops:
    """Make one pass over all constraints."""
    along, made = list(state[0]), list(state[1])
    for each in fixed.constraints:
        before = tuple(along[i] for i in each.carriers)
        parts = zip(each.bodies, before, strict=True)
        moved = tuple(displaced(fixed.motions[i].jacobian, own) for i, own in parts)
        after = _fit(each.constraint, moved, before)
        for i, own in zip(each.carriers, after, strict=True):
            along[i] = own
        root = each.carriers[0]
        if isinstance(each.constraint, LockConstraint):
            made[root] = _more(made[root], before[0], after[0])
    return tuple(along), tuple(made)


@traced
def _fit(
    constraint: LockConstraint | CoordinateConstraint, moved: Displacements, along: tuple[TreeDisplacement, ...]
) -> tuple[TreeDisplacement, ...]:
    """Return displacements after which the joint fits."""
    push, twist = constraint.impulse_directions.split(constraint.position_impulse(_relative(constraint, moved)))
    if constraint.same:
        after = along[0]
        for term in constraint.terms:
            after = _pushed(term, after, push, twist)
        return tuple(after for _ in constraint.terms)
    return tuple(_pushed(term, own, push, twist) for term, own in zip(constraint.terms, along, strict=True))


def _pushed(term: BodyTerm, along: TreeDisplacement, push: Expr, twist: Expr) -> TreeDisplacement:
    if isinstance(along, GeneralizedVelocities) and term.jacobian is not None:
        return GeneralizedVelocities(
            along.numbers
            + term.sign * (apply(term.jacobian.impulse_response, push) + apply(term.jacobian.torque_response, twist))
        )
    assert isinstance(along, Displacement)
    turn = apply(term.inverse_inertia, ca.cross(term.impulse_arm, push) + twist)
    return Displacement(along.linear + term.sign * term.inverse_mass * push, along.angular + term.sign * turn)


@traced
def _more(
    made: GeneralizedVelocities | None, before: TreeDisplacement, after: TreeDisplacement
) -> GeneralizedVelocities:
    assert (
        isinstance(made, GeneralizedVelocities)
        and isinstance(before, GeneralizedVelocities)
        and isinstance(after, GeneralizedVelocities)
    )
    return GeneralizedVelocities(made.numbers + after.numbers - before.numbers)


def _relative(constraint: LockConstraint | CoordinateConstraint, moved: Displacements) -> Expr:
    """Return the displacement of the first body against the second along the constraint, to third order."""
    linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for term, shift in zip(constraint.terms, moved, strict=True):
        linear += term.sign * (shift.linear + ca.cross(shift.angular, term.arm))
        angular += term.sign * shift.angular
    return constraint.velocity_directions.forwards(linear, angular)
