"""Forward kinematics: final poses of a tree from joint to joint, so that all joints fit at any coordinates.

Rotations are quaternions from the start of the substep to its end, world frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.dynamics.articulated import spatial
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.joints.joint_frames import joint_frames_on, locked
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.model.joints import Joint, KinematicTree
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class FinalPose:
    """The final pose of a body: its centre of mass (3,), and its rotation (4,) since the start."""

    position: Expr
    turn: Expr


@dataclass(frozen=True)
class JointStart:
    """A joint at the start of a substep, world frame, from the parent of its link to the link.

    Attributes:
        arms: (3,) from the centres of mass of the parent, or the world's origin, and of the link's body.
        apart: (3,) from the second frame to the first, as far as it is free.
        axes: (3, count) about or along which free motions move the first side.
        righting: (4,) the rotation of the first side that brings back what is locked, to second order in its error.
    """

    arms: tuple[Expr, Expr]
    apart: Expr
    axes: Expr
    righting: Expr


WORLD_POSE = FinalPose(ca.SX.zeros(3), ca.SX([1, 0, 0, 0]))
"""The world."""


def joint_starts(
    kinematic_tree: KinematicTree, joints: spatial.Joints, body_paths: Sequence[PredictedPath]
) -> tuple[JointStart | None, ...]:
    """Return the start of the joint of each link; None for a floating root."""
    place, found = {link.body: k for k, link in enumerate(kinematic_tree.links)}, list[JointStart | None]()
    for link, joint, body_path in zip(kinematic_tree.links, joints, body_paths, strict=True):
        own = (body_path,) if link.parent is None else (body_path, body_paths[place[link.parent]])
        found.append(None if joint is None else _joint_start(joint, link.sign, own))
    return tuple(found)


def final_poses(
    kinematic_tree: KinematicTree,
    joints: spatial.Joints,
    starts: Sequence[JointStart | None],
    positions: Sequence[Expr],
    along: Sequence[Expr],
) -> tuple[FinalPose, ...]:
    """Return the displacement of each link's body; that of a floating root is (6,), along the world's axes."""
    place, found = {link.body: k for k, link in enumerate(kinematic_tree.links)}, list[FinalPose]()
    for link, joint, start, position, moved in zip(kinematic_tree.links, joints, starts, positions, along, strict=True):
        if joint is None or start is None:
            found.append(_free_pose(position, moved))
        else:
            parent = WORLD_POSE if link.parent is None else found[place[link.parent]]
            found.append(_pose_along_joint(joint, link.sign, start, parent, moved))
    return tuple(found)


@traced
def _joint_start(joint: Joint, sign: int, body_paths: tuple[PredictedPath, ...]) -> JointStart:
    now, frames = ca.SX(0), joint_frames_on(joint, body_paths if sign > 0 else body_paths[::-1])
    placed, arms = frames.placed(now), tuple(arm.at(now) for arm in frames.arms)
    directions, held = locked(joint, placed), joint.kind.held
    wrong: Expr = joint.kind.errors(placed)
    back = -ca.mtimes(directions.turns.T, wrong[held:, 0]) if joint.kind.turns else ca.SX(3, 1)
    apart = ca.SX(3, 1) if directions.slides is None else placed.apart - ca.mtimes(directions.slides.T, wrong[:held, 0])
    first = rotation.unit(ca.vertcat(1, back / 2)) if joint.kind.turns else WORLD_POSE.turn
    return JointStart((arms[1], arms[0]) if sign > 0 else (arms[0], arms[1]), apart, joint.kind.axes(placed), first)


@traced
def _free_pose(position: Expr, moved: Expr) -> FinalPose:
    return FinalPose(position + moved[:3], rotation.exponential(moved[3:]))


@traced
def _pose_along_joint(joint: Joint, sign: int, start: JointStart, parent: FinalPose, moved: Expr) -> FinalPose:
    turned, shift = joint.kind.transform(start.axes, moved)
    apart, turned = start.apart + shift, rotation.multiply(turned, start.righting)
    relative = turned if sign > 0 else ca.vertcat(turned[0], -turned[1:])
    turn = rotation.multiply(parent.turn, relative)
    above, own = start.arms
    # what slides goes along axes of the second side
    above, own = (above + apart, own) if sign > 0 else (above, own + apart)
    return FinalPose(parent.position + rotation.rotate(parent.turn, above) - rotation.rotate(turn, own), turn)
