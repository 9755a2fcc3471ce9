"""A compiled model, with what MuJoCo loses of its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from symphys.importing.findings import Finding
from symphys.types import Array


@dataclass(frozen=True)
class Inertial:
    """What a file says of a link.

    Attributes:
        mass: [kg].
        centre: (3,) of mass, in the link's frame [m].
        inertia: (3, 3) about it, in the link's axes [kg m^2].
    """

    mass: float
    centre: Array
    inertia: Array


@dataclass(frozen=True)
class JointMotor:
    """What a URDF says of the motor of a joint: the largest effort [N m] or [N], and velocity [rad/s] or [m/s]."""

    effort: float
    velocity: float = np.inf


@dataclass(frozen=True)
class Source:
    """A compiled model.

    Attributes:
        file: that was read.
        kind: "mjcf" or "urdf".
        model: MjModel.
        inertials: by the names of bodies, where the model's numbers are not those of the file.
        motors: by the names of joints, of a URDF.
        findings: what MuJoCo loses, and what was recovered.
        files: all that were read: the model, what it includes, its meshes and height fields.
    """

    file: Path
    kind: str
    model: Any
    inertials: Mapping[str, Inertial] = field(default_factory=dict)
    motors: Mapping[str, JointMotor] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    files: tuple[Path, ...] = ()
