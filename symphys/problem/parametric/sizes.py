"""The sizes of a shape under the names that problem files give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import hypot
from typing import Any

from symphys.model.shapes import Box, Capsule, Shape, Sphere

FLATTEST = 1e-6
"""Least ratio of a shape's smallest size to its largest."""


def sizes(shape: Shape) -> dict[str, Any]:
    """By name [m]: ``radius``; ``size``, the full edges (3,); ``radius`` and ``length`` of the straight part."""
    if isinstance(shape, Sphere):
        return {"radius": shape.radius}
    if isinstance(shape, Box):
        return {"size": tuple(2 * half for half in shape.half_sizes)}
    return {"radius": shape.radius, "length": 2 * shape.half_length}


def extent(shape: Shape) -> float:
    """From a shape's centre to its farthest point [m]."""
    if isinstance(shape, Box):
        return hypot(*shape.half_sizes)
    return float(shape.radius + (shape.half_length if isinstance(shape, Capsule) else 0.0))


def resized(shape: Shape, new: Mapping[str, Any]) -> Shape:
    """The shape with other sizes; numbers or symbols."""
    if isinstance(shape, Sphere):
        return replace(shape, radius=new["radius"])
    if isinstance(shape, Box):
        return replace(shape, half_sizes=tuple(edge / 2 for edge in new["size"]))
    return replace(shape, radius=new["radius"], half_length=new["length"] / 2)


def flatness(shape: Shape) -> str:
    """Why a shape is too flat or thin to be told from a surface or a line without volume; empty if it is not."""
    if isinstance(shape, Box):
        least, most = 2 * min(shape.half_sizes), 2 * max(shape.half_sizes)
        if least >= FLATTEST * most:
            return ""
        return (
            f"the smallest edge, {least:g} m, is less than {FLATTEST:g} of the largest, {most:g} m: that is no solid; "
            f"make it {FLATTEST * most:g} m or more, or use a [[plane]] for a wall"
        )
    if isinstance(shape, Capsule):
        least, most = sorted((2 * shape.radius, 2 * shape.half_length))
        if least >= FLATTEST * most:
            return ""
        thin = shape.radius < shape.half_length
        remedy = f"make the radius {FLATTEST * most / 2:g} m or more" if thin else "use a sphere"
        return f"radius {shape.radius:g} m and length {2 * shape.half_length:g} m are of sizes too different; {remedy}"
    return ""
