"""In what two worlds differ: bodies, surfaces, joints, contacts and all else by name, whatever the order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.maths import rotation
from symphys.model.heightfield import Heightfield
from symphys.model.joints import Joint
from symphys.model.shapes import Plane, Shape, Terrain, surface
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import World, side_name
from symphys.types import Array

TOLERANCE = 1e-9
"""Of numbers, absolute or by the larger one."""


def differences(
    one: tuple[World, Mapping[str, Any]], other: tuple[World, Mapping[str, Any]], tolerance: float = TOLERANCE
) -> list[str]:
    """In what two worlds with their starts differ, a line each; empty if they are the same model.

    Frames of joints that differ only about a direction that does not matter are the same, and so are quaternions of
    both signs.
    """
    return list(compared("", described(*one), described(*other), tolerance))


def described(world: World, initial: Mapping[str, Any]) -> dict[str, Any]:
    """All of a world by name, as numbers that are the same for equal worlds."""
    layout, x = Layout(world), ca.DM(initial_state(world, initial))
    fields = ("position", "orientation", "velocity", "angular_velocity")
    bodies = {}
    for body in world.bodies:
        state = {key: np.array(x[layout[f"{body.name}.{key}"]]).ravel() for key in fields}
        state["orientation"] = axes(state["orientation"])
        tensor = np.array(ca.DM(inertia_matrix(body.inertia)))
        shapes = {f"{shape.kind} {k}": solid(shape) for k, shape in enumerate(body.shapes)}
        bodies[body.name] = {"mass": body.mass, "inertia": tensor, "shapes": shapes, **state}
    pairs: dict[str, Any] = {}
    for pair in world.pairs:
        names = sorted(side_name(world.bodies, world.statics, side) for side in (pair.first, pair.second))
        found = pairs.setdefault(" and ".join(names), {"points": 0, **asdict(pair.law)})
        found["points"] += 1
    return {
        "gravity": np.array(world.gravity, float),
        "body": bodies,
        "static": {static.name: still(surface(static)) for static in world.statics},
        "joint": {joint.name: held(world, joint) for joint in world.joints},
        "contact": pairs,
        "coupling": {
            each.name: {
                "joints": [world.joints[k].name for k in (each.first, each.second) if k is not None],
                "polynomial": np.array(each.polynomial, float),
            }
            for each in world.couplings
        },
        "site": {
            site.name: {
                "body": None if site.body is None else world.bodies[site.body].name,
                "position": np.array(site.position, float),
                "axes": axes(site.orientation),
            }
            for site in world.sites
        },
    }


def axes(quaternion: Any) -> Array:
    """(3, 3)."""
    return np.array(rotation.matrix(np.array(quaternion, float)), float)


def solid(shape: Shape) -> dict[str, Any]:
    """Sizes and place."""
    sizes = {key: np.array(value, float) for key, value in shape.sizes.items()}
    turn = {"axes": axes(shape.orientation)} if shape.turns else {}
    return {**sizes, "centre": np.array(shape.centre, float), **turn}


def still(static: Any) -> dict[str, Any]:
    """What stands still."""
    if isinstance(static, Plane):
        return {"normal": np.array(static.normal, float), "offset": static.offset}
    if isinstance(static, Terrain):
        height = static.height
        assert isinstance(height, Heightfield)
        grid = {"spacing": np.array(height.spacing), "origin": np.array(height.origin)}
        return {"heights": np.array(height.heights), **grid}
    return solid(static)


def held(world: World, joint: Joint) -> dict[str, Any]:
    """A joint; of its frames the points, the axes that count, and how the bodies lie against each other at 0."""
    one, two = (axes(frame.orientation) for frame in joint.frames)
    directions = {"hinge": [0], "slider": [0], "universal": [0, 1]}.get(joint.kind.name, [])
    return {
        "kind": joint.kind.name,
        "first": world.bodies[joint.first].name,
        "second": None if joint.second is None else world.bodies[joint.second].name,
        "points": np.array([frame.point for frame in joint.frames], float),
        "axes": np.array([frame[:, directions] for frame in (one, two)]),
        "zero": two @ one.T if joint.kind.name != "ball" else np.eye(3),
        "limits": asdict(joint.limits),
        "spring": None if joint.spring is None else asdict(joint.spring),
        "motor": None if joint.motor is None else {"is": type(joint.motor).__name__, **asdict(joint.motor)},
        **{key: getattr(joint, key) for key in ("armature", "friction", "frequency", "damping")},
    }


def compared(place: str, one: Any, other: Any, tolerance: float) -> Iterator[str]:
    """The differences of two values, each with its place."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for key in {**one, **other}:
            inner = f"{place}.{key}".lstrip(".")
            if key not in one or key not in other:
                yield f"{inner}: only in the {'first' if key in one else 'second'}"
            else:
                yield from compared(inner, one[key], other[key], tolerance)
    elif one is None or other is None or isinstance(one, str | list) or isinstance(other, str | list):
        if one != other:
            yield f"{place}: {one} and {other}"
    else:
        first, second = np.array(one, float), np.array(other, float)
        if first.shape != second.shape:
            yield f"{place}: shapes {first.shape} and {second.shape}"
        elif not np.allclose(first, second, rtol=tolerance, atol=tolerance):
            yield f"{place}: {first.tolist()} and {second.tolist()}"
