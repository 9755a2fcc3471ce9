"""Forward kinematics of the start: joints move bodies from where their coordinates are 0 to where a motion begins."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.joints.frames import WORLD, pose
from symphys.model.joints.joint import JointFrame
from symphys.model.joints.kind import Kind, PlacedFrames

Array = NDArray[np.float64]
State = dict[str, Array]
"""By names such as ``ball.position``."""
Tree = Mapping[str, Mapping[str, str]]
"""A spanning tree of rigid joints: what each body, and the world, is held to: by the names of the joints."""


class NamedJoint(Protocol):
    """A joint between bodies by name."""

    @property
    def name(self) -> str:
        """Unique."""

    @property
    def kind(self) -> Kind:
        """What it locks."""

    @property
    def first(self) -> str:
        """The body whose coordinates count."""

    @property
    def second(self) -> str | None:
        """What these are measured against; None: the world."""

    @property
    def frames(self) -> tuple[JointFrame, JointFrame]:
        """Of the first and of the second."""

    @property
    def frequency(self) -> float:
        """[Hz] of a joint that gives way; 0: rigid."""

    @property
    def start(self) -> tuple[float, ...]:
        """The coordinates at the start [rad] or [m]; empty: all 0."""


@dataclass(frozen=True)
class BodyDisplacement:
    """A turn about a pivot (3,) [m] by a unit quaternion (4,), then a shift (3,) [m]; world frame."""

    pivot: Array
    shift: Array
    turn: Array


def moved_to_start(joints: Sequence[NamedJoint], state: Mapping[str, Array]) -> State:
    """The state with every joint at its ``start``, from the one where all coordinates are 0.

    A joint with a start moves its first side and its subtree as one; if the world holds that side, it moves the other
    side, the other way. Joints that are not in the ``spanning_tree`` move nothing.

    Velocities are transformed too: the motion against the side that stays is turned along, so that rates of joints are
    what they were, and what moves or spins as a whole goes on doing so. Zero stays zero.
    """
    found, tree = {name: value.copy() for name, value in state.items()}, spanning_tree(joints)
    for joint in joints:
        if joint.start and joint.name in tree[joint.first]:
            _move(joint, tree, found, 1.0)
    return found


def moved_to_zero(joints: Sequence[NamedJoint], state: Mapping[str, Array]) -> State:
    """The inverse of ``moved_to_start``: joints are at their ``start`` in ``state``, and at 0 in what it returns."""
    found, tree = {name: value.copy() for name, value in state.items()}, spanning_tree(joints)
    for joint in reversed(joints):
        if joint.start and joint.name in tree[joint.first]:
            _move(joint, tree, found, -1.0)
    return found


def unmoved(joint: NamedJoint, tree: Tree) -> str:
    """Why a joint cannot have a ``start`` of its own, "closes a loop"; empty if it can."""
    if joint.name in tree[joint.first]:
        return ""
    return "gives way" if joint.frequency else "closes a loop"


def spanning_tree(joints: Sequence[NamedJoint]) -> Tree:
    """A spanning tree of the rigid joints, those with a start first."""
    roots: dict[str, str] = {}

    def root(name: str) -> str:
        while name in roots:
            name = roots[name]
        return name

    found: dict[str, dict[str, str]] = defaultdict(dict)
    for joint in sorted(joints, key=lambda joint: not joint.start):
        a, b = root(joint.first), root(joint.second or WORLD)
        if a != b and not joint.frequency:
            roots[a] = b
            first, second = joint.first, joint.second or WORLD
            found[first][joint.name], found[second][joint.name] = second, first
    return found


def subtree(start: str, cut: NamedJoint, tree: Tree) -> list[str]:
    """The bodies that the tree without the joint ``cut`` connects to one; among them the world, if it does so."""
    found, queue = {start: None}, [start]
    while queue:
        for name, other in tree[queue.pop()].items():
            if name != cut.name and other not in found:
                found[other] = None
                if other != WORLD:
                    queue.append(other)
    return list(found)


def placed_frames(joint: NamedJoint, state: Mapping[str, Array]) -> tuple[PlacedFrames, Array]:
    """Both frames of a joint in the world, and (3,) [m] where the second is."""
    axes, points = [], []
    for name, frame in zip((joint.first, joint.second or WORLD), joint.frames, strict=True):
        lies = pose(name, state)
        axes.append(lies.axes @ np.array(rotation.matrix(np.array(frame.orientation)), float))
        points.append(lies.to_world(np.array(frame.point)))
    return PlacedFrames(axes[0], axes[1], points[0] - points[1]), points[1]


def _move(joint: NamedJoint, tree: Tree, state: State, way: float) -> None:
    """Move one side of a joint from coordinates 0 to its start (``way`` 1), or back (-1), in place."""
    moved, base, sign = subtree(joint.first, joint, tree), joint.second or WORLD, way
    if WORLD in moved:
        moved, base, sign = subtree(base, joint, tree), joint.first, -way
    coordinates = list(zip(joint.kind.coordinates, joint.start, strict=True))
    for coordinate, value in coordinates if way > 0 else reversed(coordinates):
        placed, pivot = placed_frames(joint, state)
        axis, angle = np.asarray(coordinate.axis(placed), float), sign * value * coordinate.turns
        motion = BodyDisplacement(
            pivot=pivot,
            shift=(sign * value - angle) * axis,
            turn=np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis]),
        )
        for name in moved:
            _displace(name, base, motion, state)


def _displace(name: str, base: str, motion: BodyDisplacement, state: State) -> None:
    """Displace a body, in place; ``base`` is what it moves against."""
    axes = np.array(rotation.matrix(motion.turn), float)
    before = state[f"{name}.position"]
    after = motion.pivot + axes @ (before - motion.pivot) + motion.shift
    velocity, spin, centre = _drift(base, state)
    own = state[f"{name}.velocity"] - velocity - np.cross(spin, before - centre)
    state[f"{name}.velocity"] = velocity + np.cross(spin, after - centre) + axes @ own
    state[f"{name}.angular_velocity"] = spin + axes @ (state[f"{name}.angular_velocity"] - spin)
    state[f"{name}.position"] = after
    orientation = np.array(rotation.multiply(motion.turn, state[f"{name}.orientation"]), float).ravel()
    state[f"{name}.orientation"] = orientation / np.linalg.norm(orientation)


def _drift(name: str, state: State) -> tuple[Array, Array, Array]:
    """(3,) [m/s], (3,) [rad/s] and (3,) [m]: velocity, angular velocity and place of a body, or of the world."""
    if name == WORLD:
        return np.zeros(3), np.zeros(3), np.zeros(3)
    return state[f"{name}.velocity"], state[f"{name}.angular_velocity"], state[f"{name}.position"]
