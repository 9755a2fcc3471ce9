"""A whole step: one substep of dt, or two with the first impact between them.

A contact that lasts (a ball that rolls) changes its force when its body is struck (by a cushion). Within one substep
that force is one, as if the blow had come at the step's start: results then jump at step boundaries, and gradients
are wrong at any step size. So where bodies have several contacts a step is cut at its first impact. There no time
passes, only velocities change, and leapfrog starts anew. Without an impact the step is cut in the middle.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import casadi as ca

from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.impact.deferred_impacts import defer_impacts
from symphys.dynamics.impact.impact import Split, find_split, resolve_impact
from symphys.dynamics.impact.restitution import eccentric_bodies
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.substep import Substep, advance
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import AnyImpulse
from symphys.model.world import Pair, Scheme, World, is_zero

Expr = Any
"""casadi SX, MX or DM"""

CUTS_OFF_CENTRE = 2
"""Of a step where bodies may be hit off their centres: a box seldom lands on one corner alone."""


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


def take_step(context: StepContext, x: State) -> tuple[State, list[Substep]]:
    """The state after one step, and the substeps and the impact that led there."""
    scheme, dt = context.settings.scheme, context.settings.scheme.dt
    count = splits_of(context.world, scheme)
    if not count:
        substep = advance(context, x, ca.SX(dt))
        return substep.x, [substep]
    left, substeps, cuts = ca.SX(dt), list[Substep](), list[Split]()
    for k in range(count):
        cut = find_split(context, x, left, 1 / (count - k + 1))
        before = advance(context, x, cut.first, suppressed=cut.fast)
        struck = resolve_impact(context, before.x, cut)
        x, left = struck.x, _rest(left, cut.first)
        substeps += [before, struck]
        cuts.append(cut)
    late = defer_impacts(context, x, left, cuts)
    after = replace(advance(context, x, left, late.suppressed, late.plastic), chained=late.chained)
    return after.x, [*substeps, after]


@traced
def _rest(left: Expr, first: Expr) -> Expr:
    return left - first


def splits_of(world: World, scheme: Scheme) -> int:
    """How often a step is cut: not where it can change nothing, since all is central and no body has two pairs."""
    sides = Counter(i for pair in world.pairs for i in {pair.first.body, pair.second.body} if i is not None)
    if not scheme.time_of_impact or not (eccentric_bodies(world) & set(sides) or max(sides.values(), default=0) > 1):
        return 0
    if scheme.cuts is not None:
        return scheme.cuts
    return CUTS_OFF_CENTRE if eccentric_bodies(world) else 1


def report(context: StepContext, substeps: list[Substep]) -> StepReport:
    """What happened in a step, from its substeps."""
    forces = tuple(ca.SX.zeros(3) for _ in context.world.pairs)
    residual, crowded, ambiguous, paradox = ca.SX(0), ca.SX(0), ca.SX(0), ca.SX(0)
    for substep in substeps:
        given = zip(forces, substep.rows, substep.impulses, strict=True)
        forces = tuple(_added(force, each.row, impulse, context.settings.scheme.dt) for force, each, impulse in given)
        if substep.ahead:
            forces = tuple(
                _ahead(force, ahead, context.settings.scheme.dt)
                for force, ahead in zip(forces, substep.ahead, strict=True)
            )
        for new, old in substep.changes:
            residual = _larger_change(residual, new, old)
        crowded = _larger(crowded, substep.chained)
        crowded = _crowded(crowded, tuple((each.bodies, each.row.struck, each.row.leaving) for each in substep.rows))
        for meeting in _meetings(context.world, substep):
            ambiguous = _ambiguous(ambiguous, meeting)
        for each, impulse in zip(substep.rows, substep.impulses, strict=True):
            paradox = _pulls(paradox, each.row.paradox, impulse.normal)
    gaps = tuple(contact.gap for contact in substeps[0].contacts)
    return StepReport(_stack(forces), _stack(gaps), residual, crowded, ambiguous, paradox)


Met = tuple[Expr, Expr, Expr]
"""Normal (3,), normal impulse, whether the surfaces meet at speed."""


def _meetings(world: World, substep: Substep) -> list[tuple[Met, Met]]:
    """The contacts of one body with two others, two by two, of which one rebounds."""
    of: dict[int, list[int]] = {}
    for k, each in enumerate(substep.rows):
        for body in each.bodies:
            of.setdefault(body, []).append(k)
    found = []
    for body, rows in of.items():
        for i, j in combinations(rows, 2):
            one, other = world.pairs[i], world.pairs[j]
            apart = _partner(one, body) != _partner(other, body)
            if apart and not (is_zero(one.law.restitution) and is_zero(other.law.restitution)):
                a, b = ((substep.rows[k].row, substep.impulses[k].normal) for k in (i, j))
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
def _added(force: Expr, row: ContactConstraint, impulse: ContactImpulse, dt: float) -> Expr:
    return force + impulse.linear(row.impulse_normal) / dt


@traced
def _ahead(force: Expr, ahead: Expr, dt: float) -> Expr:
    return force + ahead / dt


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
def _crowded(before: Expr, rows: tuple[tuple[tuple[int, ...], Expr, Expr], ...]) -> Expr:
    """1 if some body has two or more impacts in this substep, or had before."""
    counts: dict[int, Expr] = {}
    for bodies, struck, leaving in rows:
        for body in bodies:
            counts[body] = counts.get(body, 0) + ca.fmax(struck, leaving > 0)
    result = before
    for count in counts.values():
        result = ca.fmax(result, count >= 2)
    return result
