"""Projected Gauss-Seidel over the constraints of contacts and joints, on linear velocities and angular momenta.

Cost of a sweep: one projection of each constraint; only velocities, momenta and impulses are accumulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile

from symphys.dynamics.contact.constraint import ContactConstraint, known_before
from symphys.dynamics.contact.newton_start import contact_softness, open_groups, solve_together
from symphys.dynamics.context import StepContext
from symphys.dynamics.joints.assembly import KinematicTrees
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint, project_in_turn, pushed_by
from symphys.dynamics.line_search import EVERY, Cluster, clusters, lengthened
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.tracing.decorator import repeat, traced
from symphys.dynamics.unknowns import (
    AllVelocities,
    AnyImpulse,
    GeneralizedVelocities,
    Iterate,
    PlacedConstraint,
    Velocities,
    VelocityConstraint,
)


@dataclass(frozen=True)
class Acceleration:
    """Constraints, the clusters of bodies that they connect, and the motions of bodies; see ``line_search``."""

    constraints: tuple[PlacedConstraint, ...]
    clusters: tuple[Cluster, ...]
    motions: tuple[PredictedMotion, ...]


def iterate(
    context: StepContext, constraints: tuple[PlacedConstraint, ...], start: Iterate, trees: KinematicTrees
) -> Iterate:
    """The solution after all sweeps; in clusters of unequal bodies with a line search after some of them.

    Groups whose loads statics may leave undetermined start from the solution of Newton's method.
    """
    world, sweeps, motions = context.world, context.settings.scheme.sweeps, trees.motions
    for group in open_groups(context, constraints, start.momenta):
        start = solve_together(group, constraints, start, trees, contact_softness(group, constraints, trees))
    constraints = _coupled(constraints, start.momenta)
    found = tuple(clusters(world, constraints))
    if not found:
        return repeat(sweeps, sweep, constraints, start)
    rounds = max((sweeps - 1) // EVERY, 0)
    moved = repeat(rounds, _round, Acceleration(constraints, found, tuple(motions)), start)
    return repeat(sweeps - rounds * EVERY, sweep, constraints, moved)


def _round(fixed: Acceleration, state: Iterate) -> Iterate:
    """Some sweeps, then a longer step along the last."""
    before = repeat(EVERY - 1, sweep, fixed.constraints, state)
    now = sweep(fixed.constraints, before)
    for cluster in fixed.clusters:
        now = lengthened(cluster, fixed.constraints, fixed.motions, before, now)
    return now


def sweep(constraints: tuple[PlacedConstraint, ...], before: Iterate) -> Iterate:
    """One pass over all constraints."""
    momenta, new = list(before.momenta), list(before.impulses)
    for run in runs(constraints, momenta):
        carriers = tuple(dict.fromkeys(i for k in run for i in constraints[k].carriers))
        projections = tuple(
            (constraints[k].constraint, tuple(carriers.index(i) for i in constraints[k].carriers)) for k in run
        )
        after, given = _project_run(projections, tuple(momenta[i] for i in carriers), [new[k] for k in run])
        for i, moved in zip(carriers, after, strict=True):
            momenta[i] = moved
        for k, impulse in zip(run, given, strict=True):
            new[k] = impulse
    return Iterate(tuple(momenta), tuple(new), before.impulses)


def projection_order(constraints: Sequence[PlacedConstraint]) -> list[int]:
    """Consecutive constraints share no body where possible: a processor works on several projections at once."""
    order: list[int] = []
    left = list(range(len(constraints)))
    busy: set[int] = set()
    while left:
        free = (k for k in left if busy.isdisjoint(constraints[k].carriers))
        k = next(free, left[0])
        busy = set(constraints[k].carriers)
        left.remove(k)
        order.append(k)
    return order


def runs(constraints: Sequence[PlacedConstraint], momenta: Sequence[Velocities]) -> list[list[int]]:
    """The constraints in the order of projection; runs of those on one kinematic tree are traced as one call.

    A constraint joins the last run that shares a body with it, which does not change the order on any body.
    """
    found: list[list[int]] = []
    last: dict[int, int] = {}
    for k in projection_order(constraints):
        carriers = set(constraints[k].carriers)
        latest = max((last[i] for i in carriers if i in last), default=-1)
        within = _of_one_tree(constraints[k], momenta)
        if not (within and latest >= 0 and carriers == set(constraints[found[latest][0]].carriers)):
            latest = len(found)
            found.append([])
        found[latest].append(k)
        last |= dict.fromkeys(carriers, latest)
    return found


def apply_start(
    constraints: Sequence[PlacedConstraint], momenta: AllVelocities, impulses: Sequence[AnyImpulse]
) -> Iterate:
    """Apply the impulses that the sweeps start from."""
    started = list(momenta)
    for each, impulse in zip(constraints, impulses, strict=True):
        after = _apply(each.constraint, tuple(started[i] for i in each.carriers), impulse)
        for i, momentum in zip(each.carriers, after, strict=True):
            started[i] = momentum
    return Iterate(tuple(started), tuple(impulses), tuple(impulses))


def _coupled(constraints: tuple[PlacedConstraint, ...], momenta: Sequence[Velocities]) -> tuple[PlacedConstraint, ...]:
    """With what is known before: of contacts of one tree, and ``pushed`` where coordinates follow one another."""
    found = [_readied(each) if _of_one_tree(each, momenta) else each for each in constraints]
    for run in runs(constraints, momenta):
        for k, then in pairwise(run):
            first, second = constraints[k].constraint, constraints[then].constraint
            if _of_tree(first) and _of_tree(second):
                found[then] = replace(found[then], constraint=replace(second, pushed=pushed_by(first, second)))
    return tuple(found)


def _of_one_tree(placed: PlacedConstraint, momenta: Sequence[Velocities]) -> bool:
    return len(set(placed.carriers)) == 1 and isinstance(momenta[placed.carriers[0]], GeneralizedVelocities)


def _readied(placed: PlacedConstraint) -> PlacedConstraint:
    contact = placed.constraint
    if not isinstance(contact, ContactConstraint) or contact.coupling is not None:
        return placed
    return replace(placed, constraint=replace(contact, before=known_before(contact)))


def _of_tree(constraint: VelocityConstraint) -> bool:
    return isinstance(constraint, CoordinateConstraint) and constraint.of_tree is not None


@traced
def _project_run(
    projections: tuple[tuple[VelocityConstraint, tuple[int, ...]], ...], states: AllVelocities, old: list[AnyImpulse]
) -> tuple[AllVelocities, list[AnyImpulse]]:
    """One constraint after the other: each with the places of its bodies among the states."""
    momenta, given = list(states), list[AnyImpulse]()
    while len(given) < len(projections):
        first, after = len(given), projections[len(given) + 1 :]
        turn = [each for each, _ in (projections[first], *takewhile(lambda each: _pushed(each[0]), after))]
        velocities = momenta[0]
        if len(turn) > 1 and isinstance(velocities, GeneralizedVelocities):  # all on one tree
            coordinates = [each for each in turn if isinstance(each, CoordinateConstraint)]
            momenta[0], news = project_in_turn(coordinates, velocities, old[first : first + len(turn)])
            given += news
            continue
        constraint, places = projections[first]
        moved, new = constraint.project(tuple(momenta[i] for i in places), old[first])
        given.append(new)
        for i, momentum in zip(places, moved, strict=True):
            momenta[i] = momentum
    return tuple(momenta), given


def _pushed(constraint: VelocityConstraint) -> bool:
    return isinstance(constraint, CoordinateConstraint) and constraint.pushed is not None


@traced
def _apply(constraint: VelocityConstraint, momenta: AllVelocities, impulse: AnyImpulse) -> AllVelocities:
    return constraint.apply(momenta, impulse)
