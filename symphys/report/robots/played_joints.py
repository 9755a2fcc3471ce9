"""What joints.js reads: joints, and which bodies the camera goes along with."""

from __future__ import annotations

import numpy as np

from symphys.report.robots.branches import linked
from symphys.report.robots.joint_positions import SQUARE, axes_of, drawable
from symphys.report.scene.views import reach
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

FAR = 2.5
"""The camera goes along where bodies that hang together travel farther than so many times their size."""


def joint_data(trajectory: Trajectory, scene: Scene) -> list[dict[str, object]]:
    """Both sides of each joint, index of the body (-1: the world) and point, and its axes: [side, direction]."""
    index = {name: body for body, name in enumerate(trajectory.body_names)} | {"": -1}
    return [
        {
            "sides": [
                {"body": index[name], "point": socket.point.round(6).tolist()}
                for name, socket in zip((joint.first, joint.second), joint.sockets, strict=True)
            ],
            "axes": [[side, direction.round(6).tolist()] for side, direction in axes_of(joint)],
            "square": joint.kind in SQUARE,
        }
        for joint in drawable(trajectory, scene)
    ]


def follow_data(trajectory: Trajectory, scene: Scene) -> dict[str, object] | None:
    """The bodies that hang together, how high they are on average, and how far they reach [m]; None if they stay."""
    bodies = list(linked(trajectory, scene))
    if not bodies:
        return None
    place = trajectory.position[:, bodies]
    middle = place.mean(axis=1)
    middle[:, 2] = middle[:, 2].mean()
    sizes = [reach(trajectory, scene, body) for body in bodies]
    radius = float((np.linalg.norm(place - middle[:, None], axis=2) + sizes).max())
    if np.ptp(middle, axis=0).max() <= FAR * 2 * radius:
        return None
    return {"bodies": bodies, "height": round(float(middle[0, 2]), 6), "radius": round(radius, 6)}
