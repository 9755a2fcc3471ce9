"""Newton's method on all constraints of a few bodies at once, before the sweeps.

Where several faces, wheels, feet or fingers carry a body, rigid bodies leave open how they share its load, and sweeps,
which take one constraint after the other, leave the share to their order: a symmetric machine then turns. And where
points lie close together against the size of their body, each undoes what the last one did, and ten sweeps do not
settle. So all constraints of such a group are linearised at the same velocities and solved together, in no order
(semi-smooth Newton; Alart and Curnier, A mixed formulation for frictional contact problems prone to Newton like
solution methods, Comput. Methods Appl. Mech. Engrg. 92, 1991). What the sweeps look for is then found, and is kept.

Each constraint says how its projection answers a change of velocities: d impulse = a - B J d velocities. With the mass
matrix M and the responses H to impulses, (M + M H B J) d velocities = M H a: a system as large as the group's
velocities, however many points there are. A rigid constraint would have an infinite B. With ``COMPLIANCE`` loads that
are open are those of least sum of squares; the last steps, about the loads that were found, take back what it gave way.
What a constraint answers is a law without its bodies, and J has only the columns that it depends on. So points on
different legs share their functions.

Such steps need not converge: bodies may be squeezed between two surfaces, and torsion, rolling and what friction does
to a coupled contact are left to the sweeps. So each step stays within a reach of energy, and the sweeps begin with the
iterate that misses least: from which projections of all constraints, each by itself, would change the least energy.

What it gives is continuous: where two iterates miss about as much their mean is taken, and near a bound the slope of a
constraint goes from one side to the other over a width that shrinks with what is missed, as in the Jacobian of Chen,
Qi and Sun (Global and superlinear convergence of the smoothing Newton method, Math. Comp. 67, 1998).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.factorisation import factorise
from symphys.dynamics.articulated.generalized_coordinates import mass_matrix
from symphys.dynamics.collision.contact_geometry import Displacement
from symphys.dynamics.contact.constraint import ContactConstraint
from symphys.dynamics.context import StepContext
from symphys.dynamics.joints.assembly import KinematicTrees
from symphys.dynamics.motion import PredictedMotion, apply
from symphys.dynamics.tracing.decorator import contiguous, shared, traced
from symphys.dynamics.tracing.pytree import TracedMatrix, outline
from symphys.dynamics.unknowns import (
    COMPLIANCE,
    AnyImpulse,
    GeneralizedVelocities,
    ImpulseLaw,
    Iterate,
    Linearisation,
    Momentum,
    PlacedConstraint,
    VelocityConstraint,
)
from symphys.maths.smoothing import clip
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Expr

State = Any
"""``Velocities`` of a carrier, or its displacement."""
States = tuple[State, ...]

CENTRE_SCHEDULE = 1, 1, 0, 0, 0
"""Centres of the steps: 1 for compliance about zero load, 0 about the loads found so far."""
MAX_GROUP_SIZE = 40
"""Velocities of a group that is solved at once."""
MAX_ENERGY_RATIO = 100.0
"""Largest energy of a step, as a multiple of the energies at its start."""
SLOPE_BLUR = 0.03
"""Width, as a share of the root of the residual energy, over which a constraint's slope changes sides at a bound."""
ACCEPT_RATIO, REJECT_RATIO = 0.25, 4.0
"""Ratio of an iterate's residual energy to the least so far up to which it replaces the best, and from which not."""
ROUNDING_SHARE = 1e-22
"""Residual energy that is rounding, as a share of the energies at hand."""
MIN_ENERGY = 1e-30
"""[J] the least that a step may reach, so that its slope is finite at rest."""


@dataclass(frozen=True)
class Group:
    """Bodies and trees that hang together, by where their velocities are kept, and all constraints on them.

    Attributes:
        carriers, constraints: by index.
        size: the number of velocities.
    """

    carriers: tuple[int, ...]
    constraints: tuple[int, ...]
    size: int


@dataclass(frozen=True)
class Lever:
    """Jacobian and impulse response of a constraint.

    Attributes:
        rates: (m, c) J, by the c velocities that it depends on.
        responses: (n, k) H, of the n velocities of its bodies to unit impulses.
        momenta: (n, k) M H.
    """

    rates: Expr
    responses: Expr
    momenta: Expr


@dataclass(frozen=True)
class Member:
    """A constraint of a group.

    Attributes:
        number: among all constraints.
        placed: the constraint.
        carriers: of its bodies, each once.
        law: it, without its bodies.
        lever: of it.
        rows, columns: where the velocities of its bodies, and those that it depends on, are among those of the group.
    """

    number: int
    placed: PlacedConstraint
    carriers: tuple[int, ...]
    law: ImpulseLaw
    lever: Lever
    rows: tuple[int, ...]
    columns: tuple[int, ...]


def solvable_groups(
    context: StepContext, constraints: Sequence[PlacedConstraint], states: Sequence[State]
) -> list[Group]:
    """Select the open groups that are small enough to be solved at once; none without ``newton_start``."""
    if not context.settings.scheme.newton_start:
        return []
    return [group for group in open_groups(context, constraints, states) if group.size <= MAX_GROUP_SIZE]


def open_groups(context: StepContext, constraints: Sequence[PlacedConstraint], states: Sequence[State]) -> list[Group]:
    """Select constraints whose loads may be undetermined, or whose points may lie close together."""
    members: dict[int, set[int]] = {k: {k} for k, state in enumerate(states) if state is not None}
    for each in constraints:
        together = set().union(*(members[k] for k in each.carriers))
        members |= dict.fromkeys(together, together)
    found = []
    for carriers in sorted({tuple(sorted(group)) for group in members.values()}):
        own = tuple(k for k, each in enumerate(constraints) if each.carriers[0] in carriers)
        size = sum(_size(states[k]) for k in carriers)
        jointed = any(isinstance(states[k], GeneralizedVelocities) for k in carriers)
        if _is_open(context.world, [constraints[k] for k in own], jointed, size):
            found.append(Group(carriers, own, size))
    return found


def _is_open(world: World, constraints: Sequence[PlacedConstraint], jointed: bool, size: int) -> bool:
    """Whether a body that is no ball has several points, or a tree more friction and load than it has velocities."""
    rigid = [each for each in constraints if _rigid(each.constraint)]
    balls = {k for k, body in enumerate(world.bodies) if all(shape.central for shape in body.shapes)}
    places = Counter(each.bodies for each in rigid if not balls.issuperset(each.bodies))
    several = any(count > 1 for count in places.values())
    return several or (jointed and len(rigid) > 1 and 3 * len(rigid) > size)


def _rigid(constraint: VelocityConstraint) -> bool:
    return isinstance(constraint, ContactConstraint) and not constraint.law.soft


def solve_together(
    group: Group,
    constraints: Sequence[PlacedConstraint],
    start: Iterate,
    trees: KinematicTrees,
    softness: Expr,
    centres: Sequence[int] = CENTRE_SCHEDULE,
) -> Iterate:
    """Return the start of the sweeps, with the constraints of a group solved.

    Args:
        group: of carriers.
        constraints: of all groups.
        start: velocities, or displacements, and impulses.
        trees: of the world.
        softness: of contacts; see ``contact_softness``.
        centres: of each step 1 if loads of that softness are counted from 0, 0 if from those that were found.
    """
    # lever of each constraint, residual energy of the start and its trust radius
    metric = _metric(trees, group.carriers, start.momenta)
    members = [_member(group, number, constraints[number], metric, start) for number in group.constraints]
    own = tuple(start.momenta[i] for i in group.carriers)
    seen = [_seen_by(each, start) for each in members]
    after = missed = _residual_energy(members, seen, start)
    reach = _trust_radius(metric, own, missed, len(members))
    # Newton steps; of two iterates the one of less residual energy is kept, between them a mean
    best = now = start
    for centre in centres:
        by = contiguous(Linearisation(softness, ca.SX(centre), _slope_width(after)), constants=True)
        now = _newton_step(metric, members, seen, now, by, reach)
        seen = [_seen_by(each, now) for each in members]
        after = _residual_energy(members, seen, now)
        share = _acceptance(after, missed, reach)
        best, missed = _blend(group, share, now, best), _mean(share, after, missed)
    return best


def _member(group: Group, number: int, placed: PlacedConstraint, metric: tuple[Expr, ...], start: Iterate) -> Member:
    carriers = tuple(dict.fromkeys(placed.carriers))
    sides = tuple(carriers.index(i) for i in placed.carriers)
    states = tuple(start.momenta[i] for i in carriers)
    masses = tuple(metric[group.carriers.index(i)] for i in carriers)
    rates, responses = _jacobians(placed.constraint, start.impulses[number], states, sides)
    # where its velocities are among those of the group
    sizes = [_size(start.momenta[i]) for i in group.carriers]
    firsts = dict(zip(group.carriers, accumulate(sizes, initial=0), strict=False))
    rows = tuple(firsts[i] + k for i, state in zip(carriers, states, strict=True) for k in range(_size(state)))
    used = _columns_of(rates)
    lever = Lever(_only_columns(rates, used), responses, _momenta(masses, responses))
    return Member(number, placed, carriers, placed.constraint.alone(), lever, rows, tuple(rows[k] for k in used))


def _columns_of(matrix: Expr) -> tuple[int, ...]:
    """Return the columns of a matrix that have entries."""
    leaf = matrix.leaf if isinstance(matrix, TracedMatrix) else outline(matrix)
    if leaf.pattern is None:
        return tuple(range(leaf.columns))
    return tuple(sorted({place // leaf.rows for place in leaf.pattern}))


@traced
def _only_columns(matrix: Expr, columns: tuple[int, ...]) -> Expr:
    return matrix[:, list(columns)]


def _seen_by(member: Member, now: Iterate) -> Expr:
    """Return what a constraint looks at."""
    return _seen(member.placed.constraint, tuple(now.momenta[i] for i in member.placed.carriers))


def _newton_step(
    metric: tuple[Expr, ...],
    members: Sequence[Member],
    seen: Sequence[Expr],
    now: Iterate,
    by: Linearisation,
    reach: Expr,
) -> Iterate:
    """Make a step of Newton's method, shortened so that it stays within ``reach`` [J]."""
    # linear response of each constraint: d impulse = a - B J d velocities
    momenta, impulses = list(now.momenta), list(now.impulses)
    answers = [
        _linear_response(each.law, each.lever, looked, impulses[each.number], by)
        for each, looked in zip(members, seen, strict=True)
    ]
    # (M + M H B J) d velocities = M H a
    parts = ((each.rows, each.columns, *part[:2]) for each, part in zip(members, answers, strict=True))
    changes = _velocity_changes(metric, tuple(parts))
    given = [
        _impulse_change(each.lever, a, b, _entries(changes, each.columns))
        for each, (_, _, a, b) in zip(members, answers, strict=True)
    ]
    # length of the step
    energies = tuple(_energy(each.lever, part) for each, part in zip(members, given, strict=True))
    share = _share(energies, reach)
    for each, part in zip(members, given, strict=True):
        states = tuple(momenta[i] for i in each.carriers)
        moved, impulses[each.number] = _advance(each.lever, part, share, states, impulses[each.number])
        for i, state in zip(each.carriers, moved, strict=True):
            momenta[i] = state
    return Iterate(tuple(momenta), tuple(impulses), tuple(impulses))


def _residual_energy(members: Sequence[Member], seen: Sequence[Expr], now: Iterate) -> Expr:
    """Return twice the energy [J] that a projection of each constraint would change, all from the same velocities."""
    found = (
        _residual(each.law, each.lever, looked, now.impulses[each.number])
        for each, looked in zip(members, seen, strict=True)
    )
    return _sum(tuple(found))


def _blend(group: Group, share: Expr, now: Iterate, best: Iterate) -> Iterate:
    """Blend a share of ``now`` with the rest of ``best``; velocities stay those of the impulses."""
    momenta, impulses = list(best.momenta), list(best.impulses)
    for i in group.carriers:
        momenta[i] = _mean_state(share, now.momenta[i], best.momenta[i])
    for k in group.constraints:
        impulses[k] = _mean_impulse(share, now.impulses[k], best.impulses[k])
    return Iterate(tuple(momenta), tuple(impulses), tuple(impulses))


def contact_softness(group: Group, constraints: Sequence[PlacedConstraint], trees: KinematicTrees) -> Expr:
    """Return a softness [1/kg] common to all contacts of a group, so that loads are shared by least squares."""
    rigid = (constraints[k] for k in group.constraints if _rigid(constraints[k].constraint))
    bodies = sorted({body for each in rigid for body in each.bodies})
    return _softness(tuple(trees.motions[body].mass for body in bodies))


def _size(state: State) -> int:
    return int(state.numbers.shape[0]) if isinstance(state, GeneralizedVelocities) else 6


def _metric(trees: KinematicTrees, carriers: Sequence[int], states: Sequence[State]) -> tuple[Expr, ...]:
    """Return the mass matrix of each carrier: kinetic energy by its velocities."""
    coordinates = dict(zip(trees.roots, trees.coordinates, strict=True))
    return tuple(
        mass_matrix(coordinates[k]) if k in coordinates else _of_body(trees.motions[k], states[k]) for k in carriers
    )


@traced
def _of_body(motion: PredictedMotion, state: State) -> Expr:
    """Return the mass matrix (6, 6) of a body by velocity and angular momentum, or by displacements."""
    turning = motion.inertia_mid if isinstance(state, Displacement) else apply(motion.inverse_mid, ca.SX.eye(3))
    return ca.diagcat(motion.mass * ca.SX.eye(3), turning)


@traced
def _softness(masses: tuple[Expr, ...]) -> Expr:
    return COMPLIANCE * sum(1 / mass for mass in masses) / len(masses)


@traced
def _jacobians(
    constraint: VelocityConstraint, impulse: AnyImpulse, states: States, sides: tuple[int, ...]
) -> tuple[Expr, Expr]:
    """Return J (m, n) and H (n, k) of a constraint."""
    sizes = [_size(state) for state in states]
    velocities = ca.SX.sym("v", sum(sizes))
    cut = _split_states(velocities, states)
    rates = ca.jacobian(constraint.rates(tuple(cut[k] for k in sides)), velocities)
    numbers = ca.SX.sym("p", impulse.count)
    at_rest = _split_states(ca.SX.zeros(sum(sizes)), states)
    after = constraint.apply(tuple(at_rest[k] for k in sides), impulse.like(numbers))
    by_carrier = dict(zip(sides, after, strict=True))
    responses = ca.jacobian(ca.vertcat(*(_flatten(by_carrier[k]) for k in range(len(states)))), numbers)
    return rates, responses


@shared
def _momenta(metric: tuple[Expr, ...], responses: Expr) -> Expr:
    return ca.mtimes(ca.diagcat(*metric), responses)


def _split_states(velocities: Expr, states: States) -> list[State]:
    """Return velocities of carriers, side by side, one by one."""
    found, start = list[State](), 0
    for state in states:
        end = start + _size(state)
        part, start = velocities[start:end], end
        if isinstance(state, GeneralizedVelocities):
            found.append(GeneralizedVelocities(part))
        else:
            found.append(
                Displacement(part[:3], part[3:]) if isinstance(state, Displacement) else Momentum(part[:3], part[3:])
            )
    return found


def _flatten(state: State) -> Expr:
    assert state is not None
    if isinstance(state, GeneralizedVelocities):
        return state.numbers
    return ca.vertcat(state.linear if isinstance(state, Displacement) else state.velocity, state.angular)


@shared
def _seen(constraint: VelocityConstraint, states: States) -> Expr:
    return constraint.seen(states)


@shared
def _linear_response(
    law: ImpulseLaw, lever: Lever, seen: Expr, old: AnyImpulse, by: Linearisation
) -> tuple[Expr, Expr, Expr, Expr]:
    """Return M H B J, M H a, a and B."""
    a, b = law.linearised(seen, old, by)
    return ca.mtimes(ca.mtimes(lever.momenta, b), lever.rates), ca.mtimes(lever.momenta, a), a, b


@traced
def _velocity_changes(
    metric: tuple[Expr, ...], parts: tuple[tuple[tuple[int, ...], tuple[int, ...], Expr, Expr], ...]
) -> Expr:
    """Return the changes of the velocities of a group, of one carrier after the other."""
    # matrix and right hand side of the group
    matrix: Expr = ca.diagcat(*metric)
    n = matrix.size1()
    right: Expr = ca.SX(n, 1)
    for rows, columns, block, load in parts:
        matrix[list(rows), list(columns)] += block
        right[list(rows)] += load
    # sparse elimination
    solved = factorise([{j: matrix[i, j] for j in range(n) if matrix.has_nz(i, j)} for i in range(n)])
    found = solved.solve({i: right[i] for i in range(n)})
    return ca.vertcat(*(found[i] for i in range(n)))


@traced
def _entries(column: Expr, places: tuple[int, ...]) -> Expr:
    return column[list(places), 0]


@shared
def _impulse_change(lever: Lever, a: Expr, b: Expr, changes: Expr) -> Expr:
    """Return the change of an impulse (k,)."""
    return a - ca.mtimes(b, ca.mtimes(lever.rates, changes))


@traced
def _trust_radius(metric: tuple[Expr, ...], states: States, missed: Expr, count: int) -> Expr:
    """Return the energy [J] that bounds a step, from that of the velocities and the sum of those of all projections."""
    velocities = ca.vertcat(*map(_flatten, states))
    energy = ca.fmax(ca.dot(velocities, ca.mtimes(ca.diagcat(*metric), velocities)), 0)
    return MAX_ENERGY_RATIO * (energy + count * missed) + MIN_ENERGY


@shared
def _energy(lever: Lever, given: Expr) -> Expr:
    return _energy_of(lever, given)


def _energy_of(lever: Lever, given: Expr) -> Expr:
    """Return twice the energy [J] that an impulse (k,) alone brings; rounding does not make it negative."""
    return ca.fmax(ca.dot(ca.mtimes(lever.responses, given), ca.mtimes(lever.momenta, given)), 0)


@traced
def _share(energies: tuple[Expr, ...], reach: Expr) -> Expr:
    """Return the length of a step, at most 1, for which each constraint's own change stays bounded."""
    return ca.sqrt(reach / ca.fmax(reach, sum(energies)))


@shared
def _advance(lever: Lever, given: Expr, share: Expr, momenta: States, old: AnyImpulse) -> tuple[States, AnyImpulse]:
    after = ca.vertcat(*map(_flatten, momenta)) + share * ca.mtimes(lever.responses, given)
    return tuple(_split_states(after, momenta)), old.plus(old.like(share * given))


@shared
def _residual(law: ImpulseLaw, lever: Lever, seen: Expr, old: AnyImpulse) -> Expr:
    return _energy_of(lever, law.response(seen, old).numbers - old.numbers)


@traced
def _sum(energies: tuple[Expr, ...]) -> Expr:
    return sum(energies)


@traced
def _slope_width(missed: Expr) -> Expr:
    return SLOPE_BLUR * ca.sqrt(missed + MIN_ENERGY)


@traced
def _acceptance(after: Expr, missed: Expr, reach: Expr) -> Expr:
    """Return the share of an iterate by its residual energy: 1 if far better than the best so far, 0 if far worse."""
    ratio = after / (missed + ROUNDING_SHARE * reach + MIN_ENERGY)
    return clip((REJECT_RATIO - ratio) / (REJECT_RATIO - ACCEPT_RATIO), 0, 1, 0)


@traced
def _mean(share: Expr, now: Expr, best: Expr) -> Expr:
    return now + (1 - share) * (best - now)


@traced
def _mean_state(share: Expr, now: State, best: State) -> State:
    return _split_states(_mean(share, _flatten(now), _flatten(best)), (best,))[0]


@shared
def _mean_impulse(share: Expr, now: AnyImpulse, best: AnyImpulse) -> AnyImpulse:
    return now.plus(best.minus(now).times(1 - share))
