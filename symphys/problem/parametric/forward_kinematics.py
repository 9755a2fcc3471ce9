"""Forward kinematics of the start: where joints with a ``start`` put the bodies of the file."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symphys.maths import rotation
from symphys.model.joints import PlacedFrames
from symphys.problem.parametric.joints import WORLD, ParametricJoint
from symphys.problem.reading.faults import Faults
from symphys.problem.tables.joint_frames import pose

Array = NDArray[np.float64]
State = dict[str, Array]
Tree = Mapping[str, Mapping[str, str]]
"""A spanning tree of rigid joints: what each body, and the world, is held to: by the names of the joints."""


@dataclass(frozen=True)
class BodyDisplacement:
    """A turn about a pivot (3,) [m] by a unit quaternion (4,), then a shift (3,) [m]; world frame."""

    pivot: Array
    shift: Array
    turn: Array


def forward_kinematics(joints: Sequence[ParametricJoint], initial: Mapping[str, Array], faults: Faults) -> State:
    """The state at the start with every joint at its ``start``; see ``Problem.initial``.

    Joint frames are where the bodies lie in the file. A joint with a start moves its second body in the table, and its
    subtree, as one; if the world holds that side, it moves the other side, the other way. Since a joint changes
    nothing within either side, the order of joints does not matter.

    Velocities are those of the file, transformed too: the motion against the side that stays is turned along, so that
    rates of joints are what they were, and what moves or spins as a whole goes on doing so. Zero stays zero.

    Args:
        joints: all joints.
        initial: the state as the file has it.
        faults: gets a start of a joint that gives way, or closes a loop of joints with a start.
    """
    state = {name: value.copy() for name, value in initial.items()}
    if not any(joint.start for joint in joints):
        return state
    tree = spanning_tree(joints)
    for index, joint in enumerate(joints):
        if joint.start and joint.name not in tree[joint.first]:
            reason = "gives way" if joint.frequency else "closes a loop"
            key = "start" if faults.data["joint"][index].get("start") is not None else "start_deg"
            text = f"this joint {reason}, so it begins where the other joints put it; leave this out"
            faults.add(("joint", index, key), text)
        elif joint.start:
            move(joint, tree, state)
    return state


def spanning_tree(joints: Sequence[ParametricJoint]) -> Tree:
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


def move(joint: ParametricJoint, tree: Tree, state: State) -> None:
    """Move one side of a joint to its start, in place."""
    moved, base, sign = subtree(joint.first, joint, tree), joint.second or WORLD, 1.0
    if WORLD in moved:
        moved, base, sign = subtree(base, joint, tree), joint.first, -1.0
    for coordinate, value in zip(joint.kind.coordinates, joint.start, strict=True):
        placed, pivot = placed_frames(joint, state)
        axis, angle = np.asarray(coordinate.axis(placed), float), sign * value * coordinate.turns
        motion = BodyDisplacement(
            pivot=pivot,
            shift=(sign * value - angle) * axis,
            turn=np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis]),
        )
        for name in moved:
            displace(name, base, motion, state)


def subtree(start: str, cut: ParametricJoint, tree: Tree) -> list[str]:
    """The bodies that the tree without the joint ``cut`` connects to one; among them the world, if it does so."""
    found, queue = {start: None}, [start]
    while queue:
        for name, other in tree[queue.pop()].items():
            if name != cut.name and other not in found:
                found[other] = None
                if other != WORLD:
                    queue.append(other)
    return list(found)


def placed_frames(joint: ParametricJoint, state: State) -> tuple[PlacedFrames, Array]:
    """Both frames of a joint in the world, and (3,) [m] where the second is."""
    axes, points = [], []
    for name, frame in zip((joint.first, joint.second or WORLD), joint.frames, strict=True):
        lies = pose(name, state)
        axes.append(lies.axes @ np.array(rotation.matrix(np.array(frame.orientation)), float))
        points.append(lies.to_world(np.array(frame.point)))
    return PlacedFrames(axes[0], axes[1], points[0] - points[1]), points[1]


def displace(name: str, base: str, motion: BodyDisplacement, state: State) -> None:
    """Displace a body, in place; ``base`` is what it moves against."""
    axes = np.array(rotation.matrix(motion.turn), float)
    before = state[f"{name}.position"]
    after = motion.pivot + axes @ (before - motion.pivot) + motion.shift
    velocity, spin, centre = drift(base, state)
    own = state[f"{name}.velocity"] - velocity - np.cross(spin, before - centre)
    state[f"{name}.velocity"] = velocity + np.cross(spin, after - centre) + axes @ own
    state[f"{name}.angular_velocity"] = spin + axes @ (state[f"{name}.angular_velocity"] - spin)
    state[f"{name}.position"] = after
    orientation = np.array(rotation.multiply(motion.turn, state[f"{name}.orientation"]), float).ravel()
    state[f"{name}.orientation"] = orientation / np.linalg.norm(orientation)


def drift(name: str, state: State) -> tuple[Array, Array, Array]:
    """(3,) [m/s], (3,) [rad/s] and (3,) [m]: velocity, angular velocity and place of a body, or of the world."""
    if name == WORLD:
        return np.zeros(3), np.zeros(3), np.zeros(3)
    return state[f"{name}.velocity"], state[f"{name}.angular_velocity"], state[f"{name}.position"]
