"""Restitution that adds no energy.

Newton's law, a rebound speed of e times the speed of approach, can add energy where friction acts on a body off its
centre (Kane's paradox; Stronge, Rigid body collisions with friction, Proc. R. Soc. A 431, 1990). A plastic impact never
does: with impulse P and velocities u after it, the change of energy is P . u - P . K P / 2, where P . u <= 0 since
friction opposes slip and nothing parts. What lies between the two is admissible, as cones are convex and the normal
velocities lie in between; of that the impulse nearest to Newton's that does not raise the kinetic energy is taken.
(Deviation from Stronge: his law bounds the work of the normal force alone.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.generalized_coordinates import rotor_rates
from symphys.dynamics.contact.constraint import ContactConstraint
from symphys.dynamics.context import StepContext
from symphys.dynamics.joints.assembly import KinematicTrees, momenta_of
from symphys.dynamics.motion import PredictedMotion, apply, inverse_inertia
from symphys.dynamics.pgs import iterate
from symphys.dynamics.tracing.decorator import contiguous, traced
from symphys.dynamics.unknowns import (
    AnyImpulse,
    GeneralizedVelocities,
    Iterate,
    Momentum,
    PlacedConstraint,
    Velocities,
)
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.world import World
from symphys.types import Expr


def eccentric_bodies(world: World) -> set[int]:
    """Return the bodies with contacts off the centre: on others no single impact with friction adds energy."""
    held = {index for joint in world.joints for index in joint.bodies}
    return held | {index for index, body in enumerate(world.bodies) if not all(shape.central for shape in body.shapes)}


def rebound(
    context: StepContext,
    constraints: tuple[PlacedConstraint, ...],
    start: Iterate,
    motions: Sequence[PredictedMotion],
    trees: KinematicTrees,
) -> Iterate:
    """Return the impulses of an impact, and the momenta after it."""
    scheme = context.settings.scheme
    if not (scheme.energy_cap and eccentric_bodies(context.world)):
        return iterate(context, constraints, start, trees)
    # two solutions: without restitution, and with Newton's law
    dead = tuple(replace(each, constraint=_without_rebound(each.constraint)) for each in constraints)
    plastic = iterate(context, dead, start, trees)
    between = replace(plastic, momenta=contiguous(plastic.momenta)) if context.near else plastic
    newton = iterate(context, constraints, between, trees)
    # kinetic energy along the way from the first to the second, rotors included
    sums: tuple[Expr, Expr, Expr] = (ca.SX(0), ca.SX(0), ca.SX(0))
    solutions = replace(start, momenta=trees.states), plastic, newton
    bodies = (momenta_of(context, trees, solution.momenta) for solution in solutions)
    for motion, *momenta in zip(motions, *bodies, strict=True):
        sums = sums if motion.massless else _energies(sums, motion, momenta)
    for tree, root in zip(trees.coordinates, trees.roots, strict=True):
        rates = (rotor_rates(tree, solution.momenta[root]) for solution in solutions)
        for armature, *turning in zip(tree.tree.armature, *rates, strict=True):
            sums = sums if armature is None else _rotor_energies(armature, turning, sums)
    # the largest share of the way that adds no energy (23)
    share = _largest_share(sums)
    return Iterate(
        tuple(_between_states(share, a, b) for a, b in zip(plastic.momenta, newton.momenta, strict=True)),
        tuple(_between(share, a, b) for a, b in zip(plastic.impulses, newton.impulses, strict=True)),
        tuple(_between(share, a, b) for a, b in zip(plastic.last, newton.last, strict=True)),
    )


@traced
def _without_rebound(constraint: Any) -> Any:
    if not isinstance(constraint, ContactConstraint):
        return constraint
    return replace(constraint, target=ca.fmin(constraint.target, 0))


@traced
def _energies(
    sums: tuple[Expr, Expr, Expr], motion: PredictedMotion, momenta: list[Momentum]
) -> tuple[Expr, Expr, Expr]:
    """Return a, b, c of the change of kinetic energy, a s^2 + b s + c, at share s of the way to Newton's impulse."""
    before, plastic, newton = momenta
    turning = inverse_inertia(motion.inertia, motion.rotation)

    def product(one: Momentum, other: Momentum) -> Expr:
        turn = ca.dot(one.angular, apply(turning, other.angular))
        return (motion.mass * ca.dot(one.velocity, other.velocity) + turn) / 2

    way = Momentum(newton.velocity - plastic.velocity, newton.angular - plastic.angular)
    a, b, c = sums
    change = product(plastic, plastic) - product(before, before)
    return a + product(way, way), b + 2 * product(way, plastic), c + change


@traced
def _rotor_energies(armature: Expr, rates: list[Expr], sums: tuple[Expr, Expr, Expr]) -> tuple[Expr, Expr, Expr]:
    """Add the energies of the rotors of a joint."""
    before, plastic, newton = rates
    (a, b, c), way, half = sums, newton - plastic, armature / 2
    change = ca.dot(plastic, plastic) - ca.dot(before, before)
    return a + half * ca.dot(way, way), b + 2 * half * ca.dot(way, plastic), c + half * change


@traced
def _largest_share(sums: tuple[Expr, Expr, Expr]) -> Expr:
    """Return the largest s in [0, 1] with a s^2 + b s + c <= 0, where c <= 0 up to rounding."""
    a, b, c = sums[0], sums[1], ca.fmin(sums[2], 0)
    root = ca.sqrt(ca.fmax(b * b - 4 * a * c, 0) + TINY_SQUARE)
    share = ca.if_else(b >= 0, -2 * c / (ca.fmax(b, 0) + root), (root - b) / (2 * a + TINY_SQUARE))
    return ca.if_else(a + b + c > 0, ca.fmin(share, 1), 1)


@traced
def _between_states(share: Expr, plastic: Velocities, newton: Velocities) -> Velocities:
    if plastic is None or newton is None:
        return None
    if isinstance(plastic, GeneralizedVelocities):
        assert isinstance(newton, GeneralizedVelocities)
        return GeneralizedVelocities(plastic.numbers + share * (newton.numbers - plastic.numbers))
    assert isinstance(newton, Momentum)
    return Momentum(
        plastic.velocity + share * (newton.velocity - plastic.velocity),
        plastic.angular + share * (newton.angular - plastic.angular),
    )


@traced
def _between(share: Expr, plastic: AnyImpulse, newton: AnyImpulse) -> AnyImpulse:
    return plastic.plus(newton.minus(plastic).times(share))
