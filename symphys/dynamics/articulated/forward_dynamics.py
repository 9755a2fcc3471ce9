"""Trees of joints at one instant: accelerations under known forces, and velocities that fit the joints.

Forces of joints need not be known: they do nothing along the free motions of the instant, so that along these the rates
of change of momenta equal the other forces, and momenta those that velocities stand for.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.articulated import spatial
from symphys.dynamics.articulated.branches import Tree, TreeMotion, axes_at, solve, tree_matrix, tree_motion
from symphys.dynamics.articulated.rotors import armatures, joint_rates
from symphys.dynamics.articulated.schur_complement import SpatialInertia, SpatialVector, symmetric_copy
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.motion import PredictedMotion, in_world, inertia_matrix
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import Momentum
from symphys.maths import rotation
from symphys.model.joints import Joint, KinematicTree, Link
from symphys.model.scalar import is_zero
from symphys.types import Expr

Wrench = tuple[Expr, Expr]
"""Force [N] and torque [N m] about the centre of mass; also linear and angular acceleration."""
START = ca.SX(0)
ZERO_INERTIA = ca.SX(3, 3)
"""The inertia of a frame."""
_rotation = traced(rotation.matrix)


def accelerations(
    kinematic_tree: KinematicTree,
    joints: spatial.Joints,
    motions: Sequence[PredictedMotion],
    wrenches: Sequence[Wrench],
) -> tuple[Wrench, ...]:
    """Return the accelerations of a tree's bodies from poses, velocities and all forces but those of joints."""
    origin = motions[0].position
    axes = axes_at(kinematic_tree, joints, [m.predicted_path() for m in motions], START, origin)
    tree = Tree(kinematic_tree, axes, armature=armatures(kinematic_tree, joints))
    tensors = [ZERO_INERTIA if m.massless else world_inertia(m.inertia, m.rotation) for m in motions]
    bodies = [(m.counted_mass, tensor, m.position, origin) for m, tensor in zip(motions, tensors, strict=True)]
    matrix = tree_matrix(tree, [_inertia(*body) for body in bodies])
    momenta = [_momentum(*body, m.velocity, m.angular_velocity) for body, m in zip(bodies, motions, strict=True)]
    now = tree_motion(tree, matrix, solve(tree, matrix, momenta, joint_rates(tree, joints, motions)))
    biases = _biases(tree, joints, now)
    lacking = [
        _missing_force(*body, screw, bias, wrench)
        for body, screw, bias, wrench in zip(bodies, now.screws, biases, wrenches, strict=True)
    ]
    changes = tree_motion(tree, matrix, solve(tree, matrix, lacking)).screws
    return tuple(
        _accelerated(motion.position, origin, screw, bias, change)
        for motion, screw, bias, change in zip(motions, now.screws, biases, changes, strict=True)
    )


def consistent(
    kinematic_tree: KinematicTree,
    joints: spatial.Joints,
    inertials: Sequence[tuple[Expr, Expr]],
    poses: Sequence[tuple[Expr, Expr]],
    momenta: Sequence[Momentum],
    rates: Sequence[Expr | None],
) -> tuple[Wrench, ...]:
    """Return velocities and angular velocities that fit the joints and have the momenta along free motions.

    ``inertials``: mass and inertia of each body, 0 of a frame. ``rates``: of the joints with armature, whose rotors
    have momenta too.
    """
    zero, origin = ca.SX.zeros(3), poses[0][0]
    turned = [_rotation(q) for _, q in poses]
    still = (zero, zero, zero, zero, START, None, None)
    body_paths = [PredictedPath(p, r, *still) for (p, _), r in zip(poses, turned, strict=True)]
    axes = axes_at(kinematic_tree, joints, body_paths, START, origin)
    tree = Tree(kinematic_tree, axes, armature=armatures(kinematic_tree, joints))
    parts = list(zip(inertials, poses, turned, momenta, strict=True))
    tensors = (world_inertia(inertia, r) for (_, inertia), _, r, _ in parts)
    inertias = [_inertia(mass, t, p, origin) for ((mass, _), (p, _), *_), t in zip(parts, tensors, strict=True)]
    # what acts on a frame counts, though its mass does not
    counted = [_body_momentum(ca.SX(1) if is_zero(mass) else mass, p, origin, m) for (mass, _), (p, _), _, m in parts]
    matrix = tree_matrix(tree, inertias)
    moved = tree_motion(tree, matrix, solve(tree, matrix, counted, rates)).screws
    return tuple(_at_place(screw, p, origin) for screw, (p, _) in zip(moved, poses, strict=True))


@traced
def _inertia(mass: Expr, tensor: Expr, position: Expr, origin: Expr) -> SpatialInertia:
    place = position - origin
    return SpatialInertia(symmetric_copy(spatial.inertia_of(mass, tensor, place, place)))


@traced
def _momentum(mass: Expr, tensor: Expr, position: Expr, origin: Expr, velocity: Expr, spin: Expr) -> SpatialVector:
    return SpatialVector(spatial.about_origin(position - origin, mass * velocity, ca.mtimes(tensor, spin)))


@traced
def _body_momentum(mass: Expr, position: Expr, origin: Expr, momentum: Momentum) -> SpatialVector:
    return SpatialVector(spatial.about_origin(position - origin, mass * momentum.velocity, momentum.angular))


@traced
def _missing_force(
    mass: Expr, tensor: Expr, position: Expr, origin: Expr, screw: SpatialVector, bias: SpatialVector, wrench: Wrench
) -> SpatialVector:
    """Return the forces less those that the motion as it is needs."""
    place, w = position - origin, screw.parts[:3]
    linear, angular = _at(bias.parts, screw.parts, place)
    turning = ca.mtimes(tensor, angular) + ca.cross(w, ca.mtimes(tensor, w))
    return SpatialVector(spatial.about_origin(place, wrench[0] - mass * linear, wrench[1] - turning))


@traced
def _accelerated(
    position: Expr, origin: Expr, screw: SpatialVector, bias: SpatialVector, change: SpatialVector
) -> Wrench:
    return _at(change.parts + bias.parts, screw.parts, position - origin)


@traced
def _at_place(screw: SpatialVector, position: Expr, origin: Expr) -> Wrench:
    return spatial.at_place(screw.parts, position - origin)


def _biases(tree: Tree, joints: spatial.Joints, now: TreeMotion) -> list[SpatialVector]:
    """Return the rates of change (6,) of the bodies' spatial vectors while the coordinates' rates do not change."""
    place = {link.body: k for k, link in enumerate(tree.kinematic_tree.links)}
    found: list[SpatialVector] = []
    for k, (link, joint) in enumerate(zip(tree.kinematic_tree.links, joints, strict=True)):
        if joint is None:
            found.append(_floating_bias(now.screws[k]))
            continue
        parent = None if link.parent is None else place[link.parent]
        above, moved = (None, None) if parent is None else (found[parent], now.screws[parent])
        carriers = tuple(_axis_moves_with_child(link, joint, j) for j in range(link.count))
        found.append(_bias(carriers, tree.velocity_axes[k], now.rates[k], now.screws[k], moved, above))
    return found


@traced
def _floating_bias(screw: SpatialVector) -> SpatialVector:
    return SpatialVector(
        ca.vertcat(ca.SX.zeros(3), ca.cross(screw.parts[3:], screw.parts[:3]))
    )  # its centre is at the origin


@traced
def _bias(
    carriers: tuple[bool, ...],
    axes: Expr,
    rates: Expr,
    own: SpatialVector,
    parent: SpatialVector | None,
    above: SpatialVector | None,
) -> SpatialVector:
    total = ca.SX.zeros(6) if above is None else above.parts
    for j, by_child in enumerate(carriers):
        carrier = own if by_child else parent
        if carrier is not None:
            total = total + rates[j] * _axis_rate(carrier.parts, axes[:, j])
    return SpatialVector(total)


def _axis_moves_with_child(link: Link, joint: Joint, coordinate: int) -> bool:
    """Whether the axis of a coordinate is fixed in the link's body; else it is in the parent, or the world."""
    first = bool(joint.kind.coordinates) and joint.kind.coordinates[coordinate].fixed_in_first
    return first == (link.sign > 0)


def _axis_rate(carrier: Expr, screw: Expr) -> Expr:
    """Return how a spatial vector fixed in a body changes as the body moves (6,)."""
    w, v = carrier[:3], carrier[3:]
    return ca.vertcat(ca.cross(w, screw[:3]), ca.cross(w, screw[3:]) + ca.cross(v, screw[:3]))


def _at(change: Expr, screw: Expr, place: Expr) -> Wrench:
    """Return the accelerations of the centre of mass, at ``place``, from the rate of a spatial velocity."""
    velocity = spatial.at_place(screw, place)[0]
    return change[3:] + ca.cross(change[:3], place) + ca.cross(screw[:3], velocity), change[:3]


@traced
@traced
def world_inertia(inertia: Expr, turned: Expr) -> Expr:
    """Return the inertia (3, 3), world frame."""
    return in_world(inertia_matrix(inertia), turned)
