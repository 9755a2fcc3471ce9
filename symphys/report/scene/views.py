"""From which sides a motion is best seen, and where its solids are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

NAMES = "xyz"
STILL = 1e-3
"""A motion whose extent is below this share of the largest one counts as none."""


@dataclass(frozen=True)
class View:
    """A parallel projection along a world axis.

    Attributes:
        title: shown above it.
        right: index of the world axis that points to the right.
        up: index of the world axis that points up, or down if ``down``.
        down: whether it points down; keeps a top view of y-z motions from being mirrored.
    """

    title: str
    right: int
    up: int
    down: bool = False

    @property
    def depth(self) -> int:
        """Index of the world axis that is not seen."""
        return 3 - self.right - self.up

    @property
    def front(self) -> Array:
        """(3,): towards the viewer."""
        up = np.eye(3)[self.up] * (-1 if self.down else 1)
        return np.cross(np.eye(3)[self.right], up)

    def flat(self, points: Array) -> Array:
        """(..., 2): the seen coordinates of (..., 3) points."""
        return points[..., [self.right, self.up]]


SIDE_XZ = View("Side view", 0, 2)
SIDE_YZ = View("Side view", 1, 2)
TOP = View("Top view", 0, 1)
TOP_TURNED = View("Top view", 1, 0, down=True)


def choose_views(trajectory: Trajectory, scene: Scene) -> list[View]:
    """Side view along the main horizontal direction and top view; without ground and height only the top view."""
    extent = np.ptp(trajectory.position, axis=0).max(axis=0)
    spread = np.ptp(trajectory.position, axis=(0, 1))
    least = STILL * max(float(spread.max()), 1e-9)
    if max(extent[0], extent[1]) <= least:
        extent = spread
    has_floor = any(abs(plane.normal[2]) > 0.5 for plane in scene.planes) or scene.fixtures or scene.terrain
    along_x = extent[0] >= extent[1]
    if extent[2] <= least and not has_floor:
        return [TOP]
    side = SIDE_XZ if along_x else SIDE_YZ
    if max(extent[0], extent[1]) <= least:
        return [side]
    return [side, TOP if along_x else TOP_TURNED]


def turn(orientation: Array, direction: Array) -> Array:
    """(..., 3): a body-frame direction in the world, for unit quaternions (..., 4), w x y z."""
    w, xyz = orientation[..., :1], orientation[..., 1:]
    cross = 2 * np.cross(xyz, direction)
    return direction + w * cross + np.cross(xyz, cross)


def centres(trajectory: Trajectory, body: int, solid: Solid) -> Array:
    """(N+1, 3) [m]: the path of a solid's centre."""
    return trajectory.position[:, body] + turn(trajectory.orientation[:, body], solid.centre)


def corners(orientation: Array, solid: Solid) -> Array:
    """(..., k, 3) [m]: a solid's corners from its centre, in the world, for orientations (..., 4) of its body."""
    return turn(orientation[..., None, :], turn(solid.orientation, solid.corners))


def half_axes(orientation: Array, solid: Solid) -> Array:
    """(..., 3, 3) [m]: the half axes of the box around a solid's corners, as rows, in the world; see ``corners``."""
    own = [half * turn(solid.orientation, axis) for half, axis in zip(solid.half, np.eye(3), strict=True)]
    return np.stack([turn(orientation, axis) for axis in own], axis=-2)


def solids_of(trajectory: Trajectory, scene: Scene, body: int) -> tuple[Solid, ...]:
    """The surface of a body; a point for one that has none."""
    return scene.solids(trajectory.body_names[body]) or (Solid(),)


def reach(trajectory: Trajectory, scene: Scene, body: int) -> float:
    """[m] from the body's centre to the farthest point of its surface; to its joints where it has no surface."""
    name = trajectory.body_names[body]
    sides = [side for joint in scene.joints for side in zip(joint.bodies, joint.frames, strict=False)]
    held = [float(np.linalg.norm(frame.point)) for whose, frame in sides if whose == name]
    return max([solid.reach for solid in scene.solids(name)] or held, default=0.0)
