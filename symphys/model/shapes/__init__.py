"""Shapes: parts of a body's surface, and the static surfaces of a world.

Everything here is frozen. A number may be a float or a casadi symbol. SI units. A shape of a body is placed in the
body's frame, from its centre of mass; a static one in world coordinates. One module a shape, which says all about it:
sizes, volume, inertia, contact points, and how problem files, pictures and MJCF write it; see ``SolidShape``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

from symphys.model.numbers import Number
from symphys.model.scalar import Scalar
from symphys.model.shapes.box import Box
from symphys.model.shapes.capsule import Capsule
from symphys.model.shapes.convex import SLOTS, Convex
from symphys.model.shapes.cylinder import Cylinder
from symphys.model.shapes.ellipsoid import Ellipsoid
from symphys.model.shapes.hull import Hull
from symphys.model.shapes.plane import Plane
from symphys.model.shapes.shape import UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.model.shapes.sphere import SOLID_SPHERE, Sphere
from symphys.model.shapes.terrain import Terrain
from symphys.records import dataclass

__all__ = [
    "POINTS",
    "SHAPES",
    "SLOTS",
    "SOLID_SPHERE",
    "SURFACES",
    "UPRIGHT",
    "Box",
    "Capsule",
    "Convex",
    "Cylinder",
    "Ellipsoid",
    "Fixture",
    "Hull",
    "Plane",
    "RoundedHull",
    "Scalar",
    "Shape",
    "SizeKey",
    "SolidShape",
    "Sphere",
    "Static",
    "Surface",
    "Terrain",
    "contact_points",
    "points_of_kinds",
    "surface",
]

Shape = Sphere | Box | Capsule | Cylinder | Ellipsoid | Convex


@dataclass(frozen=True)
class Fixture:
    """A static shape: a ramp, a wall with an end, a post, a step.

    Attributes:
        name: how formulas and pairs refer to it.
        shape: placed in world coordinates.
    """

    plural: ClassVar[str] = "blocks"
    numbers: ClassVar[Mapping[str, Number]] = MappingProxyType({"position": Number("m")})

    name: str
    shape: Shape

    @property
    def surface(self) -> Shape:
        """Return the surface that bodies may touch."""
        return self.shape

    @property
    def parameters(self) -> dict[str, Any]:
        """The numbers that variables may set, by name."""
        return {"position": self.shape.centre}

    def with_parameters(self, values: Mapping[str, Any]) -> Fixture:
        """The fixture with other ``parameters``."""
        return replace(self, shape=replace(self.shape, centre=values["position"]))


Static = Plane | Fixture | Terrain
Surface = Shape | Plane | Terrain

SHAPES: dict[str, type[Shape]] = {shape.kind: shape for shape in (Sphere, Box, Capsule, Cylinder, Ellipsoid, Convex)}
"""By kind, in the order of messages."""
SURFACES: dict[str, type[Surface]] = {**SHAPES, Plane.kind: Plane, Terrain.kind: Terrain}
"""All that bodies have or touch, by kind."""

POINTS: dict[tuple[type, type], int] = {
    (one, SURFACES[other]): count for one in SURFACES.values() for other, count in one.contact_points.items()
}
"""In how many points two surfaces may touch at once: one candidate for each is looked at in every step."""


def surface(static: Static) -> Surface:
    """Return the surface of a static part of the world."""
    return static.surface


def contact_points(a: Surface, b: Surface) -> int:
    """The candidates of a pair of surfaces, in either order; 0 if no rule covers it."""
    return points_of_kinds(type(a), type(b))


def points_of_kinds(a: type[Surface], b: type[Surface]) -> int:
    """Return the number of contact points of two kinds of surfaces."""
    return POINTS.get((a, b)) or POINTS.get((b, a)) or 0
