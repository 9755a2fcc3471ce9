"""Where the bodies of a tree come to: from joint to joint, so that all joints fit whatever the coordinates are.

Rotations are quaternions from the start of the substep to its end, world frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.articulated import spatial
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.joints.joint_frames import errors, joint_frames_on, locked
from symphys.dynamics.tracing.decorator import traced
from symphys.maths import rotation
from symphys.model.joints import Joint, KinematicTree
from symphys.types import Expr


@dataclass(frozen=True)
class FinalPose:
    """Where a body comes to: (3,) its centre of mass, (4,) how it has turned since the start."""

    position: Expr
    turn: Expr


@dataclass(frozen=True)
class JointStart:
    """A joint at the start of a substep, world frame, from the parent of its link to the link.

    Attributes:
        arms: (3,) from the centres of mass of the parent, or the world's origin, and of the link's body.
        apart: (3,) from the second frame to the first, as far as it is free.
        axes: (3, count) about or along which coordinates move the first side.
        righting: (4,) the rotation of the first side that brings back what is locked, to second order in its error.
    """

    arms: tuple[Expr, Expr]
    apart: Expr
    axes: Expr
    righting: Expr


HERE = FinalPose(ca.SX.zeros(3), ca.SX([1, 0, 0, 0]))
"""The world."""


def joint_starts(
    kinematic_tree: KinematicTree, joints: spatial.Joints, body_paths: Sequence[PredictedPath]
) -> tuple[JointStart | None, ...]:
    """Of each link; None for a root that floats."""
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
    """Of each link's body, by how far its coordinates go; those of a floating root are (6,) along the world's axes."""
    place, found = {link.body: k for k, link in enumerate(kinematic_tree.links)}, list[FinalPose]()
    for link, joint, start, position, moved in zip(kinematic_tree.links, joints, starts, positions, along, strict=True):
        if joint is None or start is None:
            found.append(_floated(position, moved))
        else:
            parent = HERE if link.parent is None else found[place[link.parent]]
            found.append(_carried(joint, link.sign, start, parent, moved))
    return tuple(found)


@traced
def _joint_start(joint: Joint, sign: int, body_paths: tuple[PredictedPath, ...]) -> JointStart:
    now, frames = ca.SX(0), joint_frames_on(joint, body_paths if sign > 0 else body_paths[::-1])
    placed, arms = frames.placed(now), tuple(arm.at(now) for arm in frames.arms)
    directions, slides = locked(joint, placed), joint.kind.slides
    held = 3 if slides is None else len(slides)
    wrong: Expr = errors(joint, placed)
    back = -ca.mtimes(directions.turns.T, wrong[held:, 0]) if joint.kind.turns else ca.SX(3, 1)
    apart = ca.SX(3, 1) if directions.slides is None else placed.apart - ca.mtimes(directions.slides.T, wrong[:held, 0])
    free = spatial.free_motions_of(joint, placed)
    axes = ca.horzcat(ca.SX(3, 0), *(turn if _turns(joint, k) else slide for k, (slide, turn) in enumerate(free)))
    first = rotation.unit(ca.vertcat(1, back / 2)) if joint.kind.turns else HERE.turn
    return JointStart((arms[1], arms[0]) if sign > 0 else (arms[0], arms[1]), apart, axes, first)


def _turns(joint: Joint, k: int) -> bool:
    """Whether free motion ``k`` of a joint is a rotation."""
    return not joint.kind.coordinates or joint.kind.coordinates[k].turns


@traced
def _floated(position: Expr, moved: Expr) -> FinalPose:
    return FinalPose(position + moved[:3], rotation.exponential(moved[3:]))


@traced
def _carried(joint: Joint, sign: int, start: JointStart, parent: FinalPose, moved: Expr) -> FinalPose:
    apart, turned = start.apart, _turned(joint, start, moved)
    for k, coordinate in enumerate(joint.kind.coordinates):
        if not coordinate.turns:
            apart = apart + moved[k] * start.axes[:, k]
    relative = turned if sign > 0 else ca.vertcat(turned[0], -turned[1:])
    turn = rotation.multiply(parent.turn, relative)
    above, own = start.arms
    # what slides goes along axes of the second side
    above, own = (above + apart, own) if sign > 0 else (above, own + apart)
    return FinalPose(parent.position + rotation.rotate(parent.turn, above) - rotation.rotate(turn, own), turn)


def _turned(joint: Joint, start: JointStart, moved: Expr) -> Expr:
    """(4,): of the first side against the second, since the start."""
    if not joint.kind.coordinates:
        free = rotation.exponential(ca.mtimes(start.axes, moved)) if start.axes.size2() else HERE.turn
        return rotation.multiply(free, start.righting)
    order = sorted(range(len(joint.kind.coordinates)), key=lambda k: joint.kind.coordinates[k].fixed_in_first)
    found = HERE.turn
    for k in order:
        if joint.kind.coordinates[k].turns:
            found = rotation.multiply(found, _about(start.axes[:, k], moved[k]))
    return rotation.multiply(found, start.righting)


def _about(axis: Expr, angle: Expr) -> Expr:
    """(4,): the rotation about a unit axis."""
    return ca.vertcat(ca.cos(angle / 2), ca.sin(angle / 2) * axis)
