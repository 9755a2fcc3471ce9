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

from symphys.step.impact import collide_now, find_cut, passing
from symphys.step.pgs import Impulse
from symphys.step.phase import Phase, advance
from symphys.step.row import ContactRow
from symphys.step.scene import Scene, State
from symphys.world import World

Expr = Any
"""casadi SX, MX or DM"""


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
    if not (scheme.split and scheme.time_of_impact and coupled(scene.world)):
        phase = advance(scene, x, ca.SX(dt))
        return phase.x, [phase]
    cut = find_cut(scene, x)
    before = advance(scene, x, cut.first, spared=cut.fast)
    struck = collide_now(scene, before.x, cut)
    rest = scene.pieces.do(_rest, dt, cut.first)
    after = advance(scene, struck.x, rest, spared=passing(scene, struck.x, rest))
    return after.x, [before, struck, after]


def _rest(dt: float, first: Expr) -> Expr:
    return dt - first


def coupled(world: World) -> bool:
    """Whether some body is part of two pairs or more."""
    sides = Counter(i for pair in world.pairs for i in {pair.first.body, pair.second.body} if i is not None)
    return any(count > 1 for count in sides.values())


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
        for new, old in zip(phase.impulses, phase.last, strict=True):
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


def _larger_change(residual: Expr, new: Impulse, old: Impulse) -> Expr:
    change = new.minus(old)
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
