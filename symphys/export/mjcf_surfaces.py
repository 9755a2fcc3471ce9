"""Write surfaces as MJCF geoms, and the pairs that may touch as explicit pairs of geoms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi
from typing import Any
from xml.etree.ElementTree import Element

from symphys.model.shapes import Capsule, Convex, Plane, Shape, Terrain, surface
from symphys.model.world import Law, Side, World, side_name

MJCF_PLACEMENT = {"centre": "pos", "orientation": "quat"}
PAIRS_ONLY = {"contype": "1", "conaffinity": "0"}
"""Attributes of a geom that touches others in explicit pairs only; readers see that it is no visual geom."""
IMPEDANCE = 0.01
"""Impedance of compliant contacts: so small that they act as springs and dampers, 1 % too soft."""
FRICTION_RATIO = 100.0
"""Ratio of the impedances of friction and normal force, so that friction is not as soft as the contact."""


def text(numbers: Iterable[Any]) -> str:
    """Format the numbers of an attribute without loss of digits."""
    return " ".join(repr(float(x)) for x in numbers)


def geoms(world: World, body: int | None) -> list[Element]:
    """Write the surfaces of a body in its frame, or the static surfaces for None, terrain aside."""
    count = len(world.statics if body is None else world.bodies[body].shapes)
    made = (geom(world, Side(body, k)) for k in range(count))
    return [each for each in made if each is not None]


def geom(world: World, side: Side) -> Element | None:
    """Write a surface; None for terrain, which ``mjcf_terrain`` writes."""
    shape = surface(world.statics[side.shape]) if side.body is None else world.bodies[side.body].shapes[side.shape]
    if isinstance(shape, Terrain):
        return None
    name = side_name(world.bodies, world.statics, side)
    placed = half_space(shape) if isinstance(shape, Plane) else solid(shape, name)
    return Element("geom", {"name": name, **placed, **PAIRS_ONLY})


def half_space(plane: Plane) -> dict[str, str]:
    """Return the attributes of an infinite plane; its last size is the spacing of the rendered grid."""
    point = [plane.offset * n for n in plane.normal]
    return {"type": "plane", "size": "0 0 1", "pos": text(point), "zaxis": text(plane.normal)}


def solid(shape: Shape, name: str) -> dict[str, str]:
    """Return kind, sizes and pose of a solid; a convex hull is a mesh of the geom's name."""
    placed = {MJCF_PLACEMENT[key]: text(numbers) for key, numbers in shape.placement.items()}
    if isinstance(shape, Convex):
        return {"type": "mesh", "mesh": name, **placed}
    return {"type": shape.kind, "size": text(shape.mjcf_size), **placed}


def meshes(world: World) -> list[Element]:
    """Write the points of each convex hull as a mesh named as its geom; MuJoCo computes the hull of a mesh."""
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
    """Write each pair of surfaces that may touch, with its contact law; ``stiffer`` is that of ``mjcf_model``."""
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
    """Return the attributes of a compliant contact: stiffness and damping by mass, MuJoCo's direct form."""
    if not law.soft:
        return {}
    rate, stop = 2 * pi * float(law.frequency), IMPEDANCE / step
    spring = -factor * rate * rate, -factor * 2 * max(float(law.damping), 1e-9) * rate
    held = {"solimp": text((IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0)), "solreffriction": text((-stop, -stop))}
    return {"solref": text(spring), **held}


def normal_of(world: World, sides: tuple[Side, Side]) -> tuple[Any, ...] | None:
    """Return the normal (3,) of a contact with a plane; None where MuJoCo's contact frame rotates with a body."""
    shape, other = world.surface(sides[1]), world.surface(sides[0])
    return tuple(shape.normal) if isinstance(shape, Plane) and not isinstance(other, Capsule) else None
