"""Parallel projections: from which sides a motion is best seen, where its solids are, and how they look."""

from __future__ import annotations

import numpy as np

from symphys.records import dataclass
from symphys.results.polytope import flat_hull
from symphys.results.scene import Scene, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

NAMES = "xyz"
STILL_SHARE = 1e-3
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
        """Return the index of the world axis that is not seen."""
        return 3 - self.right - self.up

    @property
    def front(self) -> Array:
        """Return the direction (3,) towards the viewer."""
        up = np.eye(3)[self.up] * (-1 if self.down else 1)
        return np.cross(np.eye(3)[self.right], up)

    def flat(self, points: Array) -> Array:
        """Return the seen coordinates (..., 2) of (..., 3) points."""
        return points[..., [self.right, self.up]]


SIDE_XZ = View("Side view", 0, 2)
SIDE_YZ = View("Side view", 1, 2)
TOP = View("Top view", 0, 1)
TOP_TURNED = View("Top view", 1, 0, down=True)


def choose_views(trajectory: Trajectory, scene: Scene) -> list[View]:
    """Side view along the main horizontal direction and top view; without ground and height only the top view."""
    extent = np.ptp(trajectory.position, axis=0).max(axis=0)
    spread = np.ptp(trajectory.position, axis=(0, 1))
    least = STILL_SHARE * max(float(spread.max()), 1e-9)
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
    """Turn body-frame directions (..., 3) into the world by unit quaternions (..., 4), w x y z."""
    w, xyz = orientation[..., :1], orientation[..., 1:]
    cross = 2 * np.cross(xyz, direction)
    return direction + w * cross + np.cross(xyz, cross)


def centres(trajectory: Trajectory, body: int, solid: Solid) -> Array:
    """Return the path (N+1, 3) [m] of a solid's centre."""
    return trajectory.position[:, body] + turn(trajectory.orientation[:, body], solid.centre)


def corners(orientation: Array, solid: Solid) -> Array:
    """Return a solid's corners (..., k, 3) [m] from its centre, in the world, for orientations (..., 4) of its body."""
    return turn(orientation[..., None, :], turn(solid.orientation, solid.corners))


def half_axes(orientation: Array, solid: Solid) -> Array:
    """Return the half axes (..., 3, 3) [m] of the box around a solid's corners, as rows, in the world."""
    own = [half * turn(solid.orientation, axis) for half, axis in zip(solid.half, np.eye(3), strict=True)]
    return np.stack([turn(orientation, axis) for axis in own], axis=-2)


def solids_of(trajectory: Trajectory, scene: Scene, body: int) -> tuple[Solid, ...]:
    """Return the surface of a body; a point for one that has none."""
    return scene.solids(trajectory.body_names[body]) or (Solid(),)


def reach(trajectory: Trajectory, scene: Scene, body: int) -> float:
    """[m] from the body's centre to the farthest point of its surface; to its joints where it has no surface."""
    name = trajectory.body_names[body]
    sides = [side for joint in scene.joints for side in zip(joint.bodies, joint.frames, strict=False)]
    held = [float(np.linalg.norm(frame.point)) for whose, frame in sides if whose == name]
    return max([solid.reach for solid in scene.solids(name)] or held, default=0.0)


ARC_PIECES = 16
"""Straight pieces of a half circle."""
EDGE_ON = 1e-6
"""A face whose normal has less than this share of its length towards the viewer is seen from its edge."""


def outline(points: Array, radius: float) -> Array:
    """Return the outline (n, 2) of all within ``radius`` of the hull of (k, 2) projected corners, counter-clockwise."""
    corners = points[flat_hull(points, radius)]
    if len(corners) == 1:
        return corners + radius * directions(0.0, 2 * np.pi)[:-1]
    if radius == 0:
        return np.asarray(corners)
    edges = corners - np.roll(corners, 1, axis=0)  # an edge before each corner
    facing = np.arctan2(-edges[:, 0], edges[:, 1])
    turns = np.mod(np.roll(facing, -1) - facing, 2 * np.pi)
    arcs = [corner + radius * directions(a, a + by) for corner, a, by in zip(corners, facing, turns, strict=True)]
    return np.concatenate(arcs)


def directions(start: float, stop: float) -> Array:
    """Return unit vectors (n, 2) from one angle to another."""
    angles = np.linspace(start, stop, max(int(np.ceil(abs(stop - start) / np.pi * ARC_PIECES)), 1) + 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def inner_edges(orientation: Array, solid: Solid, front: Array) -> Array:
    """Return the edges (k, 2, 3) [m] between two faces that the viewer sees, from the solid's centre, in the world.

    Args:
        orientation: (4,) of the body.
        solid: a ball and a capsule have no edges.
        front: (3,) towards the viewer, of length 1.
    """
    polytope = solid.polytope
    normals, ends = (turn(orientation, turn(solid.orientation, own)) for own in (polytope.normals, solid.corners))
    seen = normals @ front > EDGE_ON
    between = polytope.edges[polytope.sharp & seen[polytope.edges[:, 2:]].all(axis=1), :2]
    return np.asarray(ends[between])
