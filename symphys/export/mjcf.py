"""A world and its start as MJCF, the model files of MuJoCo.

Written as they are: bodies, their frames at the centres of mass, inertias, trees of joints with the coordinates that
they have here (``ref`` at the start), springs, dampers, torque motors, gravity, time step, surfaces, and which of them
may touch: geoms meet in explicit pairs only. The start is the keyframe ``start``.

For some things MuJoCo has laws of its own:

- Contacts and limits are springs and dampers there, which act over several steps, with their default softness; here
  they are rigid. Friction is on the same disc (elliptic cone); torsion and rolling share one ellipsoid with it.
- A servo here aims at the velocity clip(gain (command - angle), +-velocity), and reaches it within a step unless that
  takes more than its torque. Nearest is a position actuator with kv = 100 torque / velocity, kp = gain kv and the same
  bound of force. It aims at gain (command - angle), not held in +-velocity, and gives all of its torque only where the
  velocity is off by a hundredth of the largest: it sags under load.
- A velocity motor likewise becomes a velocity actuator with that kv.

Such actuators are stiff, hence the integrator ``implicitfast``. What has no counterpart is refused: restitution,
contacts and joints that give way, joints that close a loop, terrain. Variables and objectives are no part of a
model, and commands are its ctrl, 0 at the start.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.motion import inertia_matrix
from symphys.export.folder import ExportError
from symphys.export.mjcf_joints import StartState, actuators, freedoms, plain
from symphys.export.mjcf_surfaces import geoms, pairs, text
from symphys.model.body import Body
from symphys.model.joints import Link, kinematic_trees, tree_joints
from symphys.model.joints.kinematic_tree import FLOATING
from symphys.model.scalar import is_zero
from symphys.model.shapes import Terrain
from symphys.model.world import World
from symphys.problem import Problem

Array = NDArray[np.float64]
APART = 1e-5
"""[m], [rad]: what of a joint's frames must not be apart at the start."""
LISTED = 5
"""Names in a refusal."""


def mjcf_files(problem: Problem) -> dict[str, bytes]:
    """name -> content of the one file; ExportError names what MJCF cannot say."""
    model = mjcf(problem.world(), problem.initial, problem.simulation.dt, problem.name)
    return {f"{problem.name}.xml": model.encode()}


def mjcf(world: World, initial: Mapping[str, Any], dt: float, name: str = "world") -> str:
    """The text of a model.

    Args:
        world: plain numbers, no symbols.
        initial: the bodies' state at the start by name, SI units, world frame; see ``state.initial_state``.
        dt: time step [s].
        name: of the model.

    Raises:
        ExportError: names all that MJCF cannot say.
    """
    start = StartState(world, initial)
    require_expressible(start, name)
    model = Element("mujoco", model=name)
    SubElement(model, "compiler", angle="radian", inertiafromgeom="false")
    options = {"timestep": repr(float(dt)), "gravity": text(world.gravity)}
    SubElement(model, "option", {**options, "integrator": "implicitfast", "cone": "elliptic"})
    worldbody = SubElement(model, "worldbody")
    worldbody.extend(geoms(world, None))
    numbers = Keyframe(start, links_of(world))
    worldbody.extend(numbers.bodies(None))
    model.append(pairs(world))
    SubElement(model, "actuator").extend(motor for joint in world.joints for motor in actuators(joint))
    SubElement(SubElement(model, "keyframe"), "key", name="start", qpos=text(numbers.qpos), qvel=text(numbers.qvel))
    indent(model)
    return tostring(model, encoding="unicode") + "\n"


def links_of(world: World) -> list[Link]:
    """Every body with the joint that holds it to its parent; one by itself floats."""
    links = [link for tree in kinematic_trees(world.joints) for link in tree.links]
    held = {link.body for link in links}
    return links + [Link(k, None, None, 1, 0, FLOATING) for k in range(len(world.bodies)) if k not in held]


class Keyframe:
    """Bodies as nested elements, and the numbers of the start in the order in which MuJoCo meets their joints."""

    def __init__(self, start: StartState, links: list[Link]) -> None:
        """Nothing written so far."""
        self.start, self.links = start, links
        self.qpos: list[float] = []
        self.qvel: list[float] = []

    def bodies(self, parent: int | None) -> Iterator[Element]:
        """The children of a body, or of the world, with their subtrees."""
        for link in self.links:
            if link.parent == parent:
                yield self.body(link)

    def body(self, link: Link) -> Element:
        """A body: where it is in its parent's frame, how it may move, what it is."""
        body = self.start.world.bodies[link.body]
        element = Element("body", {"name": body.name, **relative(self.start, link)})
        for freedom in freedoms(self.start, link):
            element.append(freedom.element)
            self.qpos += freedom.qpos.tolist()
            self.qvel += freedom.qvel.tolist()
        element.append(Element("inertial", {"pos": "0 0 0", "mass": text([body.mass]), **moments(body)}))
        element.extend(geoms(self.start.world, link.body))
        element.extend(self.bodies(link.body))
        return element


def relative(start: StartState, link: Link) -> dict[str, str]:
    """Position and orientation of a body at the start, in the frame of its parent."""
    p, q = start.of(link.body, "position"), start.of(link.body, "orientation")
    if link.parent is not None:
        a, b = start.of(link.parent, "orientation"), q
        p = start.axes(link.parent).T @ (p - start.of(link.parent, "position"))
        vector = a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])
        q = np.array([a @ b, *vector])
    return {"pos": text(p), "quat": text(q)}


def moments(body: Body) -> dict[str, str]:
    """Moments of inertia along the body's axes, or the tensor where these are not its principal ones."""
    tensor = np.array(ca.DM(inertia_matrix(body.inertia)))
    if not (tensor - np.diag(np.diag(tensor))).any():
        return {"diaginertia": text(np.diag(tensor))}
    return {"fullinertia": text([*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]])}


def require_expressible(start: StartState, name: str) -> None:
    """ExportError with all that has no counterpart, and what can be done."""
    lines = [f"{name}: MJCF cannot say this: {listed(found)}: {why}" for why, found in refusals(start) if found]
    if lines:
        raise ExportError("\n".join(lines))


def listed(names: Sequence[str]) -> str:
    """The first few of them."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def refusals(start: StartState) -> Iterator[tuple[str, list[str]]]:
    """Reasons, and the names of what they hold for."""
    world, trees = start.world, tree_joints(start.world.joints)
    contacts = {pair.name.partition(":")[0]: pair.law for pair in world.pairs}
    bouncing = [name for name, law in contacts.items() if not law.soft and not is_zero(law.restitution)]
    yield "restitution, which MuJoCo does not have; give the surfaces restitution 0", bouncing
    soft = [name for name, law in contacts.items() if law.soft]
    yield "contact that gives way, by another law than MuJoCo's; leave out its frequency", soft
    yield "terrain; take a plane, or blocks", [s.name for s in world.statics if isinstance(s, Terrain)]
    soft = [joint.name for joint in world.joints if joint.soft]
    yield "a joint that gives way, by another law than MuJoCo's; leave out its frequency", soft
    loops = [joint.name for k, joint in enumerate(world.joints) if k not in trees and not joint.soft]
    yield "a joint that closes a loop, where MuJoCo's give way; leave it out", loops
    apart = [world.joints[k].name for k in sorted(trees) if gap(start, world.joints[k].name) > APART]
    yield "a joint that does not fit its bodies at the start; move them until its frames meet", apart


def gap(start: StartState, joint: str) -> float:
    """How far the frames of a joint are apart, or turned, as far as it holds them [m], [rad]."""
    reading = start.readings[joint]
    return float(max(plain(reading.separation)[0], plain(reading.tilt)[0]))
