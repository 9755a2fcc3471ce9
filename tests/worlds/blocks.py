"""Uniform boxes and capsules, worlds of them, and how far what should lie still has moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symphys.model.shapes import Box, Capsule, Plane
from symphys.model.world import Body, Law, World, make_world
from symphys.types import Array

LYING = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
"""Turns z to x: a capsule on its side."""


def block(name: str, halves: Sequence[float], mass: Any = 1.0) -> Body:
    """A uniform box."""
    x, y, z = halves
    moments = tuple(mass / 3 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y)))
    return Body(name, mass, moments, (Box((x, y, z)),))


def rod(name: str, radius: float, half_length: float, mass: float = 1.0) -> Body:
    """A uniform capsule along x."""
    tube, ball = half_length * 2, radius * 4 / 3
    share = tube / (tube + ball)
    along = mass * radius**2 * (share / 2 + (1 - share) * 2 / 5)
    across = mass * (
        share * (radius**2 / 4 + tube**2 / 12)
        + (1 - share) * (2 / 5 * radius**2 + half_length**2 + 3 / 4 * radius * half_length)
    )
    return Body(name, mass, (along, across, across), (Capsule(radius, half_length, orientation=LYING),))


def among(world: World, near: set[tuple[int, int | None]]) -> World:
    """A world where only these bodies meet: the pairs of others cost time, nothing else. None: what is static."""
    return World(world.bodies, world.statics, tuple(p for p in world.pairs if (p.first.body, p.second.body) in near))


def stack(bodies: Sequence[Body], law: Law) -> World:
    """Bodies on the ground, each on the one before."""
    world = make_world(bodies, [Plane.ground()], law)
    return among(world, {(0, None)} | {(i, i + 1) for i in range(len(bodies))})


def turned_by(axis: Sequence[float], angle: float) -> Array:
    """(4,): the quaternion of a rotation [rad]."""
    unit = np.array(axis, float) / np.linalg.norm(axis)
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * unit])


def drift(states: dict[str, Array], name: str, since: int = 0) -> tuple[float, float]:
    """How far a body has moved [m] and turned [degrees] since a step."""
    moved = np.abs(states[f"{name}.position"] - states[f"{name}.position"][since])[since:].max()
    q = states[f"{name}.orientation"][since:]
    half = np.linalg.norm(q[:, 1:] * q[0, 0] - q[0, 1:] * q[:, :1] - np.cross(q[:, 1:], q[0, 1:]), axis=1).max()
    return float(moved), float(np.degrees(2 * np.arcsin(min(half, 1.0))))


def unrest(states: dict[str, Array], name: str, steps: int = 50) -> float:
    """The largest velocity [m/s, rad/s] that a body reports in the last steps."""
    return float(max(np.abs(states[f"{name}.{field}"][-steps:]).max() for field in ("velocity", "angular_velocity")))
