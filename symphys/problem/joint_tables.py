"""The joints of a world that was built in Python as [[joint]] tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symphys.errors import SymphysError
from symphys.model.jointed import REST
from symphys.model.joints import JOINTS, Joint, Motor
from symphys.model.joints.frames import MEET
from symphys.model.joints.motor import motor_kind
from symphys.model.joints.placing import PlacedJoint
from symphys.model.joints.start import State, moved_to_zero, placed_frames, spanning_tree, unmoved
from symphys.model.scalar import is_zero
from symphys.model.world import World
from symphys.problem.plain import floats, numbers
from symphys.types import Array

ZERO = 1e-9
"""Coordinates below this are 0 [rad] or [m]."""


def joint_tables(world: World, start: Mapping[str, Any]) -> tuple[list[dict[str, Any]], Mapping[str, Any]]:
    """The [[joint]] tables, and the start as a file has it: with bodies where coordinates are 0.

    A joint with another coordinate has it as ``start``; the file's reader carries the bodies back.

    Args:
        world: of numbers.
        start: where bodies are and how they move, by name.

    Raises:
        SymphysError: names a joint that does not hold together at the start, or that a file cannot place.
    """
    if not world.joints:
        return [], start
    state = whole_state(world, start)
    placed = [placed_joint(world, joint, state) for joint in world.joints]
    tree = spanning_tree(placed)
    for named in placed:
        reason = unmoved(named, tree) if named.start else ""
        if reason:
            raise SymphysError(
                f"joint {named.name!r}: its coordinates are not 0 at the start, and it {reason}; a problem file has "
                "such joints at 0 only: place its bodies so, or give it frames that coincide there"
            )
    bent = any(joint.start for joint in placed)
    zero = moved_to_zero(placed, state) if bent else state
    tables = []
    for joint, named in zip(world.joints, placed, strict=True):
        tables.append(joint_table(world, joint, named, axes_at_zero(named, zero, bent)))
    if not bent:
        return tables, start
    moved = {name: value.tolist() for name, value in zero.items() if name in start or not at_rest(name, value)}
    return tables, moved


def at_rest(name: str, value: Array) -> bool:
    """Whether a state is what a file has unless it says otherwise."""
    return tuple(value.tolist()) == REST[name.rpartition(".")[2]]


def whole_state(world: World, start: Mapping[str, Any]) -> State:
    """Position, orientation and velocities of every body, by name."""
    found = {
        f"{body.name}.{key}": np.array(floats(start.get(f"{body.name}.{key}", value)), float)
        for body in world.bodies
        for key, value in REST.items()
    }
    for name, value in found.items():
        if name.endswith(".orientation"):
            found[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    return found


def placed_joint(world: World, joint: Joint, state: State) -> PlacedJoint:
    """A joint by the names of its bodies, with the coordinates that it has in a state as its start."""
    second = None if joint.second is None else world.bodies[joint.second].name
    still = PlacedJoint(joint.name, joint.kind, world.bodies[joint.first].name, second, joint.frames)
    placed, _ = placed_frames(still, state)
    count = len(joint.kind.coordinates)
    values = tuple(float(joint.value(k, placed, joint.start or (0.0,) * count)) for k in range(count))
    bent = any(abs(value) > ZERO for value in values)
    return PlacedJoint(
        still.name, still.kind, still.first, second, joint.frames, floats(joint.frequency), values if bent else ()
    )


def axes_at_zero(joint: PlacedJoint, zero: State, bent: bool) -> Array:
    """(3, 3): the axes of both frames as columns, world frame; SymphysError unless the frames coincide."""
    placed, _ = placed_frames(joint, zero)
    apart = float(np.linalg.norm(placed.apart))
    tilt = 0.0 if not joint.kind.turns else float(np.linalg.norm(placed.a - placed.b)) / np.sqrt(2)
    if not max(apart, tilt) <= MEET:
        cause = "; where joints close a loop, a problem file needs all of their coordinates 0 at the start" * bent
        raise SymphysError(
            f"joint {joint.name!r}: its two sides are {apart:.4g} m and {tilt:.4g} rad from where it holds them at the "
            f"start; place its bodies so{cause}"
        )
    return np.asarray(placed.b)


def joint_table(world: World, joint: Joint, named: PlacedJoint, axes: Array) -> dict[str, Any]:
    """A joint, by its anchors and by its axes (3, 3) where its coordinates are 0."""
    table: dict[str, Any] = {
        "name": joint.name,
        "between": [named.second or "world", named.first],
        joint.kind.name: JOINTS[joint.kind.name].table(joint.kind, axes),
        "anchors": [floats(joint.frames[1].point), floats(joint.frames[0].point)],
        "collide": any({pair.first.body, pair.second.body} == set(joint.bodies) for pair in world.pairs),
        "frequency": named.frequency,
    }
    if table["frequency"]:
        table["damping"] = floats(joint.damping)
    if named.start:
        table["start"] = list(named.start)
    if joint.motor is not None:
        table["motor"] = motor_table(joint.motor)
    if joint.spring is not None:
        table["spring"] = numbers(joint.spring)
    table |= {key: floats(value) for key in ("armature", "friction") if not is_zero(value := getattr(joint, key))}
    limits = (joint.limits.lower, joint.limits.upper)
    if limits != (None, None):
        table["limits"] = ends(limits)
    return table


def ends(limits: Sequence[Any]) -> list[float]:
    """[lower, upper]; infinite where there is none."""
    return [sign * np.inf if end is None else floats(end) for sign, end in zip((-1, 1), limits, strict=True)]


def motor_table(motor: Motor) -> dict[str, Any]:
    """A motor by its kind."""
    return {motor_kind(motor): numbers(motor)}
