"""Rods and joints between them, and what must hold of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from symphys.model.joints import HINGE, Joint, JointFrame
from symphys.model.world import Body, World
from symphys.types import Array

HALF = float(np.sqrt(0.5))
ABOUT_Y, ABOUT_Z = (HALF, 0.0, 0.0, HALF), (HALF, 0.0, -HALF, 0.0)
"""Orientations of frames whose x axis is that of the body's y, or z."""


def rod(name: str, length: float = 0.5, mass: Any = 1.0) -> Body:
    """Along z, without a surface; thick enough to have a moment about its axis."""
    across = mass * length**2 / 12
    return Body(name, mass, (across, across, 1e-3 * mass))


def chain(count: int, length: float = 0.5, free: bool = False, **each: Any) -> World:
    """Rods that hang from each other by hinges about y, the first from the world's origin, or from nothing."""
    joints = []
    for k in range(count):
        if k == 0 and free:
            continue
        above = JointFrame((0, 0, -length / 2 if k else 0), ABOUT_Y)
        joints.append(
            Joint(f"j{k}", HINGE, k, k - 1 if k else None, (JointFrame((0, 0, length / 2), ABOUT_Y), above), **each)
        )
    return World(tuple(rod(f"b{k}", length) for k in range(count)), joints=tuple(joints))


def hanging(count: int, angles: list[float], length: float = 0.5) -> dict[str, Any]:
    """Where the rods of a chain are, turned about y by these angles from straight down."""
    values, top = dict[str, Any](), np.zeros(3)
    for k in range(count):
        down = -np.array([np.sin(angles[k]), 0, np.cos(angles[k])])
        values[f"b{k}.position"], top = top + down * length / 2, top + down * length
        values[f"b{k}.orientation"] = [np.cos(angles[k] / 2), 0, np.sin(angles[k] / 2), 0]
    return values


def turned(q: Array, vector: Any) -> Array:
    """(N, 3): a body-frame vector in the world, for orientations (N, 4) w x y z."""
    return np.asarray(Rotation.from_quat(q, scalar_first=True).apply(vector))


def separations(world: World, states: dict[str, Array]) -> Array:
    """(N, joints) [m]: how far the two frames of each joint are apart."""
    found = []
    for joint in world.joints:
        ends = []
        for index, frame in zip((joint.first, joint.second), joint.frames, strict=True):
            if index is None:
                ends.append(np.asarray(frame.point, float)[None])
                continue
            name = world.bodies[index].name
            ends.append(states[f"{name}.position"] + turned(states[f"{name}.orientation"], frame.point))
        found.append(np.linalg.norm(ends[0] - ends[1], axis=1))
    return np.array(found).T


def momenta(world: World, states: dict[str, Array]) -> tuple[Array, Array]:
    """(N, 3) each: linear momentum [kg m/s] and angular momentum about the origin [kg m^2/s]."""
    linear, angular = 0.0, 0.0
    for body in world.bodies:
        v, w = states[f"{body.name}.velocity"], states[f"{body.name}.angular_velocity"]
        linear = linear + body.mass * v
        turn = Rotation.from_quat(states[f"{body.name}.orientation"], scalar_first=True)
        own = turn.apply(np.asarray(body.inertia, float) * turn.inv().apply(w))
        angular = angular + own + body.mass * np.cross(states[f"{body.name}.position"], v)
    return np.asarray(linear), np.asarray(angular)


def energy(world: World, states: dict[str, Array], g: float = 9.81) -> Array:
    """(N,) [J]."""
    total = 0.0
    for body in world.bodies:
        v, w = states[f"{body.name}.velocity"], states[f"{body.name}.angular_velocity"]
        own = Rotation.from_quat(states[f"{body.name}.orientation"], scalar_first=True).inv().apply(w)
        total = total + (body.mass * (v**2).sum(1) + (own**2 * np.asarray(body.inertia, float)).sum(1)) / 2
        total = total + body.mass * g * states[f"{body.name}.position"][:, 2]
    return np.asarray(total)
