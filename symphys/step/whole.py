"""A whole step: one stretch of dt, or two with the first impact between them.

A contact that lasts (a ball that rolls) changes its force when its body is struck (by a cushion). Within one stretch
that force is one, as if the blow had come at the step's start: results then jump at step boundaries, and gradients
are wrong at any step size. So where bodies have several contacts a step is cut at its first impact. There no time
passes, only velocities change, and leapfrog starts anew. Without an impact the step is cut in the middle.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.step.along import Along
from symphys.step.deferral import deferred
from symphys.step.impact import Cut, collide_now, find_cut
from symphys.step.impulse import Impulse
from symphys.step.pgs import Given
from symphys.step.phase import Phase, advance
from symphys.step.restitution import eccentric_bodies
from symphys.step.row import ContactRow
from symphys.step.scene import Scene, State
from symphys.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""

CUTS_OFF_CENTRE = 2
"""Of a step where bodies may be hit off their centres: a box seldom lands on one corner alone."""


@dataclass(frozen=True)
class Report:
    """What happened in a step; forces and gaps in the order of the world's pairs.

    Attributes:
        forces: (3 * pairs,) impulse / dt on each pair's first body [N], world frame.
        gaps: (pairs,) at the start of the step [m].
        residual: largest change of a normal or friction impulse in a last sweep [N s].
        crowded: 1 if some body has two or more impacts at once (in one stretch), else 0.
    """

    forces: Expr
    gaps: Expr
    residual: Expr
    crowded: Expr


def take_step(scene: Scene, x: State) -> tuple[State, list[Phase]]:
    """The state after one step, and the stretches and the impact that led there."""
    scheme, dt = scene.setting.scheme, scene.setting.scheme.dt
    count = cuts_of(scene.world, scheme)
    if not count:
        phase = advance(scene, x, ca.SX(dt))
        return phase.x, [phase]
    left, phases, cuts = ca.SX(dt), list[Phase](), list[Cut]()
    for k in range(count):
        cut = find_cut(scene, x, left, 1 / (count - k + 1))
        before = advance(scene, x, cut.first, spared=cut.fast)
        struck = collide_now(scene, before.x, cut)
        x, left = struck.x, scene.pieces.do(_rest, left, cut.first)
        phases += [before, struck]
        cuts.append(cut)
    after = advance(scene, x, left, spared=deferred(scene, x, left, cuts))
    return after.x, [*phases, after]


def _rest(left: Expr, first: Expr) -> Expr:
    return left - first


def cuts_of(world: World, scheme: Scheme) -> int:
    """How often a step is cut: not where it can change nothing, since all is central and no body has two pairs."""
    sides = Counter(i for pair in world.pairs for i in {pair.first.body, pair.second.body} if i is not None)
    if not scheme.time_of_impact or not (eccentric_bodies(world) & set(sides) or max(sides.values(), default=0) > 1):
        return 0
    if scheme.cuts is not None:
        return scheme.cuts
    return CUTS_OFF_CENTRE if eccentric_bodies(world) else 1


def report(scene: Scene, phases: list[Phase]) -> Report:
    """What happened in a step, from its stretches."""
    do = scene.pieces.do
    forces = tuple(ca.SX.zeros(3) for _ in scene.world.pairs)
    residual, crowded = ca.SX(0), ca.SX(0)
    for phase in phases:
        given = zip(forces, phase.rows, phase.impulses, strict=True)
        forces = tuple(do(_added, force, each.row, impulse, scene.setting.scheme.dt) for force, each, impulse in given)
        if phase.ahead:
            forces = tuple(
                do(_ahead, force, ahead, scene.setting.scheme.dt)
                for force, ahead in zip(forces, phase.ahead, strict=True)
            )
        for new, old in phase.changes:
            residual = do(_larger_change, residual, new, old)
        crowded = do(_crowded, crowded, tuple((each.bodies, each.row.struck, each.row.leaving) for each in phase.rows))
    gaps = tuple(contact.gap for contact in phases[0].contacts)
    return Report(do(_stack, forces), do(_stack, gaps), residual, crowded)


def _added(force: Expr, row: ContactRow, impulse: Impulse, dt: float) -> Expr:
    return force + impulse.linear(row.impulse_normal) / dt


def _ahead(force: Expr, ahead: Expr, dt: float) -> Expr:
    return force + ahead / dt


def _stack(columns: tuple[Expr, ...]) -> Expr:
    return ca.densify(ca.vertcat(ca.SX(0, 1), *columns))


def _larger_change(residual: Expr, new: Given, old: Given) -> Expr:
    change = new.minus(old)
    if isinstance(change, Along):
        return ca.fmax(residual, ca.norm_inf(change.numbers))
    return ca.fmax(residual, ca.fmax(ca.fabs(change.normal), ca.norm_inf(change.tangent)))


def _crowded(before: Expr, rows: tuple[tuple[tuple[int, ...], Expr, Expr], ...]) -> Expr:
    """1 if some body has two or more impacts in this stretch, or had before."""
    counts: dict[int, Expr] = {}
    for bodies, struck, leaving in rows:
        for body in bodies:
            counts[body] = counts.get(body, 0) + ca.fmax(struck, leaving > 0)
    result = before
    for count in counts.values():
        result = ca.fmax(result, count >= 2)
    return result
