"""Bodies and the joints between them, put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symphys.model.body import Body
from symphys.model.joints import Joint
from symphys.model.joints.placing import placed_joints
from symphys.model.joints.specs import JointSpec
from symphys.model.shapes import UPRIGHT
from symphys.types import Array

ORIGIN = (0.0, 0.0, 0.0)
REST = {"position": ORIGIN, "orientation": UPRIGHT, "velocity": ORIGIN, "angular_velocity": ORIGIN}
"""Where bodies begin that do not say so."""


def jointed(bodies: tuple[Body, ...], joints: Sequence[JointSpec]) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies where they begin, with every joint at its ``start``, and joints with frames.

    Raises:
        SymphysError: names the joint and what would be valid.
    """
    state = {f"{b.name}.{key}": np.array(b.start.get(key, rest), float) for b in bodies for key, rest in REST.items()}
    made, moved = placed_joints(joints, [body.name for body in bodies], state)
    return tuple(replace(body, start=begins(body, moved)) for body in bodies), made


def begins(body: Body, state: Mapping[str, Array]) -> dict[str, tuple[float, ...]]:
    """The start of a body in a state; what it did not say and is still at rest stays unsaid."""
    found = {key: tuple(state[f"{body.name}.{key}"].tolist()) for key in REST}
    return {key: value for key, value in found.items() if key in body.start or value != REST[key]}
