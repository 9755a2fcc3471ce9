"""The convex hull of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np

from symphys.model.scalar import Scalar
from symphys.model.shapes.hull import Corners, Hull, hull_of
from symphys.model.shapes.shape import UPRIGHT, RoundedHull, SizeKey, SolidShape
from symphys.records import dataclass

SLOTS = 8
"""Points in which a hull may touch ground at once."""
FLAT = "these points lie in a plane, up to rounding: that is no solid; give four points or more that enclose a volume"


@dataclass(frozen=True)
class Convex(SolidShape):
    """The solid convex hull of points.

    Attributes:
        points: (n, 3) [m], plain numbers, from ``centre`` along its own axes; points inside the hull change nothing.
        centre: (3,) [m], where the points have their origin: not always the hull's centre of mass.
        orientation: (4,) unit quaternion w x y z.
    """

    kind: ClassVar[str] = "convex"
    plural: ClassVar[str] = "hulls"
    summary: ClassVar[str] = "The solid convex hull of points."
    example: ClassVar[str] = "{ points = [[0, 0, 0.3], [0.2, 0, 0], [-0.1, 0.2, 0], [-0.1, -0.2, 0]] }"
    size_keys: ClassVar[tuple[SizeKey, ...]] = (
        SizeKey("points", "from the centre of the part, along its own axes [m]; 4 to 2000, not in a plane", count=0),
    )
    contact_points: ClassVar[Mapping[str, int]] = {
        "plane": SLOTS,
        "terrain": SLOTS,
        "sphere": 1,
        "capsule": 4,
        "box": 4,
        "cylinder": 4,
        "convex": 4,
    }

    points: Sequence[Sequence[float]]
    centre: tuple[Scalar, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[Scalar, ...] = UPRIGHT

    def __post_init__(self) -> None:
        """Hold the points as ``Corners``."""
        if not isinstance(self.points, Corners):
            rows = np.array(self.points, float).reshape(-1, 3).tolist()
            object.__setattr__(self, "points", Corners(map(tuple, rows)))

    @classmethod
    def from_sizes(cls, sizes: Mapping[str, Any], centre: tuple[Scalar, ...], orientation: tuple[Scalar, ...]) -> Self:
        """Implement ``SolidShape.from_sizes``."""
        return cls(sizes["points"], centre, orientation)

    @property
    def hull(self) -> Hull:
        """Corners, faces and moments; ValueError for points in a plane."""
        found = hull_of(self.points)
        if found is None:
            raise ValueError(FLAT)
        return found

    @property
    def sizes(self) -> dict[str, Any]:
        """Implement ``SolidShape.sizes``."""
        return {"points": self.points}

    @property
    def parameters(self) -> dict[str, Any]:
        """Return no parameters: its points cannot vary."""
        return {}

    def resized(self, sizes: Mapping[str, Any]) -> Self:
        """Implement ``SolidShape.resized``."""
        return self.from_sizes({**self.sizes, **sizes}, self.centre, self.orientation)

    @property
    def volume(self) -> float:
        """Volume [m^3]; 0 if the points lie in a plane."""
        found = hull_of(self.points)
        return 0.0 if found is None else found.volume

    @property
    def moments(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.moments``: the diagonal of its tensor; see ``products``."""
        xx, yy, zz = np.diag(self.hull.tensor).tolist()
        return xx, yy, zz

    @property
    def products(self) -> tuple[Scalar, Scalar, Scalar]:
        """Implement ``SolidShape.products``."""
        tensor = self.hull.tensor.tolist()
        return tensor[1][2], tensor[0][2], tensor[0][1]

    @property
    def centroid(self) -> tuple[Scalar, ...]:
        """Implement ``SolidShape.centroid``; the origin for points in a plane."""
        found = hull_of(self.points)
        return (0.0, 0.0, 0.0) if found is None else tuple(found.centroid.tolist())

    @property
    def extent(self) -> float:
        """Return the distance from the centre to the farthest point [m]."""
        return float(np.linalg.norm(np.array(self.points, float), axis=1).max())

    @property
    def rounded_hull(self) -> RoundedHull:
        """Its corners."""
        return RoundedHull(0.0, tuple((x, y, z) for x, y, z in self.hull.corners.tolist()))

    @property
    def mjcf_size(self) -> tuple[Scalar, ...]:
        """Return no sizes: MuJoCo has the points in a mesh."""
        return ()

    @property
    def flatness(self) -> str:
        """Implement ``SolidShape.flatness``."""
        return FLAT if hull_of(self.points) is None else ""
