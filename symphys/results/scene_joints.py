"""What a picture of joints needs to know of them: the entries of "joints" in scene.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from symphys.model.joints import Joint, Motor, Servo, TorqueMotor, VelocityMotor
from symphys.model.shapes import Scalar

MOTORS: dict[type[Motor], str] = {Servo: "servo", VelocityMotor: "velocity", TorqueMotor: "torque"}
"""As problem files call them."""


def joint_entry(joint: Joint, bodies: Sequence[str]) -> dict[str, Any]:
    """A joint as JSON.

    ``first`` and ``second``: names of the two bodies, None for the world; coordinates are those of the first against
    the second. ``sockets``: of both, ``point`` (3,) [m] and ``orientation`` (4,) w x y z in the body's frame, or the
    world's. ``coordinates``: ``name``, and ``turns``: [rad], else [m]. ``limits``: lower and upper of each coordinate,
    None where there is none. ``motor``: its ``kind`` and numbers, or None.

    Args:
        joint: with numbers, no symbols.
        bodies: the names of the world's bodies.
    """
    return {
        "name": joint.name,
        "kind": joint.kind.name,
        "first": bodies[joint.first],
        "second": None if joint.second is None else bodies[joint.second],
        "sockets": [
            {"point": [float(x) for x in socket.point], "orientation": [float(x) for x in socket.orientation]}
            for socket in joint.sockets
        ],
        "coordinates": [{"name": each.name, "turns": each.turns} for each in joint.kind.coordinates],
        "limits": [bound(joint.limits.lower), bound(joint.limits.upper)],
        "motor": None if joint.motor is None else motor_entry(joint.motor),
    }


def bound(value: Scalar | None) -> float | None:
    """One end of limits."""
    return None if value is None else float(value)


def motor_entry(motor: Motor) -> dict[str, Any]:
    """A motor as JSON: its kind as in problem files, those of its bounds that there are, a servo's gain; SI units."""
    numbers = {key: float(value) for key, value in asdict(motor).items() if value is not None}
    return {"kind": MOTORS[type(motor)], **numbers}
