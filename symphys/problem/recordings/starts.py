"""The start of a motion as its recording has it: the bodies that it names, and those that joints carry with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from symphys.model.joints.frames import WORLD
from symphys.model.joints.joint import UNWRAPPED
from symphys.model.joints.start import moved_to_start, moved_to_zero, placed_frames, spanning_tree
from symphys.model.state_layout import GIVEN
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.placement import follow
from symphys.records import dataclass
from symphys.types import Array

State = dict[str, Array]


@dataclass(frozen=True)
class RecordedJoint:
    """A coordinate or rate of a joint that a recording may set: ``hinge.angle``, ``hinge.rate``."""

    joint: ParametricJoint
    rate: bool


def joint_starts(joints: Sequence[ParametricJoint]) -> dict[str, RecordedJoint]:
    """Map names to what recordings may set of rigid joints with one coordinate that close no loop."""
    tree, found = spanning_tree(joints), dict[str, RecordedJoint]()
    for joint in joints:
        if joint.name in tree[joint.first] and len(joint.kind.coordinates) == 1:
            found[f"{joint.name}.{joint.kind.quantity}"] = RecordedJoint(joint, rate=False)
            found[f"{joint.name}.rate"] = RecordedJoint(joint, rate=True)
    return found


class Starts:
    """The states of all bodies at the starts of recordings."""

    def __init__(self, joints: Sequence[ParametricJoint], initial: Mapping[str, Array]) -> None:
        """``initial``: the start in the file, with every joint at its ``start``."""
        self.joints = {joint.name: joint for joint in joints}
        self.initial = dict(initial)
        self.of_joints = joint_starts(joints)
        self._tree = spanning_tree(joints)

    def complete(self, given: Mapping[str, Array]) -> State:
        """Return what a recording sets, and the states of all bodies carried by joints, by names of ``initial``.

        A joint has the coordinate and the rate that are given, else those of the file. A body that is given itself is
        not carried by others. Poses say nothing of whole turns: ``hinge.unwrapped`` is an angle that is given.
        """
        plain = {name: value.copy() for name, value in given.items() if name not in self.of_joints}
        bent = {name: float(value[0]) for name, value in given.items() if name in self.of_joints}
        touched = [self.of_joints[name].joint for name in bent]
        own = {name.rpartition(".")[0]: None for name in plain}
        ends = {end: None for joint in touched for end in (joint.first, joint.second) if end is not None}
        group = self._connected([*own, *ends])
        angles = {self.of_joints[name].joint: value for name, value in bent.items() if not self.of_joints[name].rate}
        near = {f"{joint.name}.{UNWRAPPED}": np.array([value]) for joint, value in angles.items() if joint.kind.winds}
        if len(group) == len(own):
            return plain | near
        before = self._bent(bent)
        state = {name: value.copy() for name, value in before.items()} | plain
        rates = {self.of_joints[name].joint.name: value for name, value in bent.items() if self.of_joints[name].rate}
        for joint, base, body in self._outwards([*own], group):
            if base != WORLD:
                moved = follow(body, base, casadi_state(before), casadi_state(state))
                state |= {name: np.array(value).ravel() for name, value in moved.items()}
            if joint.name in rates:
                turn_on(joint, body, rates[joint.name], state)
        return {f"{body}.{field}": state[f"{body}.{field}"] for body in group for field in GIVEN} | near

    def coordinates(self, given: Mapping[str, Array]) -> dict[str, Array]:
        """Return what a recording sets of joints, by the names of variables: ``hinge.start`` [rad] or [m]."""
        found = {}
        for name, each in self.of_joints.items():
            if name in given:
                found[f"{each.joint.name}.{'start_rate' if each.rate else 'start'}"] = given[name]
        return found

    def _bent(self, bent: Mapping[str, float]) -> State:
        """The file's start with other coordinates of joints."""
        angles = {self.of_joints[n].joint.name: v for n, v in bent.items() if not self.of_joints[n].rate}
        if not angles:
            return self.initial
        joints = list(self.joints.values())
        posed = [replace(each, start=(angles[each.name],)) if each.name in angles else each for each in joints]
        return moved_to_start(posed, moved_to_zero(joints, self.initial))

    def _connected(self, bodies: Sequence[str]) -> list[str]:
        """These bodies, and all that joints connect to them, but through the world."""
        found, queue = dict.fromkeys(bodies), [*bodies]
        while queue:
            for other in self._tree[queue.pop()].values():
                if other != WORLD and other not in found:
                    found[other] = None
                    queue.append(other)
        return list(found)

    def _outwards(self, own: Sequence[str], group: Sequence[str]) -> Iterator[tuple[ParametricJoint, str, str]]:
        """Joints from what stays outwards, each with the body that carries and the one that is carried."""
        firsts = {joint.first for joint in self.joints.values() if joint.name in self._tree[joint.first]}
        seen, queue = {WORLD, *own}, [WORLD, *own]
        while True:
            while queue:
                base = queue.pop(0)
                for name, other in self._tree[base].items():
                    if other in group and other not in seen:
                        seen.add(other)
                        queue.append(other)
                        yield self.joints[name], base, other
            left = [body for body in group if body not in seen]
            if not left:
                return
            root = next((body for body in left if body not in firsts), left[0])
            seen.add(root)
            queue.append(root)


def turn_on(joint: ParametricJoint, body: str, rate: float, state: State) -> None:
    """Give a body, in place, the rate of its joint; what the file's start has of it is replaced."""
    placed, point = placed_frames(joint, state)
    ((slide, turn),) = ([np.array(ca.DM(part)).ravel() for part in each] for each in joint.kind.motions(placed))
    base = (joint.second or WORLD) if body == joint.first else joint.first
    sign = 1.0 if body == joint.first else -1.0
    spin, velocity, centre = motion_of(base, state)
    arm = state[f"{body}.position"] - centre
    still = velocity + np.cross(spin, arm)
    state[f"{body}.angular_velocity"] = spin + sign * rate * turn
    state[f"{body}.velocity"] = still + sign * rate * (slide + np.cross(turn, state[f"{body}.position"] - point))


def casadi_state(state: State) -> dict[str, ca.DM]:
    """Return the numbers unchanged."""
    return {name: ca.DM(value) for name, value in state.items()}


def motion_of(name: str, state: State) -> tuple[Array, Array, Array]:
    """(3,) [rad/s], (3,) [m/s] and (3,) [m]: spin, velocity and place of a body, or of the world."""
    if name == WORLD:
        return np.zeros(3), np.zeros(3), np.zeros(3)
    return state[f"{name}.angular_velocity"], state[f"{name}.velocity"], state[f"{name}.position"]
