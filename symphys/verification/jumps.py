"""Coordinates of joints that jump: that change in a step by what their rates do not account for."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.transcription import Record, Rollout
from symphys.verification.joints import coordinates

LEAST = {"rad": 1e-2, "m": 1e-3}
"""What a coordinate may be pushed in a step at any speed, as out of an overlap."""


def jumps(rollout: Rollout, record: Record) -> dict[str, Any]:
    """The largest jump of a coordinate.

    In a step a coordinate moves by between dt times the least and dt times the greatest of its rates there and in the
    steps before and after. What is beyond that no motion did: a coupling, a limit or a loop put it there.

    Returns:
        "jump": what is beyond, as a share of the most that the joint moves in a step; "jump_at": "joint", "time" [s],
        "moved" and "unit". Nothing without joints that have coordinates.
    """
    motion, found, worst = record.motion, dict[str, Any](), -1.0
    for joint, value, rate in coordinates(rollout, record):
        unit = "rad" if joint.kind.winds else "m"
        around = np.pad(rollout.dt * rate, ((1, 1), (0, 0)), mode="edge")
        ends = np.stack([around[:-3], around[1:-2], around[2:-1], around[3:]])
        moved = np.diff(value, axis=0)
        beyond = np.maximum(ends.min(axis=0) - moved, moved - ends.max(axis=0)).clip(min=0)
        share = beyond / max(float(np.abs(around).max()), LEAST[unit])
        step, k = np.unravel_index(int(share.argmax()), share.shape)
        if share[step, k] > worst:
            worst = float(share[step, k])
            where = {"joint": joint.name, "time": float(motion.time[step]), "moved": float(moved[step, k])}
            found = {"jump": worst, "jump_at": where | {"unit": unit}}
    return found
