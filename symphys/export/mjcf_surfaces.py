"""Write surfaces as MJCF geoms, terrain as height fields, and the pairs that may touch as explicit pairs of geoms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi
from typing import Any
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np

from symphys.export.mjcf_bodies import StartState
from symphys.model.heightfield import GRID_REFINEMENT, Heightfield, off_triangles
from symphys.model.shapes import Capsule, Convex, Plane, Shape, Terrain, surface
from symphys.model.world import Law, Side, World, side_name
from symphys.records import dataclass
from symphys.types import Array

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
    """Write a surface; None for terrain, which ``height_field`` writes."""
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


SAMPLED_MARGIN = 10.0
"""Margin around the bodies at the start within which terrain without a grid is sampled [m]."""
SAMPLE_SPACING = 0.2
"""Distance of its samples [m]."""
THICKNESS = 1.0
"""Thickness of the solid below the lowest height [m]."""


@dataclass(frozen=True)
class Grid:
    """The grid of a height field.

    Attributes:
        origin: (2,) x and y of the first height [m], world frame.
        spacing: (2,) distances along x and along y [m].
        count: (2,) numbers of heights along x and along y.
    """

    origin: tuple[float, float]
    spacing: tuple[float, float]
    count: tuple[int, int]


def window(start: StartState, terrain: Terrain) -> Grid:
    """Return the grid of terrain that has one; otherwise one around the bodies at the start."""
    height = terrain.height
    if isinstance(height, Heightfield):
        return Grid(height.origin, height.spacing, (len(height.heights[0]), len(height.heights)))
    places = np.array([start.of(k, "position")[:2] for k in range(len(start.world.bodies))])
    low, high = np.floor(places.min(0) - SAMPLED_MARGIN), np.ceil(places.max(0) + SAMPLED_MARGIN)
    columns, rows = np.rint((high - low) / SAMPLE_SPACING).astype(int) + 1
    return Grid((float(low[0]), float(low[1])), (SAMPLE_SPACING, SAMPLE_SPACING), (int(columns), int(rows)))


def sampled(terrain: Terrain, grid: Grid, finer: int = 1) -> Array:
    """Sample heights (rows, columns) [m] on a grid, rows along y, with ``finer`` parts in each spacing."""
    columns, rows = (finer * (n - 1) + 1 for n in grid.count)
    height = terrain.height
    if isinstance(height, Heightfield):
        return height.on_grid(np.arange(rows) / finer, np.arange(columns) / finer)
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("height", [x, y], [ca.densify(ca.SX(height(x, y)))])
    xs, ys = (
        origin + step * np.arange(n) / finer
        for origin, step, n in zip(grid.origin, grid.spacing, (columns, rows), strict=True)
    )
    places = [each.reshape(1, -1) for each in np.meshgrid(xs, ys)]
    return np.array(function(*map(ca.DM, places))).reshape(rows, columns)


def deviation(terrain: Terrain, grid: Grid) -> float:
    """Return the largest distance of a surface from triangles on its grid [m], for either diagonal of each square."""
    fine = sampled(terrain, grid, GRID_REFINEMENT)
    return off_triangles(fine, fine[::GRID_REFINEMENT, ::GRID_REFINEMENT], GRID_REFINEMENT)


def height_field(start: StartState, terrain: Terrain) -> Element:
    """Write the asset of a height field: heights between 0 and 1, and their scale."""
    grid = window(start, terrain)
    heights = sampled(terrain, grid)
    low, high = float(heights.min()), float(heights.max())
    scaled = (heights - low) / (high - low) if high > low else np.zeros_like(heights)
    half = [step * (n - 1) / 2 for step, n in zip(grid.spacing, grid.count, strict=True)]
    size = [*half, high - low if high > low else 1.0, THICKNESS]
    return Element(
        "hfield",
        name=terrain.name,
        nrow=str(grid.count[1]),
        ncol=str(grid.count[0]),
        size=" ".join(map(repr, size)),
        elevation=" ".join(repr(float(each)) for each in scaled[::-1].ravel()),
    )


def middle(start: StartState, terrain: Terrain) -> tuple[float, float, float]:
    """Return the position (3,) [m] of a height field, whose lowest point has height 0."""
    grid = window(start, terrain)
    x, y = (o + step * (n - 1) / 2 for o, step, n in zip(grid.origin, grid.spacing, grid.count, strict=True))
    return x, y, float(sampled(terrain, grid).min())
