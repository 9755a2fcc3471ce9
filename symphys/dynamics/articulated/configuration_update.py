"""The end of a substep for a tree: poses that fit its joints, and the momenta that getting there stands for.

Displacements along the coordinates at mid-step leave the joints open by what is of third order in the step. Poses come
from joint to joint instead (``kinematics``), and coordinates are corrected until what that adds to displacements, as
momenta, does nothing along the free motions of the start, as forces of joints do nothing along them (SHAKE in
coordinates). The matrix is the tree's own, so that bodies that are light to turn are as well off as others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from symphys.dynamics.articulated import spatial
from symphys.dynamics.articulated.branches import TreeRates, solve, tree_motion
from symphys.dynamics.articulated.forward_kinematics import FinalPose, final_poses, joint_starts
from symphys.dynamics.articulated.generalized_coordinates import GeneralizedCoordinates, split_rates
from symphys.dynamics.articulated.impulse_response import BodyPlace, numbering
from symphys.dynamics.articulated.rotors import Rates, select_rotors
from symphys.dynamics.articulated.schur_complement import Columns, SpatialVector
from symphys.dynamics.motion import PredictedMotion
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import GeneralizedVelocities, Momentum
from symphys.maths import rotation
from symphys.model.joints import KinematicTree
from symphys.records import dataclass
from symphys.types import Expr

CORRECTION_STEPS = 2
"""Each leaves an error smaller by the angle of a step."""


@dataclass(frozen=True)
class JointCorrection:
    """Change of a body's displacement by joints, as momenta times a time: a displacement, inertia times a rotation.

    Attributes:
        by_tree: the joints of its tree.
        by_loops: joints that close loops, if there are any.
    """

    by_tree: Momentum
    by_loops: Momentum | None = None


@dataclass(frozen=True)
class Deviation:
    """Deviation of a body's displacement from that along the coordinates.

    Attributes:
        made: as a momentum times a time, see ``JointCorrection``.
        screw: (6,) the same about the origin at the start.
    """

    made: Momentum
    screw: SpatialVector


NO_DEVIATION = Deviation(Momentum(ca.SX.zeros(3), ca.SX.zeros(3)), SpatialVector(ca.SX(6, 1)))
"""The deviation of a frame, which has no mass."""


@dataclass(frozen=True)
class RotorCorrection:
    """Change of the displacements of rotors by joints: of each link (count,) [rad] or [m], None without a rotor.

    Attributes:
        by_tree: the joints of the tree.
        by_loops: joints that close loops, if there are any.
    """

    by_tree: Rates
    by_loops: Rates | None = None


@dataclass(frozen=True)
class TargetPose:
    """The pose along the displacement: (3,) centre of mass, (3,) rotation vector, (4,) its inverse rotation."""

    position: Expr
    angular: Expr
    back: Expr


def update_configuration(
    kinematic_tree: KinematicTree,
    joints: spatial.Joints,
    coordinates: GeneralizedCoordinates,
    motions: Sequence[PredictedMotion],
    along: GeneralizedVelocities,
    by_loops: GeneralizedVelocities | None,
) -> tuple[tuple[FinalPose, ...], tuple[JointCorrection, ...], RotorCorrection, Columns]:
    """Return the final poses of a tree, and the joints' changes of its displacements and of its rotors'.

    The last result is how far the coordinates of each link moved (count,) [rad] or [m].

    ``along``: displacements along the tree's numbers; ``by_loops``: what of them joints that close loops did.
    """
    # displacements along the coordinates at mid-step, and the poses that they aim at
    places, tree, matrix = [motion.position for motion in motions], coordinates.tree, coordinates.matrix
    starts = joint_starts(kinematic_tree, joints, [motion.predicted_path() for motion in motions])
    numbers = split_rates(numbering(tree), along.numbers)
    moved = tree_motion(tree, matrix, numbers)
    aims = [_target_pose(*each) for each in zip(moved.screws, coordinates.bodies, places, strict=True)]
    # poses from joint to joint, with coordinates corrected until the deviation does nothing along free motions
    bodies = [(motion.counted_mass, motion.position - places[0]) for motion in motions]
    frames = [motion.massless for motion in motions]
    wanted = turned = select_rotors(tree, moved.rates)
    for k in range(CORRECTION_STEPS + 1):
        arrived = final_poses(kinematic_tree, joints, starts, places, moved.rates)
        beside = tuple(
            NO_DEVIATION if frame else _deviation(*body, placed, aim, at)
            for frame, body, placed, aim, at in zip(frames, bodies, coordinates.bodies, aims, arrived, strict=True)
        )
        turned = _rate_differences(select_rotors(tree, moved.rates), wanted)
        if k < CORRECTION_STEPS:
            numbers = _subtract_rates(numbers, solve(tree, matrix, [each.screw for each in beside], turned))
            moved = tree_motion(tree, matrix, numbers)
    # conservation to rounding, then what joints and loops did to displacements
    arrived, beside = _conserve_momentum(coordinates, joints[0] is None, bodies, arrived, beside, turned[0])
    if by_loops is None:
        return arrived, tuple(JointCorrection(each.made) for each in beside), RotorCorrection(turned), moved.rates
    loops = tree_motion(tree, matrix, split_rates(numbering(tree), by_loops.numbers))
    made = tuple(
        JointCorrection(each.made, NO_DEVIATION.made) if frame else _joint_correction(each, placed, screw)
        for frame, each, placed, screw in zip(frames, beside, coordinates.bodies, loops.screws, strict=True)
    )
    return arrived, made, RotorCorrection(turned, select_rotors(tree, loops.rates)), moved.rates


def _rate_differences(after: Rates, before: Rates) -> Rates:
    return tuple(None if a is None or b is None else a - b for a, b in zip(after, before, strict=True))


@traced
def _subtract_rates(numbers: TreeRates, by: TreeRates) -> TreeRates:
    return TreeRates(numbers.r - by.r, tuple(a - b for a, b in zip(numbers.z, by.z, strict=True)))


def _conserve_momentum(
    coordinates: GeneralizedCoordinates,
    floats: bool,
    bodies: Sequence[tuple[Expr, Expr]],
    arrived: Sequence[FinalPose],
    beside: Sequence[Deviation],
    rotor: Expr | None,
) -> tuple[tuple[FinalPose, ...], tuple[Deviation, ...]]:
    """Remove momentum along the root's coordinates, so that conservation holds to rounding.

    A tree that floats is shifted; else, and for spin, the root's share of momenta changes: of momenta only those along
    free motions count in the end (``forward_dynamics.consistent``), so it does not matter whose they are.
    """
    total, mass = _total_momentum(tuple(each.screw for each in beside), tuple(mass for mass, _ in bodies))
    if floats:
        moved = [_shift_body(*each, total, mass) for each in zip(bodies, arrived, beside, strict=True)]
        # what has no mass moves along, and has no momentum
        moved = [
            (pose, NO_DEVIATION if was is NO_DEVIATION else more)
            for (pose, more), was in zip(moved, beside, strict=True)
        ]
        arrived, beside = (tuple(each) for each in zip(*moved, strict=True))
        total = _total_momentum(tuple(each.screw for each in beside), ())[0]
    rotor = None if rotor is None else coordinates.tree.armature[0] * rotor
    mass_of_root = ca.SX(1) if beside[0] is NO_DEVIATION else bodies[0][0]
    root = _remove_root_momentum(beside[0], coordinates.tree.impulses[0], total, mass_of_root, floats, rotor)
    return tuple(arrived), (root, *beside[1:])


@traced
def _total_momentum(screws: tuple[SpatialVector, ...], masses: tuple[Expr, ...]) -> tuple[SpatialVector, Expr]:
    return SpatialVector(sum(each.parts for each in screws)), sum(masses)


@traced
def _shift_body(
    body: tuple[Expr, Expr], arrived: FinalPose, beside: Deviation, total: SpatialVector, mass: Expr
) -> tuple[FinalPose, Deviation]:
    by = total.parts[3:] / mass
    screw = beside.screw.parts - spatial.about_origin(body[1], body[0] * by, ca.SX.zeros(3))
    made = replace(beside.made, velocity=beside.made.velocity - by)
    return replace(arrived, position=arrived.position - by), Deviation(made, SpatialVector(screw))


@traced
def _remove_root_momentum(
    beside: Deviation, axes: Expr, total: SpatialVector, mass: Expr, floats: bool, rotor: Expr | None
) -> Deviation:
    """Return orthogonal directions of conserved momentum, about turning and along sliding axes."""
    if floats:
        return replace(beside, made=replace(beside.made, angular=beside.made.angular - total.parts[:3]))
    made, along = beside.made, ca.mtimes(axes.T, total.parts) + (0 if rotor is None else rotor)
    for k in range(axes.size2()):
        if axes[:3, k].nnz():
            made = replace(made, angular=made.angular - axes[:3, k] * along[k])
        else:
            made = replace(made, velocity=made.velocity - axes[3:, k] * along[k] / mass)
    return replace(beside, made=made)


@traced
def _joint_correction(beside: Deviation, placed: BodyPlace, loops: SpatialVector) -> JointCorrection:
    linear, angular = spatial.at_place(loops.parts, placed.place)
    return JointCorrection(beside.made, Momentum(linear, ca.mtimes(placed.inertia, angular)))


@traced
def _target_pose(screw: SpatialVector, placed: BodyPlace, position: Expr) -> TargetPose:
    linear, angular = spatial.at_place(screw.parts, placed.place)
    return TargetPose(position + linear, angular, rotation.exponential(-angular))


@traced
def _deviation(mass: Expr, counted: Expr, placed: BodyPlace, aim: TargetPose, arrived: FinalPose) -> Deviation:
    linear = arrived.position - aim.position
    more = rotation.multiply(arrived.turn, aim.back)
    small = 2 * ca.if_else(more[0] < 0, -more[1:4], more[1:4])
    # added to a rotation vector, to second order in that
    spin = ca.mtimes(placed.inertia, small - ca.cross(aim.angular, small) / 2)
    return Deviation(Momentum(linear, spin), SpatialVector(spatial.about_origin(counted, mass * linear, spin)))
