"""What was measured beside what is simulated: bodies seen through, in one motion with the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from symphys.results.identification.replays import RecordingReplay
from symphys.results.scene import Scene, SceneBody
from symphys.trajectory import Trajectory
from symphys.types import Array

MEASURED = " measured"
"""Ends the name of what was measured."""


def with_ghosts(replay: RecordingReplay, scene: Scene) -> tuple[Trajectory, Scene]:
    """Return the simulated motion and its scene, with a further body for each whose position was measured.

    Between samples ghosts go evenly; before the first and after the last they stand.
    """
    motion, bodies = replay.motion, list(scene.bodies)
    position, orientation = [motion.position], [motion.orientation]
    for k, name in enumerate(replay.bodies):
        solids = scene.solids(name)
        bodies.append(SceneBody(name + MEASURED, solids))
        position.append(_between(motion.time, replay.time, replay.position[:, k])[:, None])
        turned = _between(motion.time, replay.time, _one_sided(replay.orientation[:, k]))
        orientation.append((turned / np.linalg.norm(turned, axis=1, keepdims=True))[:, None])
    names = (*motion.body_names, *(name + MEASURED for name in replay.bodies))
    arrays: dict[str, Any] = {
        field: np.concatenate([array, np.zeros((len(array), len(replay.bodies), 3))], axis=1)
        for field in ("velocity", "angular_velocity", "force", "torque")
        for array in (getattr(motion, field),)
    }
    both: dict[str, Any] = {
        "position": np.concatenate(position, axis=1),
        "orientation": np.concatenate(orientation, axis=1),
    }
    return replace(motion, body_names=names, **both, **arrays), replace(scene, bodies=tuple(bodies))


def _between(time: Array, sampled: Array, values: Array) -> Array:
    """Interpolate (n, m) samples, of which some are missing, at the times of the motion: (N + 1, m)."""
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        return np.zeros((len(time), values.shape[1]))
    return np.stack([np.interp(time, sampled[known], column) for column in values[known].T], axis=1)


def _one_sided(q: Array) -> Array:
    """Quaternions of the same turns, each on the side of the one before it."""
    found = q.copy()
    for k in range(1, len(found)):
        if np.dot(found[k], found[k - 1]) < 0:
            found[k] = -found[k]
    return found
