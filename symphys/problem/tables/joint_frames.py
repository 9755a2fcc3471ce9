"""Where the frames of a joint are: from its point or anchors, its axes, and the bodies' start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.joints import JointFrame
from symphys.problem.parametric.joints import WORLD
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.joints import JointTable

Array = NDArray[np.float64]
MEET = 1e-6
"""How far the anchors of a joint may be apart at the start [m]."""
SQUARE = 1e-6
"""Largest cosine of the angle between axes that count as perpendicular."""


@dataclass(frozen=True)
class Pose:
    """Where a body lies at the start: (3,) [m], and (3, 3) from its frame to the world's."""

    position: Array
    axes: Array

    def to_body(self, point: Array) -> Array:
        """(3,): a point of the world in the body's frame."""
        return np.asarray(self.axes.T @ (point - self.position))

    def to_world(self, point: Array) -> Array:
        """(3,): a point of the body in the world."""
        return np.asarray(self.position + self.axes @ point)


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
    points, axes = read_points(place, table, poses, faults), read_axes(place, table, faults)
    first, second = (
        JointFrame(tuple(point.tolist()), quaternion(pose.axes.T @ axes))
        for point, pose in zip(points, poses, strict=True)
    )
    return first, second


def pose(name: str, initial: Mapping[str, Array]) -> Pose:
    """Of a body at the start, or of the world."""
    if name == WORLD:
        return Pose(np.zeros(3), np.eye(3))
    turned = np.array(rotation.matrix(initial[f"{name}.orientation"]), float)
    return Pose(initial[f"{name}.position"], turned)


def read_points(place: Place, table: JointTable, poses: Sequence[Pose], faults: Faults) -> list[Array]:
    """(3,) on each side, in its own frame."""
    if table.anchors is not None:
        if table.point is not None:
            faults.add((*place, "point"), "anchors are given too; leave one out")
        anchors = [np.array(anchor) for anchor in reversed(table.anchors)]
        places = [pose.to_world(anchor) for pose, anchor in zip(poses, anchors, strict=True)]
        check_meeting((*place, "anchors"), places, faults)
        return anchors
    anywhere = table.slider is not None or table.fixed is not None
    if table.point is None and not anywhere:
        text = "this key is required: where the joint is at the start [m], world coordinates; or give anchors"
        faults.add((*place, "point"), text)
    point = poses[0].position if table.point is None else np.array(table.point)
    return [pose.to_body(point) for pose in poses]


def check_meeting(place: Place, places: Sequence[Array], faults: Faults) -> None:
    """Anchors must be in one place at the start."""
    distance = float(np.linalg.norm(places[0] - places[1]))
    if not distance <= MEET:
        first, second = (", ".join(f"{x:.6g}" for x in place) for place in reversed(places))
        text = f"are {distance:.6g} m apart at the start, at [{first}] and [{second}] in the world; they must meet"
        faults.add(place, f"{text}, to {MEET:g} m")


def read_axes(place: Place, table: JointTable, faults: Faults) -> Array:
    """(3, 3): the axes of both frames at the start as columns, world frame."""
    if table.universal is not None:
        return universal_axes((*place, "universal", "axes"), table.universal.axes, faults)
    for key, single in (("hinge", table.hinge), ("slider", table.slider)):
        if single is not None:
            x = unit((*place, key, "axis"), single.axis, faults)
            return np.eye(3) if x is None else about(x, np.eye(3)[np.argmin(np.abs(x))])
    return np.eye(3)


def universal_axes(place: Place, axes: Sequence[Sequence[float]], faults: Faults) -> Array:
    """(3, 3): y along the first axis, x along the second."""
    y, x = (unit(place, axis, faults) for axis in axes)
    if x is None or y is None:
        return np.eye(3)
    cosine = float(np.clip(x @ y, -1, 1))
    if abs(cosine) > SQUARE:
        angle = float(np.rad2deg(np.arccos(cosine)))
        faults.add(place, f"must be perpendicular; the angle between them is {angle:.6g} degrees")
        return np.eye(3)
    return about(x, y)


def about(x: Array, near: Array) -> Array:
    """(3, 3): right-handed axes as columns, the first along ``x``, the second as near to ``near`` as can be."""
    y = near - (near @ x) * x
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def unit(place: Place, axis: Sequence[float], faults: Faults) -> Array | None:
    """(3,) of length 1; None after a fault."""
    length = float(np.linalg.norm(axis))
    if not 1e-12 < length < np.inf:
        faults.add(place, "an axis must not be zero; [0, 0, 1] points up")
        return None
    return np.array(axis) / length


def quaternion(axes: Array) -> tuple[float, float, float, float]:
    """Unit w x y z of a rotation matrix (3, 3), by the largest of the four, so that nothing is lost to rounding."""
    xx, yy, zz = np.diag(axes)
    odd, even = axes - axes.T, axes + axes.T
    rows = np.array(
        [
            [1 + xx + yy + zz, odd[2, 1], odd[0, 2], odd[1, 0]],
            [odd[2, 1], 1 + xx - yy - zz, even[0, 1], even[0, 2]],
            [odd[0, 2], even[0, 1], 1 - xx + yy - zz, even[1, 2]],
            [odd[1, 0], even[0, 2], even[1, 2], 1 - xx - yy + zz],
        ]
    )
    row = rows[int(np.argmax(np.diag(rows)))]
    w, x, y, z = (row / np.linalg.norm(row)).tolist()
    return w, x, y, z
