"""Joints of trees as MJCF joints, the keyframe of the start, and equality constraints: loops, screws, couplings."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from xml.etree.ElementTree import Element

import numpy as np
from numpy.polynomial import Polynomial

from symphys.export.mjcf_bodies import NestedBody, StartState, nesting_joints, plain, tidy
from symphys.export.mjcf_surfaces import text
from symphys.maths import rotation
from symphys.model.joints import Joint, Link
from symphys.model.joints.coupling import JointCoupling
from symphys.model.scalar import is_zero
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Array

UNBOUNDED = 1e10
"""Limit of a coordinate where one of two is missing [rad], [m]."""


@dataclass(frozen=True)
class Freedom:
    """A joint of MJCF.

    Attributes:
        element: the joint.
        qpos, qvel: its coordinates and velocities in the keyframe.
    """

    element: Element
    qpos: Array
    qvel: Array


def freedoms(start: StartState, reference: StartState, nested: NestedBody) -> list[Freedom]:
    """Write the joints between a body and its parent, in MuJoCo's order, from the parent on.

    Args:
        start: the state of the keyframe.
        reference: the poses that the file has.
        nested: the body.
    """
    return [freedom for link in nested.links for freedom in link_freedoms(start, reference, link, nested.body)]


def link_freedoms(start: StartState, reference: StartState, link: Link, body: int) -> list[Freedom]:
    """Write the free directions of one joint on the chain to a body, in that body's frame as the file has it."""
    if link.joint is None:
        pose = np.concatenate([start.of(body, "position"), start.of(body, "orientation")])
        spin = start.axes(body).T @ start.of(body, "angular_velocity")
        qvel = np.concatenate([start.of(body, "velocity"), spin])
        return [Freedom(Element("freejoint", name=start.world.bodies[body].name), pose, qvel)]
    joint, place = start.world.joints[link.joint], text(anchor(reference, link, body))
    if joint.kind.name == "ball":
        spin = start.of(link.body, "angular_velocity")
        spin = spin if link.parent is None else spin - start.of(link.parent, "angular_velocity")
        turned = start.axes(link.body) @ reference.axes(link.body).T @ reference.axes(body)
        element = Element("joint", {"name": joint.name, "type": "ball", "pos": place, **acting(joint)})
        return [Freedom(element, np.array([1.0, 0, 0, 0]), turned.T @ spin)]
    found = []
    turned = link.sign * reference.axes(body).T
    values, now = reference.values(joint), start.values(joint)
    rates = plain(start.readings[joint.name].rate)
    for k, (slide, turn) in enumerate(reference.motions(joint)):
        coordinate = joint.kind.coordinates[k]
        moves = [(names(joint)[k], "hinge" if coordinate.turns else "slide", 1.0, acting(joint))]
        if coordinate.is_screw:
            moves.append((slide_of(joint, k), "slide", float(coordinate.lead), {}))
        for name, kind, share, parts in moves:
            attributes = {"name": name, "type": kind, "pos": place}
            attributes["axis"] = text(tidy(turned @ (turn if coordinate.turns else slide)))
            if values[k]:
                attributes["ref"] = text(share * values[[k]])
            found.append(Freedom(Element("joint", attributes | parts), share * now[[k]], share * rates[[k]]))
    return found[:: link.sign]


def slide_of(joint: Joint, k: int) -> str:
    """Return the name of the slide that follows the hinge of a screw in MJCF."""
    return f"{names(joint)[k]}.slide"


def anchor(reference: StartState, link: Link, body: int) -> Array:
    """Return the point (3,) [m] of a link's joint on its child, in the frame of a body."""
    joint = reference.world.joints[link.joint or 0]
    point = np.array(joint.frames[0 if link.sign > 0 else 1].point, float)
    if link.body == body:
        return point
    place = reference.of(link.body, "position") + reference.axes(link.body) @ point
    return tidy(reference.axes(body).T @ (place - reference.of(body, "position")))


def acting(joint: Joint) -> dict[str, str]:
    """Return limits, spring, armature and dry friction of each coordinate, or of the rotations of a ball joint."""
    found, limits, spring = {}, joint.limits, joint.spring
    if limits.lower is not None or limits.upper is not None:
        ends = (limits.lower, -UNBOUNDED), (limits.upper, UNBOUNDED)
        found["range"] = text(other if end is None else end for end, other in ends)
    if spring is not None and joint.kind.coordinates:
        found["stiffness"] = text([spring.stiffness])
        found["springref"] = text([spring.rest])
    if spring is not None:
        found["damping"] = text([spring.damping])
    dry = {"armature": joint.armature, "frictionloss": joint.friction}
    return found | {key: text([value]) for key, value in dry.items() if not is_zero(value)}


def names(joint: Joint) -> list[str]:
    """Return the names of the coordinates, which MuJoCo's joints have."""
    coordinates = joint.kind.coordinates
    return [joint.name] if len(coordinates) == 1 else [f"{joint.name}.{c.name}" for c in coordinates]


def joint_equalities(reference: StartState) -> Iterator[Element]:
    """Make the equality constraints between coordinates, of screws in trees and of couplings."""
    world = reference.world
    for joint in (world.joints[index] for index in sorted(nesting_joints(world))):
        for k, coordinate in enumerate(joint.kind.coordinates):
            if coordinate.is_screw:
                tied = {"joint1": slide_of(joint, k), "joint2": names(joint)[k]}
                numbers = text([0.0, float(coordinate.lead), 0.0, 0.0, 0.0])
                yield Element("joint", {"name": f"{names(joint)[k]}.thread", **tied, "polycoef": numbers})
    for coupling in world.couplings:
        yield coupled(reference, coupling)


def coupled(reference: StartState, coupling: JointCoupling) -> Element:
    """Return the equality of a coupling, whose polynomial counts coordinates from the pose of the file."""
    joints = [reference.world.joints[k] for k in (coupling.first, coupling.second) if k is not None]
    shifts = [float(reference.values(joint)[0]) for joint in joints]
    polynomial = Polynomial([float(c) for c in coupling.polynomial])
    polynomial = polynomial(Polynomial([shifts[1], 1.0])) if len(shifts) > 1 else Polynomial([polynomial(0.0)])
    numbers = np.zeros(5)
    numbers[: len(polynomial.coef)] = polynomial.coef
    numbers[0] -= shifts[0]
    attributes = {f"joint{k + 1}": joint.name for k, joint in enumerate(joints)}
    return Element("joint", {"name": coupling.name, **attributes, "polycoef": text(numbers)})


AXIS_ARM = 0.05
"""Distance of the two points on the axis of a hinge that are held together from its point [m]."""
IMPEDANCE = 1e-4
"""The least that MuJoCo takes: the constraint acts as a spring and damper in addition to all other forces."""


def expressible_loop(world: World, joint: Joint) -> bool:
    """Whether an equality constraint can replace a joint that is not part of the trees."""
    kinds = ("ball", "fixed") if joint.soft else ("ball", "fixed", "hinge")
    return joint.kind.name in kinds and not any(world.bodies[k].massless for k in joint.bodies)


def equalities(reference: StartState) -> Iterator[Element]:
    """Write each joint that is not part of the trees and has a counterpart, and each coupling."""
    world = reference.world
    trees = nesting_joints(world)
    for k, joint in enumerate(world.joints):
        if k not in trees and expressible_loop(world, joint):
            yield from loop(world, joint)
    yield from joint_equalities(reference)


def loop(world: World, joint: Joint) -> Iterator[Element]:
    """Write a joint whose frames meet where the file has the bodies: MuJoCo holds the pose that it reads there.

    The anchor of points that stay together is on ``body1``, that of a weld on ``body2``, which may be the world.
    """
    bodies = [world.bodies[k].name for k in reversed(joint.bodies)]
    named = {f"body{k + 1}": name for k, name in enumerate(bodies)} | softness(joint)
    on_first, on_second = joint.frames if joint.second is None else reversed(joint.frames)
    if joint.kind.name == "fixed":
        yield Element("weld", {"name": joint.name, **named, "anchor": text(on_second.point)})
        return
    point = np.array(on_first.point, float)
    if joint.kind.name == "ball":
        yield Element("connect", {"name": joint.name, **named, "anchor": text(point)})
        return
    axis = np.array(rotation.matrix(np.array(on_first.orientation, float)))[:, 0]
    for name, way in ((joint.name, 1), (f"{joint.name}_axis", -1)):
        yield Element("connect", {"name": name, **named, "anchor": text(point + way * AXIS_ARM * axis)})


def softness(joint: Joint) -> dict[str, str]:
    """Return the attributes of a compliant joint: stiffness and damping by mass, MuJoCo's direct form."""
    if not joint.soft:
        return {}
    rate = 2 * pi * joint.frequency
    stiffness, damping = rate * rate, 2 * max(joint.damping, 1e-9) * rate
    return {"solref": text((-stiffness, -damping)), "solimp": text((IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0))}
