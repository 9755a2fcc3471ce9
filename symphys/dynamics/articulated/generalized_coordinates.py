"""Generalized velocities of a kinematic tree, and their response to impulses (docs/time_step.md, equation 24).

Velocities are those at the middle of a substep and impulses act at its start, like those of joint constraints. A body's
velocity is its Jacobian, with arms at the middle, times the generalized velocities. Impulses of locked directions act
at the start on one point of both bodies, and do no work along the free motions of the start. So
sum of free_motion . (momentum - free momentum) = sum of free_motion . impulses,  free motions being those of the start,
holds whatever these impulses are: joints hold exactly, and the sweeps project contacts, motors and limits only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.dynamics.articulated import spatial
from symphys.dynamics.articulated.branches import Tree, TreeMatrix, TreeRates, axes_at, solve, tree_matrix, tree_motion
from symphys.dynamics.articulated.impulse_response import (
    BodyPlace,
    Numbering,
    Response,
    body_jacobians,
    coordinate_responses,
    numbering,
    scatter,
)
from symphys.dynamics.articulated.rotors import Rates, armatures, joint_rates, select_rotors
from symphys.dynamics.articulated.schur_complement import SpatialInertia, SpatialVector
from symphys.dynamics.motion import BodyJacobian, PredictedMotion, apply
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import GeneralizedVelocities, Momentum
from symphys.model.joints import KinematicTree
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class GeneralizedCoordinates:
    """A kinematic tree over a substep.

    Its generalized velocities are the rates r of the root, and for each branch z, its rates beside those with which it
    follows the root (``schur_complement``).

    Attributes:
        free: generalized velocities without any impulse of the substep.
        jacobians: of each link; None for bodies on which only the tree's own joints act.
        responses: of each coordinate to a unit impulse along it; None where nothing acts along it.
        tree, matrix: its motion subspaces and its mass matrix.
        bodies: at the time of the velocities.
    """

    free: GeneralizedVelocities
    jacobians: tuple[BodyJacobian | None, ...]
    responses: tuple[Response | None, ...]
    tree: Tree
    matrix: TreeMatrix
    bodies: tuple[BodyPlace, ...]


def generalized_coordinates(
    kinematic_tree: KinematicTree,
    joints: spatial.Joints,
    reached: Sequence[bool],
    motions: Sequence[PredictedMotion],
    free: Sequence[Momentum],
    middle: Expr,
    acting: Sequence[bool],
) -> GeneralizedCoordinates:
    """Return the coordinates of a tree.

    Args:
        kinematic_tree: the tree.
        joints: of its links, as are the other sequences.
        reached: whether anything but the tree's own joints acts on the body.
        motions: what the bodies do.
        free: their momenta without any impulse of the substep.
        middle: the time of the velocities [s].
        acting: whether anything acts along the coordinates of the link.
    """
    # motion subspaces at the times of velocities and of impulses
    origin = motions[0].position
    body_paths = [motion.predicted_path() for motion in motions]
    seen, given = (axes_at(kinematic_tree, joints, body_paths, t, origin) for t in (middle, ca.SX(0)))
    tree = Tree(kinematic_tree, seen, given, armatures(kinematic_tree, joints))
    # mass matrix, and generalized velocities of the free momenta (24)
    parts = [
        _body_at_mid_step(motion, momentum, origin, middle) for motion, momentum in zip(motions, free, strict=True)
    ]
    bodies, inertias, momenta = zip(*parts, strict=True)
    matrix = tree_matrix(tree, inertias)
    rates = _join_rates(numbering(tree), solve(tree, matrix, momenta, joint_rates(tree, joints, motions)))
    # Jacobians of bodies and responses of coordinates, where something acts
    places = [
        (motion.position - origin, body) if on else None
        for motion, body, on in zip(motions, bodies, reached, strict=True)
    ]
    jacobians = body_jacobians(tree, matrix, places)
    responses = coordinate_responses(tree, matrix, acting)
    return GeneralizedCoordinates(GeneralizedVelocities(rates), jacobians, responses, tree, matrix, bodies)


def body_momenta(coordinates: GeneralizedCoordinates, rates: Any) -> tuple[Momentum, ...]:
    """Return the momenta of the bodies of a tree from its generalized velocities."""
    return tuple(_momentum(*each) for each in zip(_tree_motion(coordinates, rates), coordinates.bodies, strict=True))


def rotor_rates(coordinates: GeneralizedCoordinates, rates: Any) -> Rates:
    """Return the rates of the links with rotors from the tree's generalized velocities."""
    numbers = split_rates(numbering(coordinates.tree), rates.numbers)
    return select_rotors(coordinates.tree, tree_motion(coordinates.tree, coordinates.matrix, numbers).rates)


def _tree_motion(coordinates: GeneralizedCoordinates, rates: Any) -> tuple[SpatialVector, ...]:
    return tree_motion(
        coordinates.tree, coordinates.matrix, split_rates(numbering(coordinates.tree), rates.numbers)
    ).screws


@traced
def _momentum(screw: SpatialVector, body: BodyPlace) -> Momentum:
    velocity, spin = spatial.at_place(screw.parts, body.place)
    return Momentum(velocity, apply(body.inertia, spin))


@traced
def _body_at_mid_step(
    motion: PredictedMotion, free: Momentum, origin: Expr, middle: Expr
) -> tuple[BodyPlace, SpatialInertia, SpatialVector]:
    """Return a body at mid-step, its inertia from velocities there to momenta at the start, and its free momentum.

    Of a frame only what acts on it counts.
    """
    counted, place, inertia = motion.position - origin, motion.centre().at(middle) - origin, motion.inertia_at(middle)
    if motion.massless:
        acted = free.velocity - motion.velocity, free.angular - motion.angular_velocity
        given = SpatialVector(spatial.about_origin(counted, *acted))
        return BodyPlace(place, inertia), SpatialInertia(ca.SX(6, 6)), given
    momentum = spatial.about_origin(counted, motion.mass * free.velocity, free.angular)
    return (
        BodyPlace(place, inertia),
        SpatialInertia(spatial.inertia_of(motion.mass, inertia, counted, place)),
        SpatialVector(momentum),
    )


@traced
def mass_matrix(coordinates: GeneralizedCoordinates) -> Expr:
    """Return the mass matrix (n, n) of a tree by its generalized velocities; root and branches are decoupled."""
    places, parts = numbering(coordinates.tree), coordinates.matrix
    n = coordinates.tree.kinematic_tree.size
    found = ca.SX(n, n)
    for own, block in zip(places, (parts.root, *(branch.block for branch in parts.branches)), strict=True):
        found[list(own), list(own)] = block.matrix()
    return found


@traced
def _join_rates(numbering: Numbering, rates: TreeRates) -> Expr:
    return scatter(numbering, (rates.r, *rates.z))


@traced
@traced
def split_rates(numbering: Numbering, numbers: Expr) -> TreeRates:
    """Return generalized velocities of a tree, by its root and branches."""
    r, *z = (numbers[list(each), 0] for each in numbering)
    return TreeRates(r, tuple(z))
