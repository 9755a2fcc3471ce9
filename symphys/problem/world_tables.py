"""A world that was built in Python as the tables of a problem file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.errors import SymphysError
from symphys.maths import rotation
from symphys.model.heightfield import Heightfield
from symphys.model.joints import Joint, JointFrame, Motor, Servo, VelocityMotor
from symphys.model.shapes import Fixture, Plane, Shape, Static, Terrain
from symphys.model.world import Body, Law, Side, World

Array = NDArray[np.float64]
Start = Mapping[str, Any]
"""States by name, such as ``ball.position``; what is missing is zero, and upright."""
GIVEN = ("position", "orientation", "velocity", "angular_velocity")


def world_tables(world: World, start: Start) -> dict[str, Any]:
    """The tables [world], [contact], [[pair]], [[body]], [[joint]] and those of what stands still.

    Args:
        world: of numbers, without symbols.
        start: where bodies are and how they move; joints have their coordinates 0 there.

    Raises:
        SymphysError: names what a problem file cannot say.
    """
    unknown = start.keys() - {f"{body.name}.{key}" for body in world.bodies for key in GIVEN}
    if unknown:
        raise SymphysError(f"start: there is no {', '.join(sorted(unknown))}; valid: <body>.{', <body>.'.join(GIVEN)}")
    law, pairs = contact_tables(world)
    tables = {
        "world": {"gravity": floats(world.gravity)},
        "contact": law,
        "pair": pairs,
        "body": [body_table(body, start) for body in world.bodies],
        "joint": [joint_table(world, joint, start) for joint in world.joints],
        **static_tables(world.statics),
    }
    return {key: table for key, table in tables.items() if table}


def body_table(body: Body, start: Start) -> dict[str, Any]:
    """A body and its start; its inertia is as it was given."""
    state = {key: floats(start[f"{body.name}.{key}"]) for key in GIVEN if f"{body.name}.{key}" in start}
    parts = [part_table(shape) for shape in body.shapes]
    shape: dict[str, Any] = {"shape": {"parts": parts}} if parts else {}
    if len(parts) == 1 and body.shapes[0].central:
        shape = {"shape": size_table(body.shapes[0])}
    return {"name": body.name, "mass": floats(body.mass), "inertia": floats(body.inertia), **shape, **state}


def size_table(shape: Shape) -> dict[str, Any]:
    """A shape by its sizes: ``{"box": {"size": [...]}}``."""
    return {shape.kind: {key: floats(value) for key, value in shape.sizes.items()}}


def part_table(shape: Shape) -> dict[str, Any]:
    """A shape in its place."""
    return {**size_table(shape), "centre": floats(shape.centre), "orientation": floats(shape.orientation)}


def static_tables(statics: Sequence[Static]) -> dict[str, Any]:
    """What stands still, by the kind of its table."""
    found: dict[str, Any] = {"plane": [], "block": [], "terrain": []}
    for static in statics:
        if isinstance(static, Plane) and static.name == "ground" and floats(static.normal) == [0, 0, 1]:
            found["ground"] = {"height": floats(static.offset)}
        elif isinstance(static, Plane):
            found["plane"].append(
                {"name": static.name, "normal": floats(static.normal), "offset": floats(static.offset)}
            )
        elif isinstance(static, Fixture):
            place = {"position": floats(static.shape.centre), "orientation": floats(static.shape.orientation)}
            found["block"].append({"name": static.name, "shape": size_table(static.shape), **place})
        else:
            found["terrain"].append(terrain_table(static))
    return found


def terrain_table(terrain: Terrain) -> dict[str, Any]:
    """A terrain of heights on a grid; SymphysError for one that a Python function gives."""
    height = terrain.height
    if not isinstance(height, Heightfield):
        text = "its height is a Python function; build it from a Heightfield, or give the problem a formula"
        raise SymphysError(f"terrain {terrain.name!r}: {text}")
    grid = {"heights": [list(row) for row in height.heights], "spacing": list(height.spacing)}
    return {"name": terrain.name, **grid, "origin": list(height.origin)}


def contact_tables(world: World) -> tuple[dict[str, float], list[dict[str, Any]]]:
    """The law of most pairs, and a [[pair]] table for each two surfaces with another law, or with none."""
    laws: dict[tuple[str, str], set[Law]] = {}
    for pair in world.pairs:
        laws.setdefault((side_name(world, pair.first), side_name(world, pair.second)), set()).add(pair.law)
    for (one, other), several in laws.items():
        if len(several) > 1:
            raise SymphysError(f"{one} and {other} have {len(several)} laws; a problem file has one for both")
    stated = {names: next(iter(several)) for names, several in laws.items()}
    most = Counter(stated.values()).most_common(1)[0][0] if stated else Law()
    tables = []
    for names in meetings(world):
        law = stated.get(names)
        if law is None:
            tables.append({"between": list(names), "collide": False})
        elif law != most:
            tables.append({"between": list(names), **law_table(law)})
    return law_table(most), tables


def law_table(law: Law) -> dict[str, float]:
    """The keys of a law; rigid contacts have no frequency and damping."""
    found = numbers(law)
    return found if law.soft else {key: found[key] for key in found if key not in ("frequency", "damping")}


def meetings(world: World) -> Iterator[tuple[str, str]]:
    """Every two surfaces that could touch, by name; joints keep the bodies that they connect apart by themselves."""
    joined = {frozenset(joint.bodies) for joint in world.joints}
    for i, body in enumerate(world.bodies):
        if body.shapes:
            yield from ((body.name, static.name) for static in world.statics)
            later = [(j, world.bodies[j]) for j in range(i + 1, len(world.bodies))]
            yield from ((body.name, other.name) for j, other in later if other.shapes and {i, j} not in joined)


def side_name(world: World, side: Side) -> str:
    """The body, or what stands still, on a side of a pair."""
    return world.statics[side.shape].name if side.body is None else world.bodies[side.body].name


def joint_table(world: World, joint: Joint, start: Start) -> dict[str, Any]:
    """A joint, by its anchors and by its axes as they lie at the start."""
    second = "world" if joint.second is None else world.bodies[joint.second].name
    x, y, _ = axes_at_start(joint.frames[1], second, start).T
    y_first = axes_at_start(joint.frames[0], world.bodies[joint.first].name, start).T[1]
    if joint.kind.coordinates and not np.allclose(y, y_first, atol=1e-9) and joint.kind.name != "ball":
        raise SymphysError(f"joint {joint.name!r}: its coordinates are not 0 at the start; place its bodies so")
    kinds: dict[str, dict[str, Any]] = {
        "hinge": {"axis": x.tolist()},
        "slider": {"axis": x.tolist()},
        "universal": {"axes": [y.tolist(), x.tolist()]},
    }
    table: dict[str, Any] = {
        "name": joint.name,
        "between": [second, world.bodies[joint.first].name],
        joint.kind.name: kinds.get(joint.kind.name, {}),
        "anchors": [floats(joint.frames[1].point), floats(joint.frames[0].point)],
        "collide": any({pair.first.body, pair.second.body} == set(joint.bodies) for pair in world.pairs),
        "frequency": floats(joint.frequency),
    }
    if table["frequency"]:
        table["damping"] = floats(joint.damping)
    if joint.motor is not None:
        table["motor"] = motor_table(joint.motor)
    if joint.spring is not None:
        table["spring"] = numbers(joint.spring)
    limits = (joint.limits.lower, joint.limits.upper)
    if limits != (None, None):
        table["limits"] = [
            sign * np.inf if end is None else floats(end) for sign, end in zip((-1, 1), limits, strict=True)
        ]
    return table


def motor_table(motor: Motor) -> dict[str, Any]:
    """A motor by its kind."""
    kind = "servo" if isinstance(motor, Servo) else "velocity" if isinstance(motor, VelocityMotor) else "torque"
    return {kind: numbers(motor)}


def axes_at_start(frame: JointFrame, name: str, start: Start) -> Array:
    """(3, 3): the axes of a joint's frame on a body, or on the world, as columns, world coordinates."""
    own = np.array(rotation.matrix(np.array(frame.orientation, float)))
    orientation = start.get(f"{name}.orientation", (1.0, 0.0, 0.0, 0.0))
    return np.asarray(np.array(rotation.matrix(np.array(orientation, float))) @ own)


def numbers(thing: Any) -> dict[str, float]:
    """The fields of a law, a motor or a spring that are not None."""
    return {key: floats(value) for key, value in vars(thing).items() if value is not None}


def floats(value: Any) -> Any:
    """Plain numbers, in lists as deep as they were given; SymphysError for symbols."""
    if isinstance(value, list | tuple):
        return [floats(each) for each in value]
    if isinstance(value, ca.SX | ca.MX) and not value.is_constant():
        raise SymphysError(f"{value} is no number: give one, and let a variable of the problem set it")
    return np.asarray(value, float).tolist()
