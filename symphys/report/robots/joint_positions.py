"""Where joints are in a motion, and along which axes they move."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symphys.report.robots.branches import linked
from symphys.report.scene.views import centres, turn
from symphys.results.scene import Scene
from symphys.results.scene_joints import SceneJoint
from symphys.trajectory import Trajectory
from symphys.types import Array


def on_side(trajectory: Trajectory, joint: SceneJoint, side: int, vector: Array, shot: int, is_point: bool) -> Array:
    """Return a point or direction (3,) that one side of a joint carries, in the world."""
    name = joint.bodies[side] if side < len(joint.bodies) else ""
    if not name:
        return vector
    body = trajectory.body_names.index(name)
    turned = turn(trajectory.orientation[shot, body], vector)
    return trajectory.position[shot, body] + turned if is_point else turned


def drawable(trajectory: Trajectory, scene: Scene) -> list[SceneJoint]:
    """The joints whose bodies are in the motion."""
    return [joint for joint in scene.joints if set(joint.bodies) <= set(trajectory.body_names)]


def position(trajectory: Trajectory, joint: SceneJoint, shot: int) -> Array:
    """Return the position (3,) [m] of the first side, in the world."""
    return on_side(trajectory, joint, 0, joint.frames[0].point, shot, True)


def axes_of(joint: SceneJoint) -> list[tuple[int, Array]]:
    """The axes that are drawn: the side that carries each, and its direction (3,) in that side's frame."""
    return [(side, turn(joint.frames[side].orientation, np.eye(3)[k])) for side, k in joint.axes]


def bones(trajectory: Trajectory, scene: Scene, shot: int) -> Iterator[tuple[int, Array]]:
    """Yield a body and a line (2, 3) [m] from its centre to each of its joints, and to each solid beside it."""
    for joint in drawable(trajectory, scene):
        for side, name in enumerate(joint.bodies):
            body = trajectory.body_names.index(name)
            end = on_side(trajectory, joint, side, joint.frames[side].point, shot, True)
            yield body, np.array([trajectory.position[shot, body], end])
    for body in linked(trajectory, scene):
        for solid in scene.solids(trajectory.body_names[body]):
            if np.linalg.norm(solid.centre) > solid.girth:
                yield body, np.array([trajectory.position[shot, body], centres(trajectory, body, solid)[shot]])
