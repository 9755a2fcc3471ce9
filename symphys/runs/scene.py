"""What a picture of a motion needs to know of its world: the fields of scene.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symphys.problem import Problem
from symphys.shapes import Plane, Sphere
from symphys.shooting import Array


def scene(problem: Problem, z: Mapping[str, Array]) -> dict[str, Any]:
    """Shapes of the bodies and planes, lengths [m], with the parameters that ``z`` (by variable) sets."""
    world = problem.world(parameters(problem, z))
    return {
        "bodies": [
            {"name": body.name, "shapes": [sphere(s.radius, s.centre) for s in body.shapes if isinstance(s, Sphere)]}
            for body in world.bodies
        ],
        "planes": [
            {"name": plane.name, "normal": plain(plane.normal), "offset": float(plane.offset)}
            for plane in world.statics
            if isinstance(plane, Plane)
        ],
    }


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


def sphere(radius: Any, centre: Any) -> dict[str, Any]:
    """A shape as JSON."""
    return {"kind": "sphere", "radius": float(radius), "centre": plain(centre)}


def plain(vector: Any) -> list[float]:
    """A vector as JSON."""
    return [float(component) for component in vector]
