"""Motors as MJCF actuators; their commands are MuJoCo's ctrl."""

from __future__ import annotations

from math import inf
from xml.etree.ElementTree import Element

from symphys.export.mjcf_joints import names
from symphys.export.mjcf_surfaces import text
from symphys.export.moving.step import Inertias, steepness
from symphys.model.joints import AffineMotor, Joint, Motor, Servo, TorqueMotor
from symphys.model.scalar import is_zero

UNBOUNDED = 1e10
"""Where one of two ends is missing."""


def actuators(joint: Joint, inertias: Inertias, step: float) -> list[Element]:
    """The motor along every coordinate, for a time step [s]."""
    if joint.motor is None:
        return []
    found = []
    for number, name in enumerate(names(joint)):
        kind, attributes = actuator(joint.motor, inertias.get((joint.name, number), inf), step)
        found.append(Element(kind, {"name": name, "joint": name, **attributes}))
    return found


def actuator(motor: Motor, inertia: float, step: float) -> tuple[str, dict[str, str]]:
    """The element that is nearest to a motor on a coordinate of this inertia, and its attributes."""
    if isinstance(motor, AffineMotor):
        return affine(motor)
    bound = text((-motor.torque, motor.torque))
    if isinstance(motor, TorqueMotor):
        return "motor", {"ctrlrange": bound}
    kv = steepness(motor, inertia, step)
    attributes = {"kv": text([kv]), "forcerange": bound}
    if isinstance(motor, Servo):
        held = {} if motor.range is None else {"ctrlrange": text((-motor.range, motor.range))}
        return "position", {"kp": text([kv * motor.gain]), **attributes, **held}
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
