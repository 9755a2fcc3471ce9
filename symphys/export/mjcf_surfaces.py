"""Surfaces as MJCF geoms, and who may touch whom as explicit pairs of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element

from symphys.model.scalar import is_zero
from symphys.model.shapes import Plane, Shape, Terrain, surface
from symphys.model.world import Law, Side, World, side_name

MJCF_PLACEMENT = {"centre": "pos", "orientation": "quat"}


def text(numbers: Iterable[Any]) -> str:
    """Numbers of an attribute, so that they are read as they are."""
    return " ".join(repr(float(x)) for x in numbers)


def geoms(world: World, body: int | None) -> list[Element]:
    """The surfaces of a body, placed in its frame; of what stands still for None. They touch as ``pairs`` says only."""
    count = len(world.statics if body is None else world.bodies[body].shapes)
    return [geom(world, Side(body, k)) for k in range(count)]


def geom(world: World, side: Side) -> Element:
    """One surface."""
    shape = surface(world.statics[side.shape]) if side.body is None else world.bodies[side.body].shapes[side.shape]
    assert not isinstance(shape, Terrain)
    name = side_name(world.bodies, world.statics, side)
    placed = half_space(shape) if isinstance(shape, Plane) else solid(shape)
    return Element("geom", {"name": name, **placed, "contype": "0", "conaffinity": "0"})


def half_space(plane: Plane) -> dict[str, str]:
    """Without an edge; the last size is of the grid that is drawn."""
    point = [plane.offset * n for n in plane.normal]
    return {"type": "plane", "size": "0 0 1", "pos": text(point), "zaxis": text(plane.normal)}


def solid(shape: Shape) -> dict[str, str]:
    """Kind, sizes and place."""
    placed = {MJCF_PLACEMENT[key]: text(numbers) for key, numbers in shape.placement.items()}
    return {"type": shape.kind, "size": text(shape.mjcf_size), **placed}


def pairs(world: World) -> Element:
    """Every two surfaces that may touch, with friction, torsion and rolling of their law."""
    contact = Element("contact")
    laws = {(pair.first, pair.second): pair.law for pair in world.pairs}
    for sides, law in laws.items():
        first, second = (side_name(world.bodies, world.statics, side) for side in sides)
        friction = (law.friction, law.friction, law.torsion, law.rolling, law.rolling)
        contact.append(Element("pair", geom1=first, geom2=second, condim=directions(law), friction=text(friction)))
    return contact


def directions(law: Law) -> str:
    """In how many directions a contact acts: the normal, two across, about the normal, two rolling."""
    if not is_zero(law.rolling):
        return "6"
    if not is_zero(law.torsion):
        return "4"
    return "1" if is_zero(law.friction) else "3"
