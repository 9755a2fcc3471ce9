"""A recorded motion of boxes, capsules and compounds among blocks and terrain, that no engine has made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUARTER = [float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0]
X = np.linspace(-4, 4, 17)
YARD: dict[str, Any] = {
    "bodies": [
        {"name": "crate", "shapes": [{"kind": "box", "size": [0.4, 0.3, 0.2], "centre": [0, 0, 0]}]},
        {
            "name": "hammer",
            "shapes": [
                {"kind": "capsule", "radius": 0.05, "length": 0.6, "centre": [0, 0, 0], "orientation": QUARTER},
                {"kind": "box", "size": [0.1, 0.4, 0.2], "centre": [0.3, 0, 0], "orientation": [2, 0, 0, 0]},
                {"kind": "sphere", "radius": 0.1, "centre": [-0.3, 0, 0]},
            ],
        },
    ],
    "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": -1.0}],
    "fixtures": [
        {"name": "ramp", "shape": {"kind": "box", "size": [2, 1, 0.2], "centre": [0, 0, 0], "orientation": QUARTER}},
        {"name": "post", "shape": {"kind": "capsule", "radius": 0.1, "length": 1, "centre": [2, 0, 0]}},
    ],
    "terrain": [{"name": "hills", "x": X.tolist(), "y": [-1, 1, 2], "z": [(0.1 * X).tolist()] * 2 + [["nan"] * 17]}],
}


def motion_of(names: list[str], steps: int = 40) -> dict[str, Any]:
    """Bodies beside each other that move along x and turn about y, with two points of contact each."""
    count, time = len(names), np.linspace(0, 1, steps + 1)
    position = np.stack([np.stack([3 * time - 1.5, 0 * time + b, 1 + 0.5 * time], 1) for b in range(count)], 1)
    turned = np.stack([np.cos(time), 0 * time, np.sin(time), 0 * time], 1)
    contacts = [f"{name}-ground:{k}" for name in names for k in range(2)]
    force = np.zeros((steps, 2 * count, 3))
    force[:, :, 2] = 1 + np.arange(2 * count)
    return {
        "time": time,
        "body_names": np.array(names),
        "position": position,
        "orientation": np.repeat(turned[:, None], count, 1),
        "velocity": np.zeros_like(position),
        "angular_velocity": np.zeros_like(position),
        "contact_names": np.array(contacts),
        "contact_force": force,
        "contact_gap": np.tile(np.arange(2 * count) - 0.5, (steps + 1, 1)),
    }


def write_yard(folder: Path) -> Path:
    """The files of the motion and of its scene."""
    np.savez(folder / "trajectory.npz", **motion_of(["crate", "hammer"]))
    (folder / "scene.json").write_text(json.dumps(YARD))
    return folder


def prism(count: int, radius: float = 1.0, half: float = 1.0) -> NDArray[np.float64]:
    """(2 count, 3): the corners of a prism along z whose base is regular; an approximation to a cylinder."""
    angles = 2 * np.pi * np.arange(count) / count
    return np.array([[radius * np.cos(a), radius * np.sin(a), z] for z in (-half, half) for a in angles])


def area(points: NDArray[np.float64]) -> float:
    """Of a polygon; positive if it goes counter-clockwise."""
    x, y = points.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)
