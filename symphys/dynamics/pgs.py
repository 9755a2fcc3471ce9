"""Projected Gauss-Seidel over the constraints of contacts and joints, on linear velocities and angular momenta.

Cost of a sweep: one projection of each constraint; only velocities, momenta and impulses are accumulated.

Where a heavy body rests on a light one, steps of the sweeps are lengthened. Gauss-Seidel goes to the answer by steps of
a geometric series, of ratio 1 - m/M where a mass M rests on m: a thousand sweeps where the masses are a thousand to
one. All of the series points one way. So now and then the change of the last sweep is repeated as often as lowers the
kinetic energy most (less the work that targets ask for), which the answer minimises: an exact line search along the
last change, as in the conjugate gradients of Renouf and Alart, Conjugate gradient type algorithms for frictional
multi-contact problems (Comput. Methods Appl. Mech. Engrg. 194, 2005). No normal impulse may become negative on the
way. Deviation: plain sweeps in between, which project and go round less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, takewhile

import casadi as ca

from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse, precompute
from symphys.dynamics.contact.newton_start import contact_softness, solvable_groups, solve_together
from symphys.dynamics.context import StepContext
from symphys.dynamics.joints.assembly import KinematicTrees
from symphys.dynamics.joints.coordinate_constraint import (
    CoordinateConstraint,
    coupling_to_previous,
    project_sequentially,
)
from symphys.dynamics.motion import PredictedMotion, apply
from symphys.dynamics.tracing.decorator import repeat, traced
from symphys.dynamics.unknowns import (
    AllVelocities,
    AnyImpulse,
    GeneralizedVelocities,
    Iterate,
    Momentum,
    PlacedConstraint,
    Velocities,
    VelocityConstraint,
)
from symphys.model.world import UNEQUAL, World
from symphys.records import dataclass
from symphys.types import Expr

SWEEPS_PER_EXTRAPOLATION = 4
"""Sweeps between two longer steps."""
MAX_EXTRAPOLATION = 1e4
"""Times the last change."""
MIN_IMPULSE = 1e-100
"""[N s] whose inverse square is still a number: slopes are finite where nothing falls."""
MIN_VELOCITY_CHANGE = 1e-10
"""[m/s] changes of velocity below which nothing is repeated."""


@dataclass(frozen=True)
class Cluster:
    """Bodies without joints that may lean on each other, and their constraints, by index."""

    bodies: tuple[int, ...]
    constraints: tuple[int, ...]


def clusters(world: World, constraints: Sequence[PlacedConstraint]) -> list[Cluster]:
    """Select the constraints between bodies of very different mass, or of masses that are symbols."""
    roots = list(range(len(world.bodies)))
    for bodies in [constraint.bodies for constraint in constraints] + [joint.bodies for joint in world.joints]:
        for k in bodies[1:]:
            roots[_root(roots, k)] = _root(roots, bodies[0])
    groups: dict[int, set[int]] = {}
    for k in range(len(roots)):
        groups.setdefault(_root(roots, k), set()).add(k)
    held = {k for joint in world.joints for k in joint.bodies}
    apart = [group for group in groups.values() if _unequal(world, group) and not group & held]
    return [
        Cluster(
            tuple(sorted(group)), tuple(k for k, constraint in enumerate(constraints) if group & set(constraint.bodies))
        )
        for group in apart
    ]


def _root(roots: list[int], k: int) -> int:
    """Return the representative of a body's group."""
    while roots[k] != k:
        roots[k] = roots[roots[k]]
        k = roots[k]
    return k


def _unequal(world: World, group: set[int]) -> bool:
    masses = [ca.SX(world.bodies[k].mass) for k in group]
    if len(group) > 1 and not all(mass.is_constant() for mass in masses):
        return True
    return max(map(float, masses)) > UNEQUAL * min(map(float, masses)) if len(group) > 1 else False


def extrapolate(
    cluster: Cluster,
    constraints: Sequence[PlacedConstraint],
    motions: Sequence[PredictedMotion],
    before: Iterate,
    now: Iterate,
) -> Iterate:
    """Repeat the change of the last sweep, from ``before`` to ``now``, by the factor of the line search."""
    # slope and curvature of the energy along the last change (17), and its largest multiple
    sums: tuple[Expr, Expr] = (ca.SX(0), ca.SX(0))
    longest: Expr = ca.SX(MAX_EXTRAPOLATION)
    for k in cluster.bodies:
        sums = _add_body_terms(sums, motions[k], now.momenta[k], before.momenta[k])
    for k in cluster.constraints:
        sums, longest = _add_constraint_terms(sums, longest, constraints[k].constraint, now.impulses[k], now.last[k])
    share = _extrapolation_factor(sums, longest)
    # velocities and impulses after the repetition
    momenta, impulses = list(now.momenta), list(now.impulses)
    for k in cluster.bodies:
        momenta[k] = _extrapolate_momentum(share, now.momenta[k], before.momenta[k])
    for k in cluster.constraints:
        impulses[k] = _extrapolate_impulse(share, now.impulses[k], now.last[k])
    return replace(now, momenta=tuple(momenta), impulses=tuple(impulses))


@traced
def _add_body_terms(
    sums: tuple[Expr, Expr], motion: PredictedMotion, now: Velocities, before: Velocities
) -> tuple[Expr, Expr]:
    """Add a body's terms to the slope of the energy along the change, and to its curvature."""
    assert isinstance(now, Momentum) and isinstance(before, Momentum)
    moved, turned = now.velocity - before.velocity, now.angular - before.angular
    spun = apply(motion.inverse_mid, turned)
    slope = motion.mass * ca.dot(now.velocity, moved) + ca.dot(now.angular, spun)
    settled = motion.mass * MIN_VELOCITY_CHANGE**2
    return sums[0] + slope, sums[1] + motion.mass * ca.dot(moved, moved) + ca.dot(turned, spun) + settled


@traced
def _add_constraint_terms(
    sums: tuple[Expr, Expr], longest: Expr, constraint: ContactConstraint, now: ContactImpulse, before: ContactImpulse
) -> tuple[tuple[Expr, Expr], Expr]:
    """Add a constraint's terms to slope and curvature, and bound how often the change can be repeated."""
    press = now.normal - before.normal
    target_work = constraint.target * press + ca.dot(constraint.slip_target, now.tangent - before.tangent)
    slope = sums[0] - target_work + constraint.softness * now.normal * press
    falls = ca.if_else(press < 0, now.normal / ca.fmax(-press, MIN_IMPULSE), MAX_EXTRAPOLATION)
    return (slope, sums[1] + constraint.softness * press * press), ca.fmin(longest, falls)


@traced
def _extrapolation_factor(sums: tuple[Expr, Expr], longest: Expr) -> Expr:
    return ca.fmin(ca.fmax(-sums[0] / sums[1], 0), longest)


@traced
def _extrapolate_momentum(share: Expr, now: Velocities, before: Velocities) -> Momentum:
    assert isinstance(now, Momentum) and isinstance(before, Momentum)
    return Momentum(
        now.velocity + share * (now.velocity - before.velocity), now.angular + share * (now.angular - before.angular)
    )


@traced
def _extrapolate_impulse(share: Expr, now: ContactImpulse, before: ContactImpulse) -> ContactImpulse:
    return now.plus(now.minus(before).times(share))


@dataclass(frozen=True)
class ExtrapolationContext:
    """Constraints, the clusters of bodies that they connect, and the motions of bodies; see the module."""

    constraints: tuple[PlacedConstraint, ...]
    clusters: tuple[Cluster, ...]
    motions: tuple[PredictedMotion, ...]


def iterate(
    context: StepContext, constraints: tuple[PlacedConstraint, ...], start: Iterate, trees: KinematicTrees
) -> Iterate:
    """Return the solution after all sweeps; in clusters of unequal bodies with a line search after some of them.

    Groups whose loads statics may leave undetermined start from the solution of Newton's method.
    """
    world, sweeps, motions = context.world, context.settings.scheme.sweeps, trees.motions
    # loads that statics leaves open: Newton's method
    for group in solvable_groups(context, constraints, start.momenta):
        start = solve_together(group, constraints, start, trees, contact_softness(group, constraints, trees))
    # sweeps, with extrapolations in clusters of unequal masses
    constraints = _with_known_terms(constraints, start.momenta)
    found = tuple(clusters(world, constraints))
    if not found:
        return repeat(sweeps, sweep, constraints, start)
    rounds = max((sweeps - 1) // SWEEPS_PER_EXTRAPOLATION, 0)
    moved = repeat(rounds, _accelerated_sweeps, ExtrapolationContext(constraints, found, tuple(motions)), start)
    return repeat(sweeps - rounds * SWEEPS_PER_EXTRAPOLATION, sweep, constraints, moved)


def _accelerated_sweeps(fixed: ExtrapolationContext, state: Iterate) -> Iterate:
    """Make some sweeps, then a longer step along the last."""
    before = repeat(SWEEPS_PER_EXTRAPOLATION - 1, sweep, fixed.constraints, state)
    now = sweep(fixed.constraints, before)
    for cluster in fixed.clusters:
        now = extrapolate(cluster, fixed.constraints, fixed.motions, before, now)
    return now


def sweep(constraints: tuple[PlacedConstraint, ...], before: Iterate) -> Iterate:
    """Make one pass over all constraints."""
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
    """Order constraints so that neighbours share no body where possible: a processor works on several at once."""
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
    """Return the constraints in the order of projection; runs of those on one kinematic tree are traced as one call.

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


def _with_known_terms(
    constraints: tuple[PlacedConstraint, ...], momenta: Sequence[Velocities]
) -> tuple[PlacedConstraint, ...]:
    """Attach what is known before the sweeps: of contacts of one tree, and ``pushed`` where coordinates are coupled."""
    found = [_with_precomputed(each) if _of_one_tree(each, momenta) else each for each in constraints]
    for run in runs(constraints, momenta):
        for k, then in pairwise(run):
            first, second = constraints[k].constraint, constraints[then].constraint
            if _on_tree_coordinate(first) and _on_tree_coordinate(second):
                found[then] = replace(
                    found[then], constraint=replace(second, pushed=coupling_to_previous(first, second))
                )
    return tuple(found)


def _of_one_tree(placed: PlacedConstraint, momenta: Sequence[Velocities]) -> bool:
    return len(set(placed.carriers)) == 1 and isinstance(momenta[placed.carriers[0]], GeneralizedVelocities)


def _with_precomputed(placed: PlacedConstraint) -> PlacedConstraint:
    contact = placed.constraint
    if not isinstance(contact, ContactConstraint) or contact.coupling is not None:
        return placed
    return replace(placed, constraint=replace(contact, precomputed=precompute(contact)))


def _on_tree_coordinate(constraint: VelocityConstraint) -> bool:
    return isinstance(constraint, CoordinateConstraint) and constraint.of_tree is not None


@traced
def _project_run(
    projections: tuple[tuple[VelocityConstraint, tuple[int, ...]], ...], states: AllVelocities, old: list[AnyImpulse]
) -> tuple[AllVelocities, list[AnyImpulse]]:
    """Project one constraint after the other, each given with the places of its bodies among the states."""
    momenta, given = list(states), list[AnyImpulse]()
    while len(given) < len(projections):
        first, after = len(given), projections[len(given) + 1 :]
        turn = [
            each for each, _ in (projections[first], *takewhile(lambda each: _uses_previous_change(each[0]), after))
        ]
        velocities = momenta[0]
        if len(turn) > 1 and isinstance(velocities, GeneralizedVelocities):  # all on one tree
            coordinates = [each for each in turn if isinstance(each, CoordinateConstraint)]
            momenta[0], news = project_sequentially(coordinates, velocities, old[first : first + len(turn)])
            given += news
            continue
        constraint, places = projections[first]
        moved, new = constraint.project(tuple(momenta[i] for i in places), old[first])
        given.append(new)
        for i, momentum in zip(places, moved, strict=True):
            momenta[i] = momentum
    return tuple(momenta), given


def _uses_previous_change(constraint: VelocityConstraint) -> bool:
    return isinstance(constraint, CoordinateConstraint) and constraint.pushed is not None
