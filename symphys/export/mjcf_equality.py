"""Write joints that close loops, compliant joints, and couplings as MJCF equality constraints."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from xml.etree.ElementTree import Element

import numpy as np

from symphys.export.mjcf_bodies import StartState, nesting_joints
from symphys.export.mjcf_joints import joint_equalities
from symphys.export.mjcf_surfaces import text
from symphys.maths import rotation
from symphys.model.joints import Joint
from symphys.model.world import World

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
