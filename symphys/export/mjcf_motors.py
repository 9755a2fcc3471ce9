"""Motors as MJCF actuators; their commands are MuJoCo's ctrl."""

from __future__ import annotations

from math import inf
from xml.etree.ElementTree import Element

from symphys.export.mjcf_joints import names
from symphys.export.mjcf_surfaces import text
from symphys.model.joints import AffineMotor, Joint, Motor, Servo, TorqueMotor
from symphys.model.scalar import is_zero

GIVING_WAY = 0.01
"""Of a motor's largest velocity: how far off it MuJoCo's gives all of its torque."""
UNBOUNDED = 1e10
"""Where one of two ends is missing."""


def actuators(joint: Joint) -> list[Element]:
    """The motor along every coordinate."""
    if joint.motor is None:
        return []
    kind, attributes = actuator(joint.motor)
    return [Element(kind, {"name": name, "joint": name, **attributes}) for name in names(joint)]


def actuator(motor: Motor) -> tuple[str, dict[str, str]]:
    """The element that is nearest to a motor, and its attributes."""
    if isinstance(motor, AffineMotor):
        return affine(motor)
    bound = text((-motor.torque, motor.torque))
    if isinstance(motor, TorqueMotor):
        return "motor", {"ctrlrange": bound}
    steepness = motor.torque / (GIVING_WAY * motor.velocity)
    attributes = {"kv": text([steepness]), "forcerange": bound}
    if isinstance(motor, Servo):
        held = {} if motor.range is None else {"ctrlrange": text((-motor.range, motor.range))}
        return "position", {"kp": text([steepness * motor.gain]), **attributes, **held}
    return "velocity", {**attributes, "ctrlrange": text((-motor.velocity, motor.velocity))}


def affine(motor: AffineMotor) -> tuple[str, dict[str, str]]:
    """A motor where the force is the command, else a general actuator; both are the same law as here."""
    ranges = {"ctrlrange": motor.command_range, "forcerange": motor.force_range}
    found = {"gear": text([motor.gear])}
    found |= {key: text(bounded(ends)) for key, ends in ranges.items() if ends is not None and ends != (-inf, inf)}
    if motor.passive and is_zero(motor.offset) and is_zero(motor.gain - 1):
        return "motor", found
    bias = text([motor.offset, -motor.kp, -motor.kv])
    return "general", {**found, "gainprm": text([motor.gain]), "biastype": "affine", "biasprm": bias}


def bounded(ends: tuple[float, float]) -> tuple[float, float]:
    """Both ends as numbers that MuJoCo takes."""
    return max(ends[0], -UNBOUNDED), min(ends[1], UNBOUNDED)
