"""Measured tosses, and how far predictions of them are off in the published measure.

The measure is that of Acosta, Yang and Posa (RA-L 7(3), 2022): the mean over the frames of a toss, then over tosses; of
positions in % of the width, of rotations in degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RATE = 148.0
"""[Hz] of the frames."""
WIDTH = {"cube": 0.1048, "elbow": 0.1}
"""[m] what positions are told in: of the cube, and the length of a box of the elbow."""


@dataclass(frozen=True)
class Toss:
    """A toss, at its n frames.

    Attributes:
        number: in the source.
        position: (n, 3) [m]; of the elbow that of its first link.
        orientation: (n, 4) unit quaternions w x y z.
        velocity, angular_velocity: (n, 3) in the world frame.
        angle, rate: (n,) of the hinge; None without one.
    """

    number: int
    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array
    angle: Array | None = None
    rate: Array | None = None


@dataclass(frozen=True)
class Score:
    """Of each toss: position [% of the width], rotation [degrees], and the hinge [degrees] if there is one."""

    position: Array
    rotation: Array
    hinge: Array | None = None

    def __str__(self) -> str:
        """Means and standard deviations over the tosses."""
        parts = [self.position, self.rotation, *([] if self.hinge is None else [self.hinge])]
        return " | ".join(f"{each.mean():.2f} ± {each.std():.1f}" for each in parts)


def read_tosses(path: Path) -> list[Toss]:
    """All of a file."""
    with np.load(path) as file:
        data = dict(file)
    rows = [slice(a, b) for a, b in zip(data["start"][:-1], data["start"][1:], strict=True)]
    keys = [key for key in ("position", "orientation", "velocity", "angular_velocity", "angle", "rate") if key in data]
    return [
        Toss(int(number), **{key: data[key][part] for key in keys})
        for number, part in zip(data["toss"], rows, strict=True)
    ]


def score(name: str, tosses: Sequence[Toss], predicted: Sequence[Array]) -> Score:
    """Of predictions (n, 7) or (n, 8): position, orientation, angle."""
    position, rotation, hinge = [], [], []
    for toss, found in zip(tosses, predicted, strict=True):
        position.append(np.linalg.norm(found[:, :3] - toss.position, axis=1).mean() / WIDTH[name] * 100)
        rotation.append(np.degrees(angle_between(toss.orientation, found[:, 3:7]).mean()))
        if toss.angle is not None:
            off = (found[:, 7] - toss.angle + np.pi) % (2 * np.pi) - np.pi
            hinge.append(np.degrees(np.abs(off).mean()))
    return Score(np.array(position), np.array(rotation), np.array(hinge) if hinge else None)


def angle_between(a: Array, b: Array) -> Array:
    """(n,) [rad] of the rotation between unit quaternions (n, 4)."""
    return np.asarray(2 * np.arccos(np.clip(np.abs(np.einsum("ni,ni->n", a, b)), 0, 1)))


def conjugate(q: Array) -> Array:
    """The inverse rotation."""
    return np.asarray(q * np.array([1, -1, -1, -1]))


def product(a: Array, b: Array) -> Array:
    """Of two quaternions (4,)."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *vector])
