"""Longer steps of the sweeps, where a heavy body rests on a light one.

Gauss-Seidel goes to the answer by steps of a geometric series, of ratio 1 - m/M where a mass M rests on m: a thousand
sweeps where the masses are a thousand to one. All of the series points one way. So now and then the change of the last
sweep is repeated as often as lowers the kinetic energy most (less the work that targets ask for), which the answer
minimises: an exact line search along the last change, as in the conjugate gradients of Renouf and Alart, Conjugate
gradient type algorithms for frictional multi-contact problems (Comput. Methods Appl. Mech. Engrg. 194, 2005). No normal
impulse may become negative on the way. Deviation: plain sweeps in between, which project and go round less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.motion import PredictedMotion, apply
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import Iterate, Momentum, PlacedConstraint, Velocities
from symphys.model.world import UNEQUAL, World
from symphys.types import Expr

EVERY = 4
"""Sweeps between two longer steps."""
LONGEST = 1e4
"""Times the last change."""
TINY = 1e-100
"""[N s] whose inverse square is still a number: slopes are finite where nothing falls."""
SETTLED = 1e-10
"""[m/s] changes of velocity below which nothing is repeated."""


@dataclass(frozen=True)
class Cluster:
    """Bodies without joints that may lean on each other, and their constraints, by index."""

    bodies: tuple[int, ...]
    constraints: tuple[int, ...]


def clusters(world: World, constraints: Sequence[PlacedConstraint]) -> list[Cluster]:
    """Those of bodies that differ much in mass, or may: where a symbol decides it."""
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
    """The representative of a body's group."""
    while roots[k] != k:
        roots[k] = roots[roots[k]]
        k = roots[k]
    return k


def _unequal(world: World, group: set[int]) -> bool:
    masses = [ca.SX(world.bodies[k].mass) for k in group]
    if len(group) > 1 and not all(mass.is_constant() for mass in masses):
        return True
    return max(map(float, masses)) > UNEQUAL * min(map(float, masses)) if len(group) > 1 else False


def lengthened(
    cluster: Cluster,
    constraints: Sequence[PlacedConstraint],
    motions: Sequence[PredictedMotion],
    before: Iterate,
    now: Iterate,
) -> Iterate:
    """The solution after the change of the last sweep, from ``before`` to ``now``, is repeated in part."""
    sums: tuple[Expr, Expr] = (ca.SX(0), ca.SX(0))
    longest: Expr = ca.SX(LONGEST)
    for k in cluster.bodies:
        sums = _of_body(sums, motions[k], now.momenta[k], before.momenta[k])
    for k in cluster.constraints:
        sums, longest = _of_constraint(sums, longest, constraints[k].constraint, now.impulses[k], now.last[k])
    share = _share(sums, longest)
    momenta, impulses = list(now.momenta), list(now.impulses)
    for k in cluster.bodies:
        momenta[k] = _repeated(share, now.momenta[k], before.momenta[k])
    for k in cluster.constraints:
        impulses[k] = _given_again(share, now.impulses[k], now.last[k])
    return replace(now, momenta=tuple(momenta), impulses=tuple(impulses))


@traced
def _of_body(
    sums: tuple[Expr, Expr], motion: PredictedMotion, now: Velocities, before: Velocities
) -> tuple[Expr, Expr]:
    """(what the energy responses along the change, its curvature), with a body's share."""
    assert isinstance(now, Momentum) and isinstance(before, Momentum)
    moved, turned = now.velocity - before.velocity, now.angular - before.angular
    spun = apply(motion.inverse_mid, turned)
    slope = motion.mass * ca.dot(now.velocity, moved) + ca.dot(now.angular, spun)
    settled = motion.mass * SETTLED**2
    return sums[0] + slope, sums[1] + motion.mass * ca.dot(moved, moved) + ca.dot(turned, spun) + settled


@traced
def _of_constraint(
    sums: tuple[Expr, Expr], longest: Expr, constraint: ContactConstraint, now: ContactImpulse, before: ContactImpulse
) -> tuple[tuple[Expr, Expr], Expr]:
    """The same less what the constraint's targets ask for; how often the change can be repeated."""
    press = now.normal - before.normal
    asked = constraint.target * press + ca.dot(constraint.slip_target, now.tangent - before.tangent)
    slope = sums[0] - asked + constraint.softness * now.normal * press
    falls = ca.if_else(press < 0, now.normal / ca.fmax(-press, TINY), LONGEST)
    return (slope, sums[1] + constraint.softness * press * press), ca.fmin(longest, falls)


@traced
def _share(sums: tuple[Expr, Expr], longest: Expr) -> Expr:
    return ca.fmin(ca.fmax(-sums[0] / sums[1], 0), longest)


@traced
def _repeated(share: Expr, now: Velocities, before: Velocities) -> Momentum:
    assert isinstance(now, Momentum) and isinstance(before, Momentum)
    return Momentum(
        now.velocity + share * (now.velocity - before.velocity), now.angular + share * (now.angular - before.angular)
    )


@traced
def _given_again(share: Expr, now: ContactImpulse, before: ContactImpulse) -> ContactImpulse:
    return now.plus(now.minus(before).times(share))
