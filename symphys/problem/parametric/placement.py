"""The placement of bodies at the start: joints with a ``start``, and anchors, centres of mass and starts that vary.

A subtree moves with its joint's anchor, and a robot goes on standing on the ground. A body whose centre of mass varies
stays where it is: what a state has as its position is another point of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.observation import gap_function
from symphys.maths import rotation
from symphys.model.joints.frames import WORLD
from symphys.model.joints.start import Tree, drive, move, moved_to_start, spanning_tree, subtree, unmoved
from symphys.model.state_layout import initial_state
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.parts import CENTRE
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults, Place
from symphys.types import Array, Expr

State = Mapping[str, Expr]
PLACING = ("anchor", CENTRE)


def forward_kinematics(
    joints: Sequence[ParametricJoint], initial: Mapping[str, Array], faults: Faults
) -> dict[str, Array]:
    """The state at the start with every joint at its ``start``; see ``Problem.initial`` and ``moved_to_start``.

    Args:
        joints: all joints; their frames are where the bodies lie in the file.
        initial: the state as the file has it.
        faults: collects starts of a joint that is compliant, or closes a loop of joints with a start.
    """
    if not any(joint.start for joint in joints):
        return {name: value.copy() for name, value in initial.items()}
    tree = spanning_tree(joints)
    for index, joint in enumerate(joints):
        reason = unmoved(joint, tree) if joint.start else ""
        if reason:
            key = "start" if faults.data["joint"][index].get("start") is not None else "start_deg"
            text = f"this joint {reason}, so it begins where the other joints put it; leave this out"
            faults.add(("joint", index, key), text)
    return moved_to_start(joints, initial)


def carried(parametric: ParametricWorld, moved: Collection[str], before: State, after: State) -> dict[str, Expr]:
    """The state where rigid joints carry all bodies along that they connect to the ``moved`` ones.

    Coordinates of joints and their rates are those of the state ``before``. No body that has moved is carried.
    """
    tree, found = spanning_tree(parametric.joints), dict(after)
    seen, queue = {WORLD, *moved}, list(moved)
    while queue:
        base = queue.pop(0)
        for other in tree[base].values():
            if other not in seen:
                seen.add(other)
                queue.append(other)
                found |= follow(other, base, before, found)
    return found


def follow(body: str, base: str, before: State, after: State) -> dict[str, Expr]:
    """The state of a body that moves as one with its base, by the names of states; rates against it stay."""
    stood = before[f"{base}.orientation"]
    turn = rotation.multiply(after[f"{base}.orientation"], ca.vertcat(stood[0], -stood[1:4]))
    arm, spin = before[f"{body}.position"] - before[f"{base}.position"], after[f"{base}.angular_velocity"]
    orientation = rotation.multiply(turn, before[f"{body}.orientation"])
    slide = before[f"{body}.velocity"] - before[f"{base}.velocity"]
    slide = slide - ca.cross(before[f"{base}.angular_velocity"], arm)
    own = before[f"{body}.angular_velocity"] - before[f"{base}.angular_velocity"]
    away = rotation.rotate(turn, arm)
    return {
        f"{body}.position": after[f"{base}.position"] + away,
        f"{body}.orientation": orientation / ca.norm_2(orientation),
        f"{body}.velocity": after[f"{base}.velocity"] + ca.cross(spin, away) + rotation.rotate(turn, slide),
        f"{body}.angular_velocity": spin + rotation.rotate(turn, own),
    }


def placing(names: Iterable[str]) -> list[str]:
    """The parameters among these that decide where bodies start."""
    return [name for name in names if name.rpartition(".")[2] in PLACING]


def anchored(parametric: ParametricWorld, names: Iterable[str]) -> tuple[ParametricJoint, ...]:
    """The joints whose anchors are among these parameters."""
    found = set(names)
    return tuple(joint for joint in parametric.joints if joint.anchor in found)


def reposition(parametric: ParametricWorld, places: Mapping[str, Expr], state: State) -> dict[str, Expr]:
    """The state at the start with these anchors and centres of mass, by the names of parameters, (3,) [m].

    A joint shifts its second body in the table, and its subtree, as one; if the world holds that side, it
    shifts the other one, the other way. Then a robot that nothing holds is lifted until its lowest point is as high
    above what stands still as before. Velocities are those of one rigid body with what stays. ``state`` has the origins
    of the frames in which the file has bodies; the result has their centres of mass.
    """
    joints, found = anchored(parametric, places), dict(state)
    if joints:
        tree = spanning_tree(parametric.joints)
        for joint in joints:
            shift(joint, places[joint.anchor], tree, found)
        for robot in robots(joints, tree):
            lift(parametric, robot, state, found)
    for body in parametric.bodies:
        if f"{body.name}.{CENTRE}" in places:
            arm = rotation.rotate(found[f"{body.name}.orientation"], places[f"{body.name}.{CENTRE}"])
            found[f"{body.name}.position"] = found[f"{body.name}.position"] + arm
            swing = ca.cross(found[f"{body.name}.angular_velocity"], arm)
            found[f"{body.name}.velocity"] = found[f"{body.name}.velocity"] + swing
    return found


def shift(joint: ParametricJoint, anchor: Expr, tree: Tree, state: dict[str, Expr]) -> None:
    """Shift one side, in place."""
    base = joint.second or WORLD
    moved, stays, sign = subtree(joint.first, joint, tree), base, 1.0
    if WORLD in moved:
        moved, stays, sign = subtree(base, joint, tree), joint.first, -1.0
    by = sign * (anchor - ca.DM(joint.frames[1].point))
    if base != WORLD:
        by = ca.mtimes(rotation.matrix(state[f"{base}.orientation"]), by)
    for body in moved:
        state[f"{body}.position"] = state[f"{body}.position"] + by
        if stays != WORLD:
            state[f"{body}.velocity"] = state[f"{body}.velocity"] + ca.cross(state[f"{stays}.angular_velocity"], by)


def robots(joints: Sequence[ParametricJoint], tree: Tree) -> list[list[str]]:
    """The bodies of each robot that one of the joints is a part of and the world does not hold."""
    found: list[list[str]] = []
    for joint in joints:
        whole = list(dict.fromkeys([*subtree(joint.first, joint, tree), *subtree(joint.second or WORLD, joint, tree)]))
        if WORLD not in whole and not any(joint.first in other for other in found):
            found.append(whole)
    return found


def lift(parametric: ParametricWorld, robot: Sequence[str], before: State, state: dict[str, Expr]) -> None:
    """Move a robot against gravity until its lowest point is as high as before, in place."""
    world = parametric.world({})
    own = {index for index, body in enumerate(world.bodies) if body.name in robot}
    pairs = [k for k, pair in enumerate(world.pairs) if pair.second.body is None and pair.first.body in own]
    size = float(np.linalg.norm(parametric.gravity))
    if not pairs or not size:
        return
    gaps = gap_function(world)
    lowest = [reduce(ca.fmin, [gaps(initial_state(world, each))[k] for k in pairs]) for each in (before, state)]
    for body in robot:
        up = ca.DM(parametric.gravity) / -size
        state[f"{body}.position"] = state[f"{body}.position"] + (lowest[0] - lowest[1]) * up


def around(cut: ParametricJoint, joints: Sequence[ParametricJoint]) -> set[str | None]:
    """The bodies that joints connect to the first body of a joint without that joint; None: the world."""
    found: set[str | None] = {cut.first}
    while True:
        ends = [{joint.first, joint.second} for joint in joints if joint.name != cut.name]
        more = {name for pair in ends if pair & found for name in pair} - found
        if not more:
            return found
        found |= more


def begin(parametric: ParametricWorld, starts: Mapping[str, Expr], state: State) -> dict[str, Expr]:
    """The state at the start where joints have these starts, by the names of ``ParametricWorld.starts``.

    It is what a file gives that states them as ``start``: from the first joint that varies on all are taken back to 0,
    the last one first, and moved anew. Then the rates are added to what is carried.

    Args:
        parametric: the world.
        starts: of some joints, (coordinates,) each.
        state: with every joint at the start that the file states.
    """
    joints, tree, found = parametric.joints, spanning_tree(parametric.joints), dict(state)
    places = [k for k, joint in enumerate(joints) if f"{joint.name}.start" in starts]
    later = [joint for joint in joints[min(places, default=len(joints)) :] if moves(joint, starts)]
    for joint in reversed(later):
        if joint.start:
            move(joint, joint.start, tree, found, back=True)
    for joint in later:
        move(joint, components(starts.get(f"{joint.name}.start", joint.start)), tree, found)
    for joint in joints:
        if f"{joint.name}.start_rate" in starts:
            drive(joint, components(starts[f"{joint.name}.start_rate"]), tree, found)
    return found


def moves(joint: ParametricJoint, starts: Mapping[str, Expr]) -> bool:
    """Whether a joint has a start of its own."""
    return bool(joint.start) or f"{joint.name}.start" in starts


def components(value: Any) -> list[Expr]:
    """The numbers of a tuple or of a casadi column."""
    return list(value) if isinstance(value, tuple) else [value[k] for k in range(value.shape[0])]


def check_carried(
    parametric: ParametricWorld,
    varied: Iterable[tuple[Place, str]],
    faults: Faults,
    keys: Sequence[str] = ("start", "start_rate"),
) -> None:
    """Check that joints of which these keys vary close no loop and are rigid, so that what they carry is determined.

    ``varied`` are the names of what varies, and where the file says so.
    """
    joints = {f"{joint.name}.{key}": joint for joint in parametric.joints for key in keys}
    for place, name in varied:
        joint = joints.get(name)
        if joint is not None and (joint.frequency or joint.second in around(joint, parametric.joints)):
            reason = "gives way" if joint.frequency else "is part of a loop"
            text = f"{name} cannot vary: the joint {reason}, so that what it carries is not determined"
            faults.add(place, text)
