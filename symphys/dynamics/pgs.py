"""Projected Gauss-Seidel over the rows of contacts and joints, on linear velocities and angular momenta.

Cost of a sweep: one visit to each row; nothing but V, L and the impulses is accumulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from symphys.dynamics.line_search import EVERY, Cluster, clusters, lengthened
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.tracing.decorator import repeat, traced
from symphys.dynamics.unknowns import (
    AllVelocities,
    AnyImpulse,
    Constraint,
    GeneralizedVelocities,
    PlacedConstraint,
    Solution,
    Velocities,
)
from symphys.model.world import World


@dataclass(frozen=True)
class Acceleration:
    """Rows, and the bodies that lean on each other by them, with their motions; see ``acceleration``."""

    rows: tuple[PlacedConstraint, ...]
    clusters: tuple[Cluster, ...]
    motions: tuple[PredictedMotion, ...]


def iterate(
    world: World, sweeps: int, rows: tuple[PlacedConstraint, ...], start: Solution, motions: Sequence[PredictedMotion]
) -> Solution:
    """All sweeps; among bodies that lean on each other with longer steps now and then."""
    found = tuple(clusters(world, rows))
    if not found:
        return repeat(sweeps, sweep, rows, start)
    rounds = max((sweeps - 1) // EVERY, 0)
    moved = repeat(rounds, _round, Acceleration(rows, found, tuple(motions)), start)
    return repeat(sweeps - rounds * EVERY, sweep, rows, moved)


def _round(leaning: Acceleration, state: Solution) -> Solution:
    """Some sweeps, then a longer step along the last."""
    before = repeat(EVERY - 1, sweep, leaning.rows, state)
    now = sweep(leaning.rows, before)
    for cluster in leaning.clusters:
        now = lengthened(cluster, leaning.rows, leaning.motions, before, now)
    return now


def sweep(rows: tuple[PlacedConstraint, ...], before: Solution) -> Solution:
    """One pass over all rows."""
    momenta, new = list(before.momenta), list(before.impulses)
    for run in runs(rows, momenta):
        carriers = tuple(dict.fromkeys(i for k in run for i in rows[k].carriers))
        visits = tuple((rows[k].row, tuple(carriers.index(i) for i in rows[k].carriers)) for k in run)
        visited, given = _project_run(visits, tuple(momenta[i] for i in carriers), [new[k] for k in run])
        for i, moved in zip(carriers, visited, strict=True):
            momenta[i] = moved
        for k, impulse in zip(run, given, strict=True):
            new[k] = impulse
    return Solution(tuple(momenta), tuple(new), before.impulses)


def projection_order(rows: Sequence[PlacedConstraint]) -> list[int]:
    """Rows one after the other that share no body as far as may be: a processor works on several visits at once."""
    order: list[int] = []
    left = list(range(len(rows)))
    busy: set[int] = set()
    while left:
        free = (k for k in left if busy.isdisjoint(rows[k].carriers))
        k = next(free, left[0])
        busy = set(rows[k].carriers)
        left.remove(k)
        order.append(k)
    return order


def runs(rows: Sequence[PlacedConstraint], momenta: Sequence[Velocities]) -> list[list[int]]:
    """The rows in visiting order, those of one tree of joints together: what is known of it is handed on within a run.

    A row joins the last run that shares a body with it, so that nothing is visited in another order than before.
    """
    found: list[list[int]] = []
    last: dict[int, int] = {}
    for k in projection_order(rows):
        carriers = set(rows[k].carriers)
        latest = max((last[i] for i in carriers if i in last), default=-1)
        within = len(carriers) == 1 and isinstance(momenta[min(carriers)], GeneralizedVelocities)
        if not (within and latest >= 0 and carriers == set(rows[found[latest][0]].carriers)):
            latest = len(found)
            found.append([])
        found[latest].append(k)
        last |= dict.fromkeys(carriers, latest)
    return found


def apply_start(rows: Sequence[PlacedConstraint], momenta: AllVelocities, impulses: Sequence[AnyImpulse]) -> Solution:
    """Give the impulses that the sweeps start from."""
    started = list(momenta)
    for each, impulse in zip(rows, impulses, strict=True):
        spread(started, each, _give(each.row, of_bodies(started, each), impulse))
    return Solution(tuple(started), tuple(impulses), tuple(impulses))


def of_bodies(momenta: Sequence[Velocities], row: PlacedConstraint) -> AllVelocities:
    """The momenta of the row's bodies."""
    return tuple(momenta[i] for i in row.carriers)


def spread(momenta: list[Velocities], row: PlacedConstraint, changed: AllVelocities) -> None:
    """Put the momenta of the row's bodies back."""
    for i, momentum in zip(row.carriers, changed, strict=True):
        momenta[i] = momentum


@traced
def _project_run(
    visits: tuple[tuple[Constraint, tuple[int, ...]], ...], states: AllVelocities, old: list[AnyImpulse]
) -> tuple[AllVelocities, list[AnyImpulse]]:
    """Visits one after the other: rows, and which of the states are those of their sides."""
    momenta, given = list(states), []
    for (row, places), impulse in zip(visits, old, strict=True):
        visited, new = row.project(tuple(momenta[i] for i in places), impulse)
        given.append(new)
        for i, moved in zip(places, visited, strict=True):
            momenta[i] = moved
    return tuple(momenta), given


@traced
def _give(row: Constraint, momenta: AllVelocities, impulse: AnyImpulse) -> AllVelocities:
    return row.apply(momenta, impulse)
