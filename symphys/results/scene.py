"""What a picture of a motion needs to know of its world: the fields of scene.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symphys.model.shapes import Fixture, Plane, Shape, Static, Terrain
from symphys.model.world import Body
from symphys.problem import Problem
from symphys.results.scene_joints import joint_entry
from symphys.results.terrain_crop import Window, sample, window
from symphys.shooting import Array
from symphys.trajectory import Trajectory


def scene(problem: Problem, z: Mapping[str, Array], motion: Trajectory | None = None) -> dict[str, Any]:
    """Gravity, bodies, what stands still, and joints, in SI units, with the parameters that ``z`` (by variable) sets.

    Terrain is sampled where ``motion`` goes; without one, around the bodies at the start.
    """
    world = problem.world(parameters(problem, z))
    if motion is None:
        places = np.array([problem.initial[f"{body.name}.position"] for body in world.bodies])
    else:
        places = motion.position.reshape(-1, 3)
    near = window(world, places)
    return {
        "gravity": plain(world.gravity),
        "bodies": [body_entry(body) for body in world.bodies],
        "planes": statics(world.statics, Plane, near),
        "fixtures": statics(world.statics, Fixture, near),
        "terrain": statics(world.statics, Terrain, near),
        "joints": [joint_entry(joint, [body.name for body in world.bodies]) for joint in world.joints],
    }


def body_entry(body: Body) -> dict[str, Any]:
    """A body as JSON: mass [kg] and shapes."""
    return {"name": body.name, "mass": float(body.mass), "shapes": [solid(shape) for shape in body.shapes]}


def statics(found: tuple[Static, ...], kind: type[Static], near: Window) -> list[dict[str, Any]]:
    """Those of one kind as JSON."""
    return [static_entry(static, near) for static in found if isinstance(static, kind)]


def static_entry(static: Static, near: Window) -> dict[str, Any]:
    """A static surface as JSON."""
    if isinstance(static, Plane):
        return {"name": static.name, "normal": plain(static.normal), "offset": float(static.offset)}
    if isinstance(static, Fixture):
        return {"name": static.name, "shape": solid(static.shape)}
    return {"name": static.name, **sample(static, near)}


def parameters(problem: Problem, z: Mapping[str, Array]) -> dict[str, Any]:
    """The values of the physical parameters that variables set; ``z`` holds (components, knots) arrays."""
    values: dict[str, Any] = {}
    for variable in problem.variables:
        if variable.kind != "parameter":
            continue
        for slot in variable.slots:
            whole = values.get(slot.name, np.array(problem.parameters[slot.name], float))
            whole[list(slot.components)] = z[variable.name].ravel()
            values[slot.name] = whole
    return {name: float(whole[0]) if whole.size == 1 else tuple(whole.tolist()) for name, whole in values.items()}


def solid(shape: Shape) -> dict[str, Any]:
    """A shape as JSON: sizes as in problem files, ``centre`` (3,), and ``orientation`` (4,) w x y z unless round."""
    sizes = {key: plain(size) if isinstance(size, tuple) else float(size) for key, size in shape.sizes.items()}
    return {"kind": shape.kind, **sizes, **{key: plain(numbers) for key, numbers in shape.placement.items()}}


def plain(vector: Any) -> list[float]:
    """A vector as JSON."""
    return [float(component) for component in vector]
