"""The frames of a [[joint]] table: from its point or anchors, its axes, and the bodies' start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from symphys.model.joints import JointFrame
from symphys.model.joints.frames import Pose, check_meeting, placed_joint_frames, pose, single_axis, two_axes
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.joints import JointTable
from symphys.types import Array


def read_joint_frames(
    place: Place, table: JointTable, initial: Mapping[str, Array], faults: Faults
) -> tuple[JointFrame, JointFrame]:
    """Of the second body in the table, whose coordinates count, then of the first; they coincide at the start.

    Args:
        place: of the table.
        table: what it holds together is known.
        initial: the state of bodies at the start; see ``Problem.initial``.
        faults: gets anchors that do not meet, axes that are none.
    """
    poses = [pose(name, initial) for name in reversed(table.between)]
    return placed_joint_frames(poses, read_points(place, table, poses, faults), read_axes(place, table, faults))


def read_points(place: Place, table: JointTable, poses: Sequence[Pose], faults: Faults) -> list[Array]:
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
    anywhere = table.slider is not None or table.fixed is not None
    if table.point is None and not anywhere:
        text = "this key is required: where the joint is at the start [m], world coordinates; or give anchors"
        faults.add((*place, "point"), text)
    point = poses[0].position if table.point is None else np.array(table.point)
    return [pose.to_body(point) for pose in poses]


def read_axes(place: Place, table: JointTable, faults: Faults) -> Array:
    """(3, 3): the axes of both frames at the start as columns, world frame."""
    if table.universal is not None:
        return noted((*place, "universal", "axes"), two_axes, table.universal.axes, faults)
    for key, single in (("hinge", table.hinge), ("slider", table.slider)):
        if single is not None:
            return noted((*place, key, "axis"), single_axis, single.axis, faults)
    return np.eye(3)


def noted(place: Place, axes: Callable[[Sequence[Any]], Array], given: Sequence[Any], faults: Faults) -> Array:
    """(3, 3): these axes; those of the world after a fault, which is noted."""
    try:
        return axes(given)
    except ValueError as fault:
        faults.add(place, str(fault))
        return np.eye(3)
