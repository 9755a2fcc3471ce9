"""What happened in a step: forces, gaps, the residual of the iteration, and what rigid bodies leave open."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import casadi as ca

from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.context import StepContext
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.substep import Substep
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import AnyImpulse
from symphys.model.scalar import is_zero
from symphys.model.world import Pair, World
from symphys.types import Expr

ACROSS = 1e-3
"""Cosine of normals up to which two impacts of a body do not act on each other."""


@dataclass(frozen=True)
class StepReport:
    """What happened in a step; forces and gaps in the order of the world's pairs.

    Attributes:
        forces: (3 * pairs,) impulse / dt on each pair's first body [N], world frame.
        gaps: (pairs,) at the start of the step [m].
        residual: largest change of a normal or friction impulse in a last sweep [N s].
        crowded: 1 if some body has two or more impacts at once (in one substep), or impacts of a chain come late.
        ambiguous: 1 if several bodies meet at one instant and rebound: rigid bodies have no one answer then.
        paradox: 1 if friction pulls a sliding contact together, for which no sliding force may exist (Painleve).
    """

    forces: Expr
    gaps: Expr
    residual: Expr
    crowded: Expr
    ambiguous: Expr
    paradox: Expr


def report(context: StepContext, substeps: list[Substep]) -> StepReport:
    """What happened in a step, from its substeps."""
    dt, forces = context.settings.scheme.dt, tuple(ca.SX.zeros(3) for _ in context.world.pairs)
    residual, crowded, ambiguous, paradox = ca.SX(0), ca.SX(0), ca.SX(0), ca.SX(0)
    for substep in substeps:
        given = zip(forces, substep.constraints, substep.impulses, strict=True)
        forces = tuple(_added(force, each.constraint, impulse, dt) for force, each, impulse in given)
        if substep.ahead:
            forces = tuple(force + ahead / dt for force, ahead in zip(forces, substep.ahead, strict=True))
        for new, old in substep.changes:
            residual = _larger_change(residual, new, old)
        impacts = tuple((each.bodies, each.constraint.struck, each.constraint.leaving) for each in substep.constraints)
        crowded = _crowded(_larger(crowded, substep.chained), impacts)
        for contacts in _simultaneous(context.world, substep):
            ambiguous = _ambiguous(ambiguous, contacts)
        for each, impulse in zip(substep.constraints, substep.impulses, strict=True):
            paradox = _pulls(paradox, each.constraint.paradox, impulse.normal)
    gaps = tuple(contact.gap for contact in substeps[0].contacts)
    return StepReport(_stack(forces), _stack(gaps), residual, crowded, ambiguous, paradox)


Met = tuple[Expr, Expr, Expr]
"""Normal (3,), normal impulse, whether the surfaces meet at speed."""


def _simultaneous(world: World, substep: Substep) -> list[tuple[Met, Met]]:
    """The contacts of one body with two others, two by two, of which one rebounds."""
    of: dict[int, list[int]] = {}
    for k, each in enumerate(substep.constraints):
        for body in each.bodies:
            of.setdefault(body, []).append(k)
    found = []
    for body, constraints in of.items():
        for i, j in combinations(constraints, 2):
            one, other = world.pairs[i], world.pairs[j]
            apart = _partner(one, body) != _partner(other, body)
            if apart and not (is_zero(one.law.restitution) and is_zero(other.law.restitution)):
                a, b = ((substep.constraints[k].constraint, substep.impulses[k].normal) for k in (i, j))
                found.append(((a[0].normal, a[1], a[0].struck), (b[0].normal, b[1], b[0].struck)))
    return found


def _partner(pair: Pair, body: int) -> tuple[int | None, int]:
    other = pair.second if pair.first.body == body else pair.first
    return (other.body, 0) if other.body is not None else (None, other.shape)


@traced
def _ambiguous(before: Expr, met: tuple[Met, Met]) -> Expr:
    """1 if both give an impulse at one instant, one of them as an impact, and neither leaves the other as it is."""
    (n, press, struck), (other, also, hit) = met
    both = ca.logic_and(ca.logic_and(press > 0, also > 0), ca.logic_or(struck, hit))
    return ca.fmax(before, ca.logic_and(both, ca.fabs(ca.dot(n, other)) > ACROSS))


@traced
def _pulls(before: Expr, paradox: Expr, press: Expr) -> Expr:
    return ca.fmax(before, ca.logic_and(paradox, press > 0))


@traced
def _added(force: Expr, constraint: ContactConstraint, impulse: ContactImpulse, dt: Expr) -> Expr:
    return force + impulse.linear(constraint.impulse_normal) / dt


@traced
def _stack(columns: tuple[Expr, ...]) -> Expr:
    return ca.densify(ca.vertcat(ca.SX(0, 1), *columns))


@traced
def _larger_change(residual: Expr, new: AnyImpulse, old: AnyImpulse) -> Expr:
    change = new.minus(old)
    if isinstance(change, JointImpulse):
        return ca.fmax(residual, ca.norm_inf(change.numbers))
    return ca.fmax(residual, ca.fmax(ca.fabs(change.normal), ca.norm_inf(change.tangent)))


@traced
def _larger(one: Expr, other: Expr) -> Expr:
    return ca.fmax(one, other)


@traced
def _crowded(before: Expr, constraints: tuple[tuple[tuple[int, ...], Expr, Expr], ...]) -> Expr:
    """1 if some body has two or more impacts in this substep, or had before."""
    counts: dict[int, Expr] = {}
    for bodies, struck, leaving in constraints:
        for body in bodies:
            counts[body] = counts.get(body, 0) + ca.fmax(struck, leaving > 0)
    result = before
    for count in counts.values():
        result = ca.fmax(result, count >= 2)
    return result
