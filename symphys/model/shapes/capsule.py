"""The capsule: a cylinder with round ends."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, ClassVar, Self

from symphys.model.scalar import Scalar
from symphys.model.shapes.shape import MIN_FLATNESS, UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.model.shapes.sphere import SOLID_SPHERE
from symphys.records import dataclass


@dataclass(frozen=True)
class Capsule(SolidShape):
    """A cylinder with round ends: all points within ``radius`` of a segment along its own z axis.

    Attributes:
        radius: [m].
        half_length: of the segment, from the centre to the centre of a round end [m].
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    kind: ClassVar[str] = "capsule"
    plural: ClassVar[str] = "capsules"
    summary: ClassVar[str] = "A solid cylinder with round ends, along its own z axis."
    example: ClassVar[str] = "{ radius = 0.05, length = 0.3 }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (
        SizeKey("radius"),
        SizeKey(
            "length",
            "length of the straight part [m]; end to end the capsule is 2 radii longer",
            reason="a capsule without length is a sphere",
        ),
    )
    contact_points: ClassVar[Mapping[str, int]] = {"plane": 2, "terrain": 2, "capsule": 5, "box": 8}

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
        r = self.radius
        return 4 / 3 * pi * r * r * r + 2 * pi * r * r * self.half_length

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``: a cylinder and two half balls, whose share in the mass is ``ends``."""
        r, h = self.radius, self.half_length
        ball = SOLID_SPHERE * r * r
        ends = 2 * r / (2 * r + 3 * h)
        across = ends * (ball + h * h + 3 / 4 * r * h) + (1 - ends) * (r * r / 4 + h * h / 3)
        return across, across, ends * ball + (1 - ends) * r * r / 2

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return float(self.radius + self.half_length)

    @property
    def rounded_hull(self) -> RoundedHull:
        """The two ends of its segment."""
        end = float(self.half_length)
        return RoundedHull(float(self.radius), ((0.0, 0.0, -end), (0.0, 0.0, end)))

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
        remedy = f"make the radius {MIN_FLATNESS * most / 2:g} m or more" if thin else "use a sphere"
        return f"radius {self.radius:g} m and length {2 * self.half_length:g} m are of sizes too different; {remedy}"
