"""Joints of trees as MJCF joints of the child, motors as actuators, and the start as numbers of a keyframe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.joints.joint_frames import joint_frames_at
from symphys.dynamics.observation.joint_coordinates import Reading, readings
from symphys.export.mjcf_surfaces import text
from symphys.maths import rotation
from symphys.model.joints import Joint, Link, Motor, Servo, TorqueMotor
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import World

Array = NDArray[np.float64]
GIVING_WAY = 0.01
"""Of a motor's largest velocity: how far off it MuJoCo's gives all of its torque."""
UNBOUNDED = 1e10
"""[rad], [m] where one of two limits is missing."""


@dataclass(frozen=True)
class StartState:
    """A world at the start.

    Attributes:
        world: plain numbers only.
        initial: what of the bodies' state is not zero, by name; see ``state.initial_state``.
    """

    world: World
    initial: Mapping[str, Any]

    @cached_property
    def x(self) -> ca.DM:
        """The state."""
        return ca.DM(initial_state(self.world, self.initial))

    def of(self, body: int, field: str) -> Array:
        """(k,): a field of a body, world frame."""
        return np.array(self.x[Layout(self.world)[f"{self.world.bodies[body].name}.{field}"]]).ravel()

    def axes(self, body: int | None) -> Array:
        """(3, 3): from the body's frame to the world's."""
        return np.eye(3) if body is None else np.array(rotation.matrix(ca.DM(self.of(body, "orientation"))))

    @cached_property
    def readings(self) -> dict[str, Reading]:
        """Of every joint."""
        return readings(self.world, ca.SX(self.x))

    def directions(self, joint: Joint) -> list[Array]:
        """(3,) of each coordinate: about which, or along which, the first side moves, world frame."""
        poses = tuple((ca.SX(self.of(i, "position")), ca.SX(self.of(i, "orientation"))) for i in joint.bodies)
        placed = joint_frames_at(joint, poses).placed(ca.SX(0))
        return [plain(coordinate.axis(placed)) for coordinate in joint.kind.coordinates]


def plain(expression: Any) -> Array:
    """(k,): the numbers of an expression without symbols."""
    return np.array(ca.evalf(expression)).ravel()


@dataclass(frozen=True)
class Freedom:
    """A joint of MJCF: its element, and what a keyframe says of it."""

    element: Element
    qpos: Array
    qvel: Array


def freedoms(start: StartState, link: Link) -> list[Freedom]:
    """What a body may do against its parent, in MuJoCo's order: what is next to the parent comes first."""
    turned = start.axes(link.body).T
    if link.joint is None:
        pose = np.concatenate([start.of(link.body, "position"), start.of(link.body, "orientation")])
        spin = turned @ start.of(link.body, "angular_velocity")
        qvel = np.concatenate([start.of(link.body, "velocity"), spin])
        return [Freedom(Element("freejoint", name=start.world.bodies[link.body].name), pose, qvel)]
    joint = start.world.joints[link.joint]
    if joint.kind.name == "ball":
        spin = start.of(link.body, "angular_velocity")
        spin = spin if link.parent is None else spin - start.of(link.parent, "angular_velocity")
        element = Element("joint", name=joint.name, type="ball", pos=place(joint, link))
        return [Freedom(element, np.array([1.0, 0, 0, 0]), turned @ spin)]
    found = [coordinate(start, joint, k, link, turned) for k in range(len(joint.kind.coordinates))]
    return found[:: link.sign]


def coordinate(start: StartState, joint: Joint, k: int, link: Link, turned: Array) -> Freedom:
    """One coordinate of a joint; where the child is its second side, it moves against the axis."""
    reading = start.readings[joint.name]
    value, rate = plain(reading.value)[[k]], plain(reading.rate)[[k]]
    axis = link.sign * turned @ start.directions(joint)[k]
    attributes = {
        "name": names(joint)[k],
        "type": "hinge" if joint.kind.coordinates[k].turns else "slide",
        "pos": place(joint, link),
        "axis": text(axis),
        "ref": text(value),
    }
    return Freedom(Element("joint", attributes | acting(joint)), value, rate)


def acting(joint: Joint) -> dict[str, str]:
    """Limits and spring along a coordinate."""
    found, limits, spring = {}, joint.limits, joint.spring
    if limits.lower is not None or limits.upper is not None:
        ends = (limits.lower, -UNBOUNDED), (limits.upper, UNBOUNDED)
        found["range"] = text(other if end is None else end for end, other in ends)
    if spring is not None:
        found |= {"stiffness": text([spring.stiffness]), "damping": text([spring.damping])}
        found["springref"] = text([spring.rest])
    return found


def place(joint: Joint, link: Link) -> str:
    """The point of the joint's frame on the child, in the child's frame."""
    return text(joint.frames[0 if link.sign > 0 else 1].point)


def names(joint: Joint) -> list[str]:
    """Of the coordinates."""
    coordinates = joint.kind.coordinates
    return [joint.name] if len(coordinates) == 1 else [f"{joint.name}.{c.name}" for c in coordinates]


def actuators(joint: Joint) -> list[Element]:
    """The motor along every coordinate; its command is MuJoCo's ctrl."""
    if joint.motor is None:
        return []
    kind, attributes = actuator(joint.motor)
    return [Element(kind, {"name": name, "joint": name, **attributes}) for name in names(joint)]


def actuator(motor: Motor) -> tuple[str, dict[str, str]]:
    """The element that is nearest to a motor, and its attributes."""
    bound = text((-motor.torque, motor.torque))
    if isinstance(motor, TorqueMotor):
        return "motor", {"ctrlrange": bound}
    steepness = motor.torque / (GIVING_WAY * motor.velocity)
    attributes = {"kv": text([steepness]), "forcerange": bound}
    if isinstance(motor, Servo):
        held = {} if motor.range is None else {"ctrlrange": text((-motor.range, motor.range))}
        return "position", {"kp": text([steepness * motor.gain]), **attributes, **held}
    return "velocity", {**attributes, "ctrlrange": text((-motor.velocity, motor.velocity))}
