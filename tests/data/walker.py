"""A recorded motion of a robot with four legs of two links, that no engine has made, and its scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

LEGS = ("fl", "fr", "hl", "hr")
STEPS, DT = 40, 0.05
UPRIGHT = [1.0, 0.0, 0.0, 0.0]
TURNED = [float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]
"""The frame's x axis along the body's y."""
SERVO = {"kind": "servo", "gain": 20, "torque": 30, "velocity": 8}


def hinge(name: str, first: str, second: str | None, points: tuple[Any, Any], **more: Any) -> dict[str, Any]:
    """A hinge about the bodies' y axis, as scene.json tells it."""
    frames = [{"point": list(point), "orientation": TURNED} for point in points]
    turns = [{"name": "angle", "turns": True}]
    whole = {"name": name, "kind": "hinge", "first": first, "second": second, "sockets": frames, "coordinates": turns}
    return {**whole, "limits": [-1.0, 2.0], "motor": SERVO, **more}


def leg(index: int) -> list[dict[str, Any]]:
    """Hip and knee of a leg; the torso is 0.6 m long and 0.4 m wide between the hips."""
    x, y, name = 0.3 - 0.6 * (index // 2), 0.2 - 0.4 * (index % 2), LEGS[index]
    return [
        hinge(f"{name}_hip", f"{name}_thigh", "torso", ([0, 0, 0.15], [x, y, 0])),
        hinge(f"{name}_knee", f"{name}_shin", f"{name}_thigh", ([0, 0, 0.15], [0, 0, -0.15])),
    ]


def links(index: int) -> list[dict[str, Any]]:
    """Thigh and shin; the shin has a foot."""
    rod = {"kind": "capsule", "radius": 0.03, "length": 0.2, "centre": [0, 0, 0], "orientation": UPRIGHT}
    foot = {"kind": "sphere", "radius": 0.05, "centre": [0, 0, -0.15]}
    return [
        {"name": f"{LEGS[index]}_thigh", "mass": 1.0, "shapes": [rod]},
        {"name": f"{LEGS[index]}_shin", "mass": 0.5, "shapes": [rod, foot]},
    ]


TORSO = {"name": "torso", "mass": 4.0, "shapes": [{"kind": "box", "size": [0.6, 0.4, 0.2], "centre": [0, 0, 0]}]}
SCENE: dict[str, Any] = {
    "gravity": [0, 0, -10],
    "bodies": [TORSO, *(link for index in range(4) for link in links(index))],
    "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": 0.0}],
    "joints": [joint for index in range(4) for joint in leg(index)],
}
"""10 kg: 100 N."""
NAMES = [body["name"] for body in SCENE["bodies"]]


def motion(speed: float = 0.0) -> dict[str, Any]:
    """Stands stretched, moves along x as a whole; nothing is loaded, no motor gives anything."""
    time, count, joints = DT * np.arange(STEPS + 1), len(NAMES), len(SCENE["joints"])
    start = [[0, 0, 0.65]]
    for index in range(4):
        x, y = 0.3 - 0.6 * (index // 2), 0.2 - 0.4 * (index % 2)
        start += [[x, y, 0.5], [x, y, 0.2]]
    position = np.tile(np.array(start, float), (STEPS + 1, 1, 1))
    position[..., 0] += speed * time[:, None]
    contacts = [f"{name}_shin[{k}]-ground" for name in LEGS for k in range(2)]
    still = np.zeros((STEPS + 1, joints, 1))
    return {
        "time": time,
        "body_names": np.array(NAMES),
        "position": position,
        "orientation": np.tile(UPRIGHT, (STEPS + 1, count, 1)),
        "velocity": np.zeros_like(position),
        "angular_velocity": np.zeros_like(position),
        "contact_names": np.array(contacts),
        "contact_force": np.zeros((STEPS, len(contacts), 3)),
        "contact_gap": np.zeros((STEPS + 1, len(contacts))),
        "joint_names": np.array([joint["name"] for joint in SCENE["joints"]]),
        "joint_value": still,
        "joint_rate": still,
        "joint_torque": still[1:].copy(),
        "joint_command": still[1:].copy(),
        "joint_separation": np.zeros((STEPS + 1, joints)),
    }


def write_walker(folder: Path, arrays: dict[str, Any], scene: dict[str, Any] = SCENE) -> Path:
    """The files of a motion and of its scene."""
    np.savez(folder / "trajectory.npz", **arrays)
    (folder / "scene.json").write_text(json.dumps(scene))
    return folder
