"""Forward kinematics of the start: joints move bodies from where their coordinates are 0 to where a motion begins."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from symphys.maths import rotation
from symphys.model.joints.frames import WORLD
from symphys.model.joints.joint import JointFrame
from symphys.model.joints.kind import Kind, PlacedFrames
from symphys.records import dataclass
from symphys.types import Array, Expr

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
        """Return the kind of joint, which says what it locks."""

    @property
    def first(self) -> str:
        """The body whose coordinates count."""

    @property
    def second(self) -> str | None:
        """Return the body that coordinates are measured against; None: the world."""

    @property
    def frames(self) -> tuple[JointFrame, JointFrame]:
        """Return the frames of the first and of the second side."""

    @property
    def frequency(self) -> float:
        """Return the natural frequency of a compliant joint [Hz]; 0: rigid."""

    @property
    def start(self) -> tuple[float, ...]:
        """The coordinates at the start [rad] or [m]; empty: all 0."""


@dataclass(frozen=True)
class BodyDisplacement:
    """A turn about a pivot (3,) [m] by a unit quaternion (4,), then a shift (3,) [m]; world frame."""

    pivot: Expr
    shift: Expr
    turn: Expr


def moved_to_start(joints: Sequence[NamedJoint], state: Mapping[str, Array]) -> State:
    """The state with every joint at its ``start``, from the one where all coordinates are 0.

    A joint with a start moves its first side and its subtree as one; if the world holds that side, it moves the other
    side, the other way. Joints that are not in the ``spanning_tree`` move nothing.

    Velocities are transformed too: the motion against the side that stays is turned along, so that rates of joints are
    what they were, and what moves or spins as a whole goes on doing so. Zero stays zero.
    """
    tree, found = spanning_tree(joints), {name: ca.DM(value) for name, value in state.items()}
    for joint in joints:
        if joint.start and joint.name in tree[joint.first]:
            move(joint, joint.start, tree, found)
    return {name: np.array(value).ravel() for name, value in found.items()}


def moved_to_zero(joints: Sequence[NamedJoint], state: Mapping[str, Array]) -> State:
    """The inverse of ``moved_to_start``: joints are at their ``start`` in ``state``, and at 0 in what it returns."""
    tree, found = spanning_tree(joints), {name: ca.DM(value) for name, value in state.items()}
    for joint in reversed(joints):
        if joint.start and joint.name in tree[joint.first]:
            move(joint, joint.start, tree, found, back=True)
    return {name: np.array(value).ravel() for name, value in found.items()}


def unmoved(joint: NamedJoint, tree: Tree) -> str:
    """Return the reason why a joint cannot have a ``start`` of its own, "closes a loop"; empty if it can."""
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
    placed, pivot = frames_of(joint, {name: ca.DM(value) for name, value in state.items()})
    a, b, apart = (np.array(part) for part in (placed.a, placed.b, placed.apart))
    return PlacedFrames(a, b, apart.ravel()), np.array(pivot).ravel()


def frames_of(joint: NamedJoint, state: Mapping[str, Expr]) -> tuple[PlacedFrames, Expr]:
    """Place frames as ``placed_frames`` does, in casadi's DM or MX."""
    axes, points = [], []
    for name, frame in zip((joint.first, joint.second or WORLD), joint.frames, strict=True):
        own, point = rotation.matrix(ca.DM(frame.orientation)), ca.DM(frame.point)
        if name != WORLD:
            turned = rotation.matrix(state[f"{name}.orientation"])
            own, point = turned @ own, state[f"{name}.position"] + turned @ point
        axes.append(own)
        points.append(point)
    return PlacedFrames(axes[0], axes[1], points[0] - points[1]), points[1]


def moving_side(joint: NamedJoint, tree: Tree) -> tuple[list[str], str, float]:
    """The bodies that a joint moves, what it moves them against, and 1 or -1: which way as its coordinates grow."""
    moved, base = subtree(joint.first, joint, tree), joint.second or WORLD
    if WORLD not in moved:
        return moved, base, 1.0
    return subtree(base, joint, tree), joint.first, -1.0


def move(joint: NamedJoint, start: Sequence[Expr], tree: Tree, state: dict[str, Expr], back: bool = False) -> None:
    """Move one side of a joint from coordinates 0 to these, or ``back``, in place; of casadi's DM or MX."""
    moved, base, sign = moving_side(joint, tree)
    placed, pivot = frames_of(joint, state)
    by: Expr = ca.vertcat(*start)
    turn, shift = joint.kind.transform(joint.kind.axes(placed), -by if back else by)
    if sign < 0:
        turn = ca.vertcat(turn[0], -turn[1:4])
        shift = -rotation.rotate(turn, shift)
    for name in moved:
        _displace(name, base, BodyDisplacement(pivot, shift, turn), state)


def drive(joint: NamedJoint, rates: Sequence[Expr], tree: Tree, state: dict[str, Expr]) -> None:
    """Add rates of its coordinates [rad/s] or [m/s] to the velocities of the side that ``move`` moves, in place."""
    moved, _, sign = moving_side(joint, tree)
    placed, pivot = frames_of(joint, state)
    for (slide, turn), rate in zip(joint.kind.motions(placed), rates, strict=True):
        velocity, spin = sign * rate * slide, sign * rate * turn
        for name in moved:
            arm = state[f"{name}.position"] - pivot
            state[f"{name}.angular_velocity"] = state[f"{name}.angular_velocity"] + spin
            state[f"{name}.velocity"] = state[f"{name}.velocity"] + velocity + ca.cross(spin, arm)


def _displace(name: str, base: str, motion: BodyDisplacement, state: dict[str, Expr]) -> None:
    """Displace a body, in place; ``base`` is what it moves against."""
    axes = rotation.matrix(motion.turn)
    before = state[f"{name}.position"]
    after = motion.pivot + axes @ (before - motion.pivot) + motion.shift
    velocity, spin, centre = _drift(base, state)
    own = state[f"{name}.velocity"] - velocity - ca.cross(spin, before - centre)
    state[f"{name}.velocity"] = velocity + ca.cross(spin, after - centre) + axes @ own
    state[f"{name}.angular_velocity"] = spin + axes @ (state[f"{name}.angular_velocity"] - spin)
    state[f"{name}.position"] = after
    orientation = rotation.multiply(motion.turn, state[f"{name}.orientation"])
    state[f"{name}.orientation"] = orientation / ca.norm_2(orientation)


def _drift(name: str, state: Mapping[str, Expr]) -> tuple[Expr, Expr, Expr]:
    """(3,) [m/s], (3,) [rad/s] and (3,) [m]: velocity, angular velocity and place of a body, or of the world."""
    if name == WORLD:
        return ca.DM.zeros(3), ca.DM.zeros(3), ca.DM.zeros(3)
    return state[f"{name}.velocity"], state[f"{name}.angular_velocity"], state[f"{name}.position"]
