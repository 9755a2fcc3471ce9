"""What joints connect to bodies that start elsewhere: it is carried along, as one rigid body with what carries it."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import casadi as ca

from symphys.maths import rotation
from symphys.model.joints.frames import WORLD
from symphys.model.joints.start import spanning_tree
from symphys.problem.parametric.world import ParametricWorld
from symphys.types import Expr

State = Mapping[str, Expr]


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
