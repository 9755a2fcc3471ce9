"""Starts of joints that vary: what a joint carries begins where its coordinates say, and as fast as they say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from symphys.model.joints.start import drive, move, spanning_tree
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.reposition import around
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults, Place
from symphys.types import Expr

State = Mapping[str, Expr]


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


def check_starts(parametric: ParametricWorld, varied: Iterable[tuple[Place, str]], faults: Faults) -> None:
    """Check that a joint with a varied start closes no loop and is rigid, so that what it carries is determined.

    ``varied`` are the names of what varies, and where the file says so.
    """
    joints = {f"{joint.name}.{key}": joint for joint in parametric.joints for key in ("start", "start_rate")}
    for place, name in varied:
        joint = joints.get(name)
        if joint is not None and (joint.frequency or joint.second in around(joint, parametric.joints)):
            reason = "gives way" if joint.frequency else "is part of a loop"
            text = f"{name} cannot vary: the joint {reason}, so that what it carries is not determined"
            faults.add(place, text)
