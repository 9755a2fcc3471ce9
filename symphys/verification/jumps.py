"""Places that jump: bodies and joints that are, after a step, where no velocity of the step takes them.

What a coupling puts back, or a body that is moved out of another at once, does not show in energy or momentum, where it
is counted among what contacts and joints do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.transcription import Record, Rollout
from symphys.verification.bodies import bodies
from symphys.verification.joints import coordinates

MARGIN = 1.5
"""Places may move by so many times what the faster of a step's two ends would: between them speeds may be larger."""


def jumps(rollout: Rollout, record: Record) -> dict[str, Any]:
    """The largest jump.

    Returns:
        "jump": how far it is beyond what the velocities explain, as a share: of a body's radius of gyration; of the
        smallest one for sliders; of a radian for hinges. "jump_at": None, or its "name" of a body or joint, "time" [s]
        and "size" [m] or [rad].
    """
    motion, dt, sizes = record.motion, rollout.dt, bodies(rollout, record).size
    moving = [
        (name, np.linalg.norm(np.diff(motion.position[:, b], axis=0), axis=1), motion.velocity[:, b], float(sizes[b]))
        for b, name in enumerate(motion.body_names)
        if np.isfinite(sizes[b])
    ]
    for joint, value, rate in coordinates(rollout, record):
        for i, coordinate in enumerate(joint.kind.coordinates):
            size = 1.0 if coordinate.turns else float(sizes.min())
            moving.append((joint.name, np.abs(np.diff(value[:, i])), rate[:, [i]], size))
    found: dict[str, Any] = {"jump": 0.0, "jump_at": None}
    for name, step, velocity, size in moving:
        speed = np.linalg.norm(velocity, axis=1)
        beyond = step - MARGIN * dt * np.maximum(speed[:-1], speed[1:])
        k = int(beyond.argmax())
        if size > 0 and beyond[k] > found["jump"] * size:
            at = {"name": name, "time": float(motion.time[k]), "size": float(step[k])}
            found = {"jump": float(beyond[k] / size), "jump_at": at}
    return found
