"""Repositioning for anchors and centres of mass that vary.

A subtree moves with its joint's anchor, and a robot goes on standing on the ground. A body whose centre of mass varies
stays where it is: what a state has as its position is another point of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce

import casadi as ca
import numpy as np

from symphys.dynamics.observation import gap_function
from symphys.maths import rotation
from symphys.model.joints.frames import WORLD
from symphys.model.joints.start import Tree, spanning_tree, subtree
from symphys.model.state_layout import initial_state
from symphys.problem.model import Variable
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.parts import CENTRE
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults
from symphys.types import Expr

State = Mapping[str, Expr]


PLACING = ("anchor", CENTRE)


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


def check_anchors(parametric: ParametricWorld, variables: Sequence[Variable], faults: Faults) -> None:
    """The subtree that a varied anchor moves must be determined: its joint closes no loop and does not give way."""
    for index, variable in enumerate(variables):
        for joint in anchored(parametric, (slot.name for slot in variable.slots)):
            if joint.frequency or joint.second in around(joint, parametric.joints):
                reason = "gives way" if joint.frequency else "is part of a loop"
                text = f"{joint.anchor} cannot vary: the joint {reason}, so that what it carries is not determined"
                faults.add(("variable", index, "sets"), text)


def around(cut: ParametricJoint, joints: Sequence[ParametricJoint]) -> set[str | None]:
    """The bodies that joints connect to the first body of a joint without that joint; None: the world."""
    found: set[str | None] = {cut.first}
    while True:
        ends = [{joint.first, joint.second} for joint in joints if joint.name != cut.name]
        more = {name for pair in ends if pair & found for name in pair} - found
        if not more:
            return found
        found |= more
