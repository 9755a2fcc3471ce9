"""The ellipsoid."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, sin
from typing import Any, ClassVar, Self

from symphys.model.scalar import Scalar
from symphys.model.shapes.shape import MIN_FLATNESS, UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.records import dataclass

DRAWN = 16
"""Meridians in pictures, and half as many circles of latitude."""


@dataclass(frozen=True)
class Ellipsoid(SolidShape):
    """A solid ellipsoid.

    Attributes:
        radii: (3,) [m], along its own axes.
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    kind: ClassVar[str] = "ellipsoid"
    plural: ClassVar[str] = "ellipsoids"
    summary: ClassVar[str] = "A solid ellipsoid along its own axes."
    example: ClassVar[str] = "{ radii = [0.3, 0.2, 0.1] }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (SizeKey("radii", "half axes along x, y and z [m]", count=3),)
    contact_points: ClassVar[Mapping[str, int]] = {"plane": 1, "terrain": 1, "sphere": 1, "capsule": 3}

    radii: tuple[Scalar, ...]
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT

    @classmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """Implement ``SolidShape.from_sizes``."""
        return cls(tuple(sizes["radii"]), centre, orientation)

    @property
    def sizes(self) -> dict[str, Any]:
        """Implement ``SolidShape.sizes``."""
        return {"radii": self.radii}

    @property
    def volume(self) -> Scalar:
        """Volume [m^3]."""
        a, b, c = self.radii
        return 4 / 3 * pi * a * b * c

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``."""
        a, b, c = (radius * radius / 5 for radius in self.radii)
        return b + c, a + c, a + b

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return float(max(self.radii))

    @property
    def rounded_hull(self) -> RoundedHull:
        """Corners on its circles of latitude, and both poles."""
        a, b, c = (float(radius) for radius in self.radii)
        tilts = [pi * k / (DRAWN // 2) for k in range(1, DRAWN // 2)]
        turns = [2 * pi * k / DRAWN for k in range(DRAWN)]
        rings = [(a * sin(t) * cos(u), b * sin(t) * sin(u), c * cos(t)) for t in tilts for u in turns]
        return RoundedHull(0.0, ((0.0, 0.0, -c), (0.0, 0.0, c), *rings))

    @property
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """Half axes."""
        return self.radii

    @property
    def flatness(self) -> str:
        """Implement ``SolidShape.flatness``."""
        least, most = min(self.radii), max(self.radii)
        if least >= MIN_FLATNESS * most:
            return ""
        return (
            f"the smallest radius, {least:g} m, is less than {MIN_FLATNESS:g} of the largest, {most:g} m: that is no "
            f"solid; make it {MIN_FLATNESS * most:g} m or more"
        )
