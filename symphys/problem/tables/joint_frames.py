"""The frames of a [[joint]] table: from its point or anchors, its axes, and the bodies' start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symphys.model.joints import JointFrame, JointSpec
from symphys.model.joints.frames import Pose, check_meeting, placed_joint_frames, pose
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.joints import JointTable
from symphys.types import Array


def read_joint_frames(
    place: Place, table: JointTable, spec: JointSpec, word: str, initial: Mapping[str, Array], faults: Faults
) -> tuple[JointFrame, JointFrame]:
    """Return the frames of the table's second body, whose coordinates count, then of the first.

    Args:
        place: of the table.
        table: what it holds together is known.
        spec: the same joint, of its kind.
        word: the key of the table of its kind.
        initial: the state of bodies at the start; see ``Problem.initial``.
        faults: gets anchors that do not meet, axes that are none.
    """
    poses = [pose(name, initial) for name in reversed(table.between)]
    try:
        axes = spec.frame_axes
    except ValueError as fault:
        faults.add((*place, word, spec.own_fields()[0].name), str(fault))
        axes = np.eye(3)
    return placed_joint_frames(poses, read_points(place, table, spec, poses, faults), axes)


def read_points(place: Place, table: JointTable, spec: JointSpec, poses: Sequence[Pose], faults: Faults) -> list[Array]:
    """(3,) on each side, in its own frame."""
    if table.anchors is not None:
        if table.point is not None:
            faults.add((*place, "point"), "anchors are given too; leave one out")
        anchors = [np.array(anchor) for anchor in reversed(table.anchors)]
        try:
            check_meeting(poses, anchors)
        except ValueError as fault:
            faults.add((*place, "anchors"), str(fault))
        return anchors
    if table.point is None and not spec.anywhere:
        text = "this key is required: where the joint is at the start [m], world coordinates; or give anchors"
        faults.add((*place, "point"), text)
    point = poses[0].position if table.point is None else np.array(table.point)
    return [pose.to_body(point) for pose in poses]
