"""A world of every kind of joint, with bodies on either side of them, and a start at which nothing is zero."""

from __future__ import annotations

from typing import Any

import numpy as np
from robots import Pose, state_of
from scipy.spatial.transform import Rotation

from symphys.model.joints import (
    BALL,
    FIXED,
    HINGE,
    SLIDER,
    UNIVERSAL,
    Joint,
    JointFrame,
    Kind,
    Limits,
    Spring,
    TorqueMotor,
)
from symphys.model.world import Body, World

HELD: tuple[tuple[Kind, int, int | None], ...] = (
    (HINGE, 1, 0),
    (HINGE, 0, 2),
    (UNIVERSAL, 3, 1),
    (UNIVERSAL, 2, 4),
    (SLIDER, 5, 0),
    (SLIDER, 3, 6),
    (BALL, 7, 5),
    (BALL, 4, 8),
    (FIXED, 9, 8),
    (HINGE, 10, None),
    (BALL, 11, 10),
)
"""Kind, first and second side."""


def mixed() -> tuple[World, dict[str, Any]]:
    """Springs along all coordinates, torque motors along the hinges, limits out of reach; a free body in the end."""
    rng = np.random.default_rng(3)
    joints = []
    for k, (kind, first, second) in enumerate(HELD):
        frames = JointFrame(*placed(rng)), JointFrame(*placed(rng))
        motor = TorqueMotor(2.0) if kind is HINGE else None
        spring = Spring(3.0, 0.1, 0.2) if kind.coordinates else None
        limits = Limits(-3.0, None) if kind is HINGE else Limits()
        joints.append(Joint(f"{kind.name}{k}", kind, first, second, frames, motor, limits, spring))
    bodies = [Body(f"b{k}", 1 + 0.1 * k, tensor(rng)) for k in range(13)]
    world = World(tuple(bodies), joints=tuple(joints))
    coordinates = {joint.name: rng.uniform(-0.5, 0.5, len(joint.kind.coordinates) or 3) for joint in joints}
    rates = {joint.name: rng.uniform(-1, 1, len(joint.kind.coordinates)) for joint in joints if joint.kind.coordinates}
    turn = Rotation.random(rng=rng)
    root = Pose(turn, *rng.uniform(-1, 1, (3, 3)))
    alone = Pose(turn.inv(), *rng.uniform(-1, 1, (3, 3))).values("b12")
    return world, state_of(world, coordinates, rates, root) | alone


def placed(rng: np.random.Generator) -> tuple[Any, Any]:
    """A point and an orientation."""
    return tuple(rng.uniform(-0.3, 0.3, 3)), tuple(Rotation.random(rng=rng).as_quat(scalar_first=True))


def tensor(rng: np.random.Generator) -> Any:
    """A moment of inertia that is not along the body's axes."""
    turn = Rotation.random(rng=rng).as_matrix()
    return tuple(map(tuple, (turn * rng.uniform(0.03, 0.05, 3)) @ turn.T))
