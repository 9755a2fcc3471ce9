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
from symphys.step.scene import Scene
from symphys.world import World

Expr = Any
"""casadi SX, MX or DM"""


@dataclass(frozen=True)
class StepResult:
    """One step's new state and what happened in it; forces and gaps in the order of the world's pairs.

    Attributes:
        x: the next state.
        forces: (3 * pairs,) impulse / dt on each pair's first body [N], world frame.
        gaps: (pairs,) at the start of the step [m].
        residual: largest change of a normal or friction impulse in a last sweep [N s].
        crowded: 1 if some body has two or more impacts at once (in one stretch), else 0.
    """

    x: Expr
    forces: Expr
    gaps: Expr
    residual: Expr
    crowded: Expr


def take_step(scene: Scene, x: Expr) -> StepResult:
    """The expression of one step."""
    dt = scene.scheme.dt
    if not (scene.scheme.split and scene.scheme.time_of_impact and coupled(scene.world)):
        phase = advance(scene, x, ca.SX(dt))
        return _result(scene, phase.x, [phase])
    cut = find_cut(scene, x)
    before = advance(scene, x, cut.first, spared=cut.fast)
    struck = collide_now(scene, before.x, cut)
    rest = dt - cut.first
    after = advance(scene, struck.x, rest, spared=passing(scene, struck.x, rest))
    return _result(scene, after.x, [before, struck, after], cut.impact * _ahead(scene, before.x))


def _ahead(scene: Scene, x: Expr) -> Expr:
    """(3 * pairs,) [N s]: what persistent forces have given to the true velocities ahead of the impulses of sweeps.

    Elsewhere the next stretch takes it off again; after an impact, where leapfrog begins anew, it stays.
    """
    forces = [x[scene.layout[f"{pair.name}.force"]] for pair in scene.world.pairs]
    return x[scene.layout["lag"]] * ca.vertcat(ca.SX(0, 1), *forces)


def coupled(world: World) -> bool:
    """Whether some body is part of two pairs or more."""
    sides = Counter(i for pair in world.pairs for i in {pair.first.body, pair.second.body} if i is not None)
    return any(count > 1 for count in sides.values())


def _result(scene: Scene, x: Expr, phases: list[Phase], ahead: Expr = 0) -> StepResult:
    forces: Expr = ca.SX.zeros(3 * len(scene.world.pairs)) + ahead / scene.scheme.dt
    residual: Expr = ca.SX(0)
    crowded: Expr = ca.SX(0)
    for phase in phases:
        given = [i.linear(r.impulse_normal) for i, r in zip(phase.impulses, phase.rows, strict=True)]
        forces += ca.vertcat(ca.SX(0, 1), *given) / scene.scheme.dt
        for new, old in zip(phase.impulses, phase.last, strict=True):
            residual = ca.fmax(residual, _change(new.minus(old)))
        crowded = ca.fmax(crowded, _crowded(phase))
    gaps = ca.vertcat(ca.SX(0, 1), *(row.contact.gap for row in phases[0].rows))
    return StepResult(x, forces, gaps, residual, crowded)


def _change(impulse: Impulse) -> Expr:
    return ca.fmax(ca.fabs(impulse.normal), ca.norm_inf(impulse.tangent))


def _crowded(phase: Phase) -> Expr:
    """1 if some body has two or more impacts in this stretch."""
    counts: dict[int, Expr] = {}
    for row in phase.rows:
        for side in row.sides:
            counts[side.body] = counts.get(side.body, 0) + ca.fmax(row.struck, row.leaving > 0)
    result: Expr = ca.SX(0)
    for count in counts.values():
        result = ca.fmax(result, count >= 2)
    return result
