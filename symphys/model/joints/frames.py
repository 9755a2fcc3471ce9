"""The frames of a joint, from a point or anchors, from axes, and from the poses of the bodies.

A fault is a ValueError whose text completes the name of what is wrong: "must be perpendicular".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot

import numpy as np

from symphys.maths import rotation
from symphys.model.joints.joint import JointFrame
from symphys.records import dataclass
from symphys.types import Array

Vector = Sequence[float] | Array
WORLD = "world"
"""What joints call that which stands still."""
MEETING_TOLERANCE = 1e-6
"""How far the anchors of a joint may be apart at the start [m]."""
SQUARE_TOLERANCE = 1e-6
"""Largest cosine of the angle between axes that count as perpendicular."""


@dataclass(frozen=True)
class Pose:
    """The pose of a body: (3,) [m], and (3, 3) from its frame to the world's."""

    position: Array
    axes: Array

    def to_body(self, point: Array) -> Array:
        """(3,): a point of the world in the body's frame."""
        return np.asarray(self.axes.T @ (point - self.position))

    def to_world(self, point: Array) -> Array:
        """(3,): a point of the body in the world."""
        return np.asarray(self.position + self.axes @ point)


def pose(name: str, state: Mapping[str, Array]) -> Pose:
    """Return the pose of a body in a state by names such as ``ball.position``, or that of the world."""
    if name == WORLD:
        return Pose(np.zeros(3), np.eye(3))
    turned = np.array(rotation.matrix(state[f"{name}.orientation"]), float)
    return Pose(state[f"{name}.position"], turned)


def placed_joint_frames(poses: Sequence[Pose], points: Sequence[Array], axes: Array) -> tuple[JointFrame, JointFrame]:
    """The frames of the first and of the second side, which coincide where the bodies lie.

    Args:
        poses: of the first and of the second side.
        points: (3,) on each [m], in its own frame.
        axes: (3, 3) of both frames as columns, world frame.
    """
    first, second = (
        JointFrame(tuple(point.tolist()), quaternion(pose.axes.T @ axes))
        for point, pose in zip(points, poses, strict=True)
    )
    return first, second


def check_meeting(poses: Sequence[Pose], anchors: Sequence[Array]) -> None:
    """ValueError unless the anchors of the first and of the second side are in one place."""
    places = [pose.to_world(anchor) for pose, anchor in zip(poses, anchors, strict=True)]
    distance = float(np.linalg.norm(places[0] - places[1]))
    if not distance <= MEETING_TOLERANCE:
        first, second = (", ".join(f"{x:.6g}" for x in place) for place in reversed(places))
        text = f"are {distance:.6g} m apart at the start, at [{first}] and [{second}] in the world; they must meet"
        raise ValueError(f"{text}, to {MEETING_TOLERANCE:g} m")


def single_axis(axis: Vector) -> Array:
    """(3, 3): axes as columns, x along this one; of a hinge or a slider. ValueError for an axis of length 0."""
    x = unit(axis)
    return about(x, np.eye(3)[np.argmin(np.abs(x))])


def two_axes(axes: Sequence[Vector]) -> Array:
    """(3, 3): axes as columns, y along the first, x along the second; of a universal joint.

    ValueError for axes of length 0 or that are not perpendicular.
    """
    y, x = (unit(axis) for axis in axes)
    cosine = float(np.clip(x @ y, -1, 1))
    if abs(cosine) > SQUARE_TOLERANCE:
        angle = float(np.rad2deg(np.arccos(cosine)))
        raise ValueError(f"must be perpendicular; the angle between them is {angle:.6g} degrees")
    return about(x, y)


def about(x: Array, near: Array) -> Array:
    """(3, 3): right-handed axes as columns, the first along ``x``, the second as near to ``near`` as can be."""
    y = near - (near @ x) * x
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def unit(axis: Vector) -> Array:
    """(3,) of length 1; ValueError for one that is none."""
    if len(axis) != 3:
        raise ValueError(f"an axis has three numbers, not {len(axis)}; [0, 0, 1] points up")
    length = hypot(*axis)  # squares of large numbers overflow
    if not 1e-12 < length < np.inf:
        raise ValueError("an axis must not be zero; [0, 0, 1] points up")
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
