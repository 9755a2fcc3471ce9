"""The cylinder."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, hypot, pi, sin
from typing import Any, ClassVar, Self

from symphys.model.scalar import Scalar
from symphys.model.shapes.shape import MIN_FLATNESS, UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.records import dataclass

DRAWN = 24
"""Corners of a rim in pictures."""


@dataclass(frozen=True)
class Cylinder(SolidShape):
    """A solid cylinder with flat ends along its own z axis.

    Attributes:
        radius: [m].
        half_length: half of the distance between the ends [m].
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    kind: ClassVar[str] = "cylinder"
    plural: ClassVar[str] = "cylinders"
    summary: ClassVar[str] = "A solid cylinder along its own z axis."
    example: ClassVar[str] = "{ radius = 0.05, length = 0.3 }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (SizeKey("radius"), SizeKey("length", "from end to end [m]"))
    contact_points: ClassVar[Mapping[str, int]] = {
        "plane": 6,
        "terrain": 6,
        "sphere": 1,
        "capsule": 3,
        "box": 4,
        "cylinder": 4,
    }

    radius: Scalar
    half_length: Scalar
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT

    @classmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """Implement ``SolidShape.from_sizes``."""
        return cls(sizes["radius"], sizes["length"] / 2, centre, orientation)

    @property
    def sizes(self) -> dict[str, Any]:
        """Implement ``SolidShape.sizes``."""
        return {"radius": self.radius, "length": 2 * self.half_length}

    @property
    def volume(self) -> Scalar:
        """Volume [m^3]."""
        return 2 * pi * self.radius * self.radius * self.half_length

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``."""
        square = self.radius * self.radius
        across = square / 4 + self.half_length * self.half_length / 3
        return across, across, square / 2

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return hypot(self.radius, self.half_length)

    @property
    def rounded_hull(self) -> RoundedHull:
        """Corners on both rims."""
        r, h = float(self.radius), float(self.half_length)
        turns = [2 * pi * k / DRAWN for k in range(DRAWN)]
        return RoundedHull(0.0, tuple((r * cos(a), r * sin(a), end) for end in (-h, h) for a in turns))

    @property
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """Radius and half length."""
        return (self.radius, self.half_length)

    @property
    def flatness(self) -> str:
        """Implement ``SolidShape.flatness``."""
        least, most = sorted((2 * self.radius, 2 * self.half_length))
        if least >= MIN_FLATNESS * most:
            return ""
        thin = self.radius < self.half_length
        remedy = f"make the {'radius' if thin else 'length'} {MIN_FLATNESS * most / (2 if thin else 1):g} m or more"
        text = f"radius {self.radius:g} m and length {2 * self.half_length:g} m"
        return f"{text} are of sizes too different; {remedy}"
