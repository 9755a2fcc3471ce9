"""The box."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from math import hypot
from typing import Any, ClassVar, Self

from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes.shape import MIN_FLATNESS, UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.records import dataclass


@dataclass(frozen=True)
class Box(SolidShape):
    """A rectangular block.

    Attributes:
        half_sizes: (3,) [m], along its own axes.
        edge: radius of its edges [m]. Against planes and terrain its corners are balls of this radius, which lie
            inside; all else meets the box with sharp edges, whose mass and inertia it has.
        centre: (3,) [m].
        orientation: (4,) unit quaternion w x y z.
    """

    kind: ClassVar[str] = "box"
    plural: ClassVar[str] = "boxes"
    summary: ClassVar[str] = "A solid box along its own axes."
    example: ClassVar[str] = "{ size = [0.2, 0.1, 0.3] }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (
        SizeKey("size", "full length of its edges along x, y and z [m]", count=3),
    )
    optional_keys: ClassVar[tuple[SizeKey, ...]] = (
        SizeKey("edge", "radius of its edges where it touches planes and terrain [m]; 0: sharp"),
    )
    contact_points: ClassVar[Mapping[str, int]] = {"plane": 8, "terrain": 8, "box": 4}

    half_sizes: tuple[Scalar, ...]
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT
    edge: Scalar = 0.0

    @classmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """Implement ``SolidShape.from_sizes``."""
        return cls(tuple(length / 2 for length in sizes["size"]), centre, orientation, sizes.get("edge", 0.0))

    @property
    def sizes(self) -> dict[str, Any]:
        """The full edges, and their radius."""
        return {"size": tuple(2 * half for half in self.half_sizes)} | (
            {} if is_zero(self.edge) else {"edge": self.edge}
        )

    @property
    def volume(self) -> Scalar:
        """Volume [m^3]."""
        a, b, c = self.half_sizes
        return 8 * a * b * c

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``."""
        a, b, c = (half * half / 3 for half in self.half_sizes)
        return b + c, a + c, a + b

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return hypot(*(half - self.edge for half in self.half_sizes)) + float(self.edge)

    @property
    def rounded_hull(self) -> RoundedHull:
        """Its eight corners, or the centres of their balls."""
        x, y, z = (float(half - self.edge) for half in self.half_sizes)
        return RoundedHull(float(self.edge), tuple(product((-x, x), (-y, y), (-z, z))))

    @property
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """Half sizes."""
        return self.half_sizes

    @property
    def flatness(self) -> str:
        """Implement ``SolidShape.flatness``."""
        least, most = 2 * min(self.half_sizes), 2 * max(self.half_sizes)
        if least >= MIN_FLATNESS * most:
            return ""
        return (
            f"the smallest edge, {least:g} m, is less than {MIN_FLATNESS:g} of the largest, {most:g} m: that is no "
            f"solid; make it {MIN_FLATNESS * most:g} m or more, or use a [[plane]] for a wall"
        )

    @property
    def optional_fault(self) -> str:
        """Implement ``SolidShape.optional_fault``."""
        sizes = (*self.half_sizes, self.edge)
        if not all(isinstance(size, int | float) for size in sizes) or 0 <= self.edge < min(self.half_sizes):
            return ""
        most = min(self.half_sizes)
        return f"the radius of its edges must be less than half the smallest, {most:g} m, not {self.edge:g} m"
