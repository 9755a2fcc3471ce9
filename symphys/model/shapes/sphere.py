"""The sphere."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, ClassVar, Self

from symphys.model.scalar import Scalar
from symphys.model.shapes.shape import RoundedHull, SizeKey, SolidShape
from symphys.records import dataclass

SOLID_SPHERE = 2 / 5
"""Of a uniform ball: moment of inertia by mass and squared radius."""


@dataclass(frozen=True)
class Sphere(SolidShape):
    """A ball.

    Attributes:
        radius: [m].
        centre: (3,) [m].
    """

    kind: ClassVar[str] = "sphere"
    plural: ClassVar[str] = "spheres"
    summary: ClassVar[str] = "A solid sphere."
    example: ClassVar[str] = "{ radius = 0.5 }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (SizeKey("radius"),)
    contact_points: ClassVar[Mapping[str, int]] = {"plane": 1, "terrain": 1, "sphere": 1, "capsule": 1, "box": 1}
    turns: ClassVar[bool] = False

    radius: Scalar
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)

    @classmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """Implement ``SolidShape.from_sizes``."""
        return cls(sizes["radius"], centre)

    @property
    def sizes(self) -> dict[str, Any]:
        """Implement ``SolidShape.sizes``."""
        return {"radius": self.radius}

    @property
    def volume(self) -> Scalar:
        """Volume [m^3]."""
        return 4 / 3 * pi * self.radius * self.radius * self.radius

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``."""
        moment = SOLID_SPHERE * self.radius * self.radius
        return moment, moment, moment

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return float(self.radius)

    @property
    def rounded_hull(self) -> RoundedHull:
        """Return the centre as the only corner, with the radius."""
        return RoundedHull(float(self.radius), ((0.0, 0.0, 0.0),))

    @property
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """Radius."""
        return (self.radius,)
