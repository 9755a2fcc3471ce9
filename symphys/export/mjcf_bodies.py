"""Nest the bodies of a world as MJCF does, each with the chain of joints to its parent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.joints.joint_frames import joint_frames_at
from symphys.dynamics.observation.joint_coordinates import Reading, readings
from symphys.maths import rotation
from symphys.model.joints import Joint, Link
from symphys.model.joints.kinematic_tree import FLOATING
from symphys.model.joints.start import moved_to_zero
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import World
from symphys.problem.world_tables import placed_joint, whole_state
from symphys.records import dataclass
from symphys.types import Array

MAX_JOINT_GAP = 1e-5
"""Largest gap between the frames of a joint [m], [rad]."""
ROUNDING = 1e-15
"""Largest rounding error, of lengths [m] or of components of unit vectors."""


@dataclass(frozen=True)
class StartState:
    """A world in a state: at the start, or at the reference pose of its model file.

    Attributes:
        world: a world of numbers, without symbols.
        initial: the state by name, as ``symphys.model.initial_state`` takes it.
    """

    world: World
    initial: Mapping[str, Any]

    @cached_property
    def x(self) -> ca.DM:
        """The state vector (nx,)."""
        return ca.DM(initial_state(self.world, self.initial))

    def of(self, body: int, field: str) -> Array:
        """Return a quantity (k,) of a body, such as "position", world frame."""
        return np.array(self.x[self.layout[f"{self.world.bodies[body].name}.{field}"]]).ravel()

    @cached_property
    def layout(self) -> Layout:
        """The layout of the state vector."""
        return Layout(self.world)

    def axes(self, body: int | None) -> Array:
        """Return the rotation matrix (3, 3) from a body's frame to the world's; the identity for None."""
        return np.eye(3) if body is None else np.array(rotation.matrix(ca.DM(self.of(body, "orientation"))))

    @cached_property
    def readings(self) -> dict[str, Reading]:
        """The coordinates and rates of each joint, by its name."""
        return readings(self.world, ca.SX(self.x))

    def values(self, joint: Joint) -> Array:
        """Return the coordinates (k,) of a joint [rad] or [m]."""
        return tidy(plain(self.readings[joint.name].value))

    def gap(self, joint: Joint) -> float:
        """Return how far the frames of a joint violate it: the larger of distance [m] and angle [rad]."""
        reading = self.readings[joint.name]
        return float(max(plain(reading.separation)[0], plain(reading.tilt)[0]))

    @cached_property
    def reference(self) -> StartState:
        """The poses that the file has: all coordinates 0, or the start if that would open a loop."""
        world, state = self.world, whole_state(self.world, self.initial)
        zero = StartState(world, moved_to_zero([placed_joint(world, joint, state) for joint in world.joints], state))
        closed = all(zero.gap(joint) <= MAX_JOINT_GAP for joint in world.joints if not joint.soft)
        return zero if closed else self

    def motions(self, joint: Joint) -> list[tuple[Array, Array]]:
        """Return displacement and rotation (3,) of the first side per unit of each coordinate, world frame."""
        poses = tuple((ca.SX(self.of(i, "position")), ca.SX(self.of(i, "orientation"))) for i in joint.bodies)
        placed = joint_frames_at(joint, poses).placed(ca.SX(0))
        return [(plain(slide), plain(turn)) for slide, turn in joint.kind.motions(placed)]


def tidy(numbers: Array) -> Array:
    """Replace rounding errors by 0."""
    return np.where(np.abs(numbers) < ROUNDING, 0.0, numbers)


def plain(expression: Any) -> Array:
    """Evaluate an expression without symbols to numbers (k,)."""
    return np.array(ca.evalf(expression)).ravel()


@dataclass(frozen=True)
class NestedBody:
    """A body of MJCF; frames without mass become joints of the body that they lead to.

    Attributes:
        body: index of the body.
        parent: index of the body that it is nested in; None: the world.
        links: the links from the parent to the body; several if there are frames without mass between them.
    """

    body: int
    parent: int | None
    links: tuple[Link, ...]


def nested_bodies(world: World) -> list[NestedBody]:
    """Return each body with mass, in the order of the world's bodies."""
    links = links_of(world)
    merged, by_body, found = merged_frames(world, links), {link.body: link for link in links}, []
    for link in sorted(links, key=lambda link: link.body):
        if link.body not in merged:
            chain = [link]
            while chain[0].parent in merged:
                chain.insert(0, by_body[chain[0].parent])
            found.append(NestedBody(link.body, chain[0].parent, tuple(chain)))
    return found


def merged_frames(world: World, links: list[Link]) -> frozenset[int]:
    """Return the bodies without mass that lie between two joints of one chain."""
    children = Counter(link.parent for link in links)
    return frozenset(
        link.body
        for link in links
        if world.bodies[link.body].massless and link.joint is not None and children[link.body] == 1
    )


def loose_frames(world: World) -> list[int]:
    """Return the bodies without mass that cannot become joints of another body."""
    merged = merged_frames(world, links_of(world))
    return [k for k, body in enumerate(world.bodies) if body.massless and k not in merged]


def nesting_joints(world: World) -> frozenset[int]:
    """Return the indices of joints that nest one body in another; the others become equality constraints.

    A joint closes a loop if earlier ones connect its sides already. Joints along which something acts come first,
    then all others, in the order of the world.
    """
    groups: dict[int | None, int | None] = {}

    def group(side: int | None) -> int | None:
        while side in groups:
            side = groups[side]
        return side

    found = set()
    for k, joint in sorted(enumerate(world.joints), key=lambda each: (not each[1].acting, each[0])):
        one, other = group(joint.first), group(joint.second)
        if one != other and not joint.soft:
            one, other = (one, other) if one is not None else (other, one)
            groups[one] = other
            found.add(k)
    return frozenset(found)


def links_of(world: World) -> list[Link]:
    """Return each body with the joint to its parent; a floating root has none.

    The root of a floating tree is a body that is the first side of no joint, if there is one: children are then first
    sides, and axes keep their signs.
    """
    nesting = {k: world.joints[k] for k in sorted(nesting_joints(world))}
    firsts = {joint.first for joint in nesting.values()}
    held = {joint.first: Link(joint.first, k, None, 1, 0, 0) for k, joint in nesting.items() if joint.second is None}
    floating = sorted(range(len(world.bodies)), key=lambda body: (body in firsts, body))
    found: dict[int, Link] = {}
    for root in (*held.values(), *(Link(body, None, None, 1, 0, FLOATING) for body in floating)):
        if root.body not in found:
            found |= {link.body: link for link in grown(nesting, root)}
    return list(found.values())


def grown(joints: Mapping[int, Joint], root: Link) -> list[Link]:
    """Collect a tree from its root; parents come before children."""
    links = [root]
    for link in links:
        for k, joint in joints.items():
            if k != link.joint and joint.second is not None and link.body in joint.bodies:
                child = joint.second if joint.first == link.body else joint.first
                links.append(Link(child, k, link.body, 1 if joint.first == child else -1, 0, 0))
    return links


def relative(start: StartState, nested: NestedBody) -> tuple[Array, Array]:
    """Return position (3,) [m] and orientation (4,) of a body in the frame of its parent."""
    p, q = start.of(nested.body, "position"), start.of(nested.body, "orientation")
    if nested.parent is None:
        return p, q
    a, b = start.of(nested.parent, "orientation"), q
    vector = a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])
    moved = start.axes(nested.parent).T @ (p - start.of(nested.parent, "position"))
    return tidy(moved), tidy(np.array([a @ b, *vector]))
