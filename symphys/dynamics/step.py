"""One time step: a substep of dt, or substeps with impacts between them (docs/time_step.md, section 9).

A contact that lasts (a ball that rolls) changes its force when its body is struck (by a cushion). Within one substep
forces are constant, as if the blow had come at its start: results then jump at step boundaries, and gradients are wrong
at any step size. So where bodies have several contacts a step is split at its first impact. There no time passes, only
velocities change, and leapfrog begins anew. Without an impact substeps have equal lengths.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import casadi as ca

from symphys.dynamics.collision.broad_phase import near_pairs
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.impact.impact import StepSplit, defer_impacts, find_split, resolve_impact
from symphys.dynamics.impact.restitution import eccentric_bodies
from symphys.dynamics.substep import Substep, advance
from symphys.dynamics.tracing.decorator import section, traced
from symphys.maths import rotation
from symphys.model.world import Scheme, World
from symphys.types import Expr

MAX_SPLITS_OFF_CENTRE = 2
"""Splits of a step where bodies may be hit off their centres: a box seldom lands on one corner alone."""


def take_step(context: StepContext, x: State) -> tuple[State, list[Substep]]:
    """Return the state after one step, and the substeps and impacts that led there."""
    left: Expr = ca.SX(context.settings.scheme.dt)
    x = _with_unit_orientations(context, x)
    context = replace(context, near=near_pairs(context, x))
    count = max_splits(context.world, context.settings.scheme)
    substeps, splits = list[Substep](), list[StepSplit]()

    for k in range(count):
        # up to the first impact, equation (22); contacts that close fast give no impulse before it
        split = find_split(context, x, left, 1 / (count - k + 1))
        before = advance(context, x, split.first, suppressed=split.fast)

        # the impact: no time passes
        section(split.impact)
        impact = resolve_impact(context, before.x, split)

        x, left = impact.x, left - split.first
        substeps += [before, impact]
        splits.append(split)

    if not count:
        last = advance(context, x, left)
    else:
        # the rest of the step; of several more impacts of a body all but the first wait for the next step
        deferred = defer_impacts(context, x, left, splits)
        last = advance(context, x, left, deferred.suppressed, deferred.plastic)
        last = replace(last, chained=deferred.chained)
    return last.x, [*substeps, last]


def _with_unit_orientations(context: StepContext, x: State) -> State:
    """Return the state with orientations of length 1.

    Optimisers that have states as variables leave them at any length.
    """
    names = [f"{body.name}.orientation" for body in context.world.bodies]
    return x | {name: _normalised(x[name]) for name in names}


@traced
def _normalised(orientation: Expr) -> Expr:
    return rotation.normalised(orientation)


def max_splits(world: World, scheme: Scheme) -> int:
    """Return how often a step is split: 0 if all contacts are central and no body has two pairs."""
    sides = Counter(i for pair in world.pairs for i in {pair.first.body, pair.second.body} if i is not None)
    if not scheme.time_of_impact or not (eccentric_bodies(world) & set(sides) or max(sides.values(), default=0) > 1):
        return 0
    if scheme.cuts is not None:
        return scheme.cuts
    return MAX_SPLITS_OFF_CENTRE if eccentric_bodies(world) else 1
