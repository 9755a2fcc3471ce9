"""Motors as MJCF actuators, and the time step at which MuJoCo holds them; their commands are MuJoCo's ctrl.

MuJoCo takes the forces of springs, of soft contacts and of motors at their bounds as they are at the beginning of a
step. All of a motor's torque T over a step h changes the rate of a coordinate of inertia I by T h / I. Where that is
more than twice the speed error at which the motor leaves its bound, T / kv, it swings between its bounds for ever. So
kv is at most 2 I / h, and the step is cut into parts until such a motor gives all of its torque at a speed error of at
most a tenth of its largest velocity.

I is the inertia of a coordinate at the start while all others are free: 1 / (M^-1) of the trees' mass matrix M.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from math import inf
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.export.mjcf_bodies import StartState, links_of
from symphys.export.mjcf_joints import names
from symphys.export.mjcf_surfaces import text
from symphys.model.joints import AffineMotor, Joint, Motor, Servo, TorqueMotor, VelocityMotor
from symphys.model.scalar import is_zero
from symphys.types import Array

Inertias = Mapping[tuple[str, int], float]
"""The inertia of each coordinate of the trees [kg m^2] or [kg], by the joint's name and the number there."""
WANTED_SPEED_ERROR, MAX_SPEED_ERROR = 0.01, 0.1
"""Velocity error at full torque, as a share of a motor's largest velocity: desired, and allowed."""
MAX_STEP_PHASE, MAX_STEP_PHASE_CONTACT = 1.0, 0.125
"""Largest h omega of a spring, and of a compliant contact: the damping of several adds up."""
MAX_PARTS = 50
"""Largest number of parts of a time step."""
UNBOUNDED = 1e10
"""Bound of a force or a command where one of two is missing, in the unit of either."""


def parts(start: StartState, found: Inertias, dt: float) -> int:
    """Return the number of parts into which a step of ``dt`` [s] is cut."""
    longest = min(_longest(start, found), default=inf)
    return max(1, min(MAX_PARTS, math.ceil(dt / longest - 1e-9))) if longest > 0 else MAX_PARTS


def steepness(motor: Servo | VelocityMotor, inertia: float, step: float) -> float:
    """Return kv on a coordinate of this inertia [N m s/rad] or [N s/m], at a time step [s]."""
    return float(min(motor.torque / (WANTED_SPEED_ERROR * motor.velocity), 2 * inertia / step))


def inertias(start: StartState) -> Inertias:
    """Compute the inertia of each coordinate at the start while all others are free."""
    world, links = start.world, links_of(start.world)
    columns: list[Array] = []
    """Twists (6,) of the coordinates at the world's origin: velocity and angular velocity at a rate of 1."""
    owners: dict[int, tuple[str, int]] = {}
    above: dict[int | None, frozenset[int]] = {None: frozenset()}
    for link in links:
        held = above[link.parent]
        for name, number, twist in _freedoms(start, link.joint, link.body):
            if name:
                owners[len(columns)] = name, number
            held |= {len(columns)}
            columns.append(twist)
        above[link.body] = held
    mass = np.diag([_armature(world.joints, owners.get(k)) for k in range(len(columns))])
    for link in links:
        body, moving = world.bodies[link.body], sorted(above[link.body])
        if moving and not body.massless:
            centre = start.of(link.body, "position")
            turning = np.array([columns[k][3:] for k in moving]).T
            shifting = np.array([columns[k][:3] + np.cross(columns[k][3:], centre) for k in moving]).T
            axes = start.axes(link.body)
            tensor = axes @ np.array(ca.DM(inertia_matrix(body.inertia))) @ axes.T
            mass[np.ix_(moving, moving)] += body.mass * shifting.T @ shifting + turning.T @ tensor @ turning
    give = np.diag(np.linalg.pinv(mass, hermitian=True)) if columns else np.zeros(0)
    return {owner: 1 / max(float(give[k]), 1e-300) for k, owner in owners.items()}


def _freedoms(start: StartState, joint: int | None, body: int) -> Iterator[tuple[str, int, Array]]:
    """Yield name, number and twist (6,) at the world's origin of each coordinate; free motions have no name."""
    if joint is None:
        yield from (("", k, row) for k, row in enumerate(np.eye(6)))
        return
    made = start.world.joints[joint]
    side, frame = made.bodies[0], made.frames[0]
    point = start.of(side, "position") + start.axes(side) @ np.array(frame.point, float)
    if made.kind.name == "ball":
        yield from (("", k, np.concatenate([np.cross(point, row), row])) for k, row in enumerate(np.eye(3)))
        return
    for number, (slide, turn) in enumerate(start.motions(made)):
        yield made.name, number, np.concatenate([slide + np.cross(point, turn), turn])


def _armature(joints: tuple[Joint, ...], owner: tuple[str, int] | None) -> float:
    """Return the armature of a coordinate's joint [kg m^2] or [kg]."""
    return next((float(joint.armature) for joint in joints if owner and joint.name == owner[0]), 0.0)


def _longest(start: StartState, found: Inertias) -> Iterator[float]:
    """Yield the longest stable step of each motor, spring and compliant contact [s]."""
    joints = {joint.name: joint for joint in start.world.joints}
    for (name, _), inertia in found.items():
        motor, stiffness = joints[name].motor, _stiffness(joints[name])
        if isinstance(motor, Servo | VelocityMotor):
            yield 2 * MAX_SPEED_ERROR * motor.velocity * inertia / motor.torque
        if stiffness > 0:
            yield MAX_STEP_PHASE * math.sqrt(inertia / stiffness)
    for pair in start.world.pairs:
        if pair.law.soft:
            yield MAX_STEP_PHASE_CONTACT / (2 * math.pi * float(pair.law.frequency) * max(1.0, float(pair.law.damping)))


def _stiffness(joint: Joint) -> float:
    """Return the stiffness of a joint's spring and affine motor along each coordinate [N m/rad] or [N/m]."""
    spring = 0.0 if joint.spring is None else float(joint.spring.stiffness)
    motor = joint.motor
    return spring + (float(motor.kp) * float(motor.gear) ** 2 if isinstance(motor, AffineMotor) else 0.0)


def actuators(joint: Joint, inertias: Inertias, step: float) -> list[Element]:
    """Write an actuator for each coordinate of a joint with a motor, for a time step [s]."""
    if joint.motor is None:
        return []
    found = []
    for number, name in enumerate(names(joint)):
        kind, attributes = actuator(joint.motor, inertias.get((joint.name, number), inf), step)
        found.append(Element(kind, {"name": name, "joint": name, **attributes}))
    return found


def actuator(motor: Motor, inertia: float, step: float) -> tuple[str, dict[str, str]]:
    """Return the kind and the attributes of the nearest actuator for a motor on a coordinate of this inertia."""
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
    """Return the exact actuator: "motor" if the force is the command, "general" otherwise."""
    ranges = {"ctrlrange": motor.command_range, "forcerange": motor.force_range}
    found = {"gear": text([motor.gear])}
    found |= {key: text(bounded(ends)) for key, ends in ranges.items() if ends is not None and ends != (-inf, inf)}
    if motor.passive and is_zero(motor.offset) and is_zero(motor.gain - 1):
        return "motor", found
    bias = text([motor.offset, -motor.kp, -motor.kv])
    return "general", {**found, "gainprm": text([motor.gain]), "biastype": "affine", "biasprm": bias}


def bounded(ends: tuple[float, float]) -> tuple[float, float]:
    """Replace infinite bounds by numbers that MuJoCo takes."""
    return max(ends[0], -UNBOUNDED), min(ends[1], UNBOUNDED)
