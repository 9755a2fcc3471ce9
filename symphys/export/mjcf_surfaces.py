"""Surfaces as MJCF geoms, and who may touch whom as explicit pairs of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi
from typing import Any
from xml.etree.ElementTree import Element

from symphys.model.shapes import Capsule, Convex, Plane, Shape, Terrain, surface
from symphys.model.world import Law, Side, World, side_name

MJCF_PLACEMENT = {"centre": "pos", "orientation": "quat"}
APART = {"contype": "1", "conaffinity": "0"}
"""Of a geom that touches another in an explicit pair only: affinity with none. Readers see that it is no picture."""
IMPEDANCE = 0.01
"""Impedance of soft contacts: so small that they add to other forces as springs and dampers do, 1 % too soft."""
FRICTION_RATIO = 100.0
"""Impedance of friction over that of contacts, so that friction is not soft with them."""


def text(numbers: Iterable[Any]) -> str:
    """Numbers of an attribute, so that they are read as they are."""
    return " ".join(repr(float(x)) for x in numbers)


def geoms(world: World, body: int | None) -> list[Element]:
    """The surfaces of a body, placed in its frame; of what stands still for None. They touch as ``pairs`` says only.

    Terrain, which needs a grid, comes from ``mjcf_terrain``.
    """
    count = len(world.statics if body is None else world.bodies[body].shapes)
    made = (geom(world, Side(body, k)) for k in range(count))
    return [each for each in made if each is not None]


def geom(world: World, side: Side) -> Element | None:
    """One surface; None for terrain."""
    shape = surface(world.statics[side.shape]) if side.body is None else world.bodies[side.body].shapes[side.shape]
    if isinstance(shape, Terrain):
        return None
    name = side_name(world.bodies, world.statics, side)
    placed = half_space(shape) if isinstance(shape, Plane) else solid(shape, name)
    return Element("geom", {"name": name, **placed, **APART})


def half_space(plane: Plane) -> dict[str, str]:
    """Without an edge; the last size is of the grid that is drawn."""
    point = [plane.offset * n for n in plane.normal]
    return {"type": "plane", "size": "0 0 1", "pos": text(point), "zaxis": text(plane.normal)}


def solid(shape: Shape, name: str) -> dict[str, str]:
    """Kind, sizes and place; the hull of points is a mesh of the geom's name."""
    placed = {MJCF_PLACEMENT[key]: text(numbers) for key, numbers in shape.placement.items()}
    if isinstance(shape, Convex):
        return {"type": "mesh", "mesh": name, **placed}
    return {"type": shape.kind, "size": text(shape.mjcf_size), **placed}


def meshes(world: World) -> list[Element]:
    """The points of every hull, by the name of its geom: MuJoCo makes the hull of a mesh by itself."""
    sides = [Side(i, k) for i, body in enumerate(world.bodies) for k in range(len(body.shapes))]
    sides += [Side(None, k) for k in range(len(world.statics))]
    found = []
    for side in sides:
        shape = world.surface(side)
        if isinstance(shape, Convex):
            name, vertices = side_name(world.bodies, world.statics, side), [x for point in shape.points for x in point]
            found.append(Element("mesh", name=name, inertia="convex", vertex=text(vertices)))
    return found


def pairs(world: World, step: float, stiffer: Mapping[tuple[str, str], float]) -> Element:
    """Every two surfaces that may touch, with the numbers of their law; ``stiffer``: see ``mjcf_model``."""
    contact = Element("contact")
    laws = {(pair.first, pair.second): pair.law for pair in world.pairs}
    for sides, law in laws.items():
        first, second = (side_name(world.bodies, world.statics, side) for side in sides)
        friction = law.mujoco_friction(normal_of(world, sides))
        given = {"condim": str(friction.directions), "friction": text(friction.coefficients)}
        given = {"geom1": first, "geom2": second, **given}
        contact.append(Element("pair", given | softness(law, step, stiffer.get((first, second), 1.0))))
    return contact


def softness(law: Law, step: float, factor: float) -> dict[str, str]:
    """Attributes of a soft contact: stiffness and damping by mass, MuJoCo's direct form; friction acts within steps."""
    if not law.soft:
        return {}
    rate, stop = 2 * pi * float(law.frequency), IMPEDANCE / step
    spring = -factor * rate * rate, -factor * 2 * max(float(law.damping), 1e-9) * rate
    held = {"solimp": text((IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0)), "solreffriction": text((-stop, -stop))}
    return {"solref": text(spring), **held}


def normal_of(world: World, sides: tuple[Side, Side]) -> tuple[Any, ...] | None:
    """(3,): the normal of a contact with a plane; None where the frame of MuJoCo's contact turns with a body."""
    shape, other = world.surface(sides[1]), world.surface(sides[0])
    return tuple(shape.normal) if isinstance(shape, Plane) and not isinstance(other, Capsule) else None
